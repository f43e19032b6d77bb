"""The flavour `kvp`: what KUKAVARPROXY makes of a read event, does to variables, how long it takes.

Not responsible for connections. Service times: percentiles of the raw samples of
ivareri/KUKAVARPROXY_tests (KR 16, 2018; C++ client, one connection), which have two peaks.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Protocol

from sphmctl.emulators.krl_text import Struct, Type
from sphmctl.emulators.kvp_flavour import Taken, UnansweredError
from sphmctl.emulators.kvp_frames import (
    READ,
    READ_ARRAY,
    TEXT,
    WRITE,
    WRITE_ARRAY,
    Request,
    answer,
    framed,
    numbers,
    requests,
    words,
)


@dataclass(frozen=True)
class Peaks:
    """A distribution with two normal peaks, s; `upper_share` of the draws are of the upper one."""

    floor_s: float
    lower_s: float
    lower_deviation_s: float
    upper_s: float
    upper_deviation_s: float
    upper_share: float = 0.25

    def draw(self, rng: random.Random) -> float:
        """One time."""
        if rng.random() < self.upper_share:
            return max(self.floor_s, rng.gauss(self.upper_s, self.upper_deviation_s))
        return max(self.floor_s, rng.gauss(self.lower_s, self.lower_deviation_s))


SCALAR_S = Peaks(1.63e-3, 1.98e-3, 0.15e-3, 4.25e-3, 0.38e-3)
"""Reads and writes of one INT: 2.05, 4.35 and 4.98 ms at p50, p90 and p99, 1.63 at least."""

AGGREGATE_READ_S = Peaks(1.86e-3, 2.22e-3, 0.15e-3, 4.48e-3, 0.38e-3)
"""Reads of an E6AXIS: 2.29, 4.58 and 5.12 ms, 1.86 at least; taken for every structure."""

AGGREGATE_WRITE_S = Peaks(2.60e-3, 3.20e-3, 0.18e-3, 5.53e-3, 0.25e-3)
"""Writes of an E6AXIS: 3.28, 5.58 and 5.97 ms, 2.60 at least; taken for every structure."""

PING_S = 0.3e-3
"""PING never reaches the controller: what an ICMP ping took there, 0.34 ms in the median."""

STALL_PROBABILITY = 1e-4
"""100,000 reads on one connection had a handful of outliers, the worst of 29 ms."""

STALL_S = (0.020, 0.080)
"""Shortest and longest stall: the worst case of each of the measured series lies between."""


class Variables(Protocol):
    """What the server needs of the controller."""

    def kind_of(self, name: str) -> Type | None:
        """The type of what a name leads to; None when it leads nowhere."""

    def read_text(self, name: str) -> str | None:
        """The text of a variable or a part of it; None when the name is unknown."""

    def write_text(self, name: str, text: str) -> bool:
        """Set a variable or a part of it; False when that is refused."""


CLIENTS_LIMIT = 10
"""`g_nMaxClients`."""

IDLE_LIMIT_S = 30.0
"""`lTimeOutRequest`."""

EVENT_LIMIT = 2048
"""Bytes that one read event takes from the socket: `Read(strBuffer, 2048)`."""


class Kvp:
    """KUKAVARPROXY in front of a store of variables, as a `Flavour`."""

    clients_limit = CLIENTS_LIMIT
    idle_limit_s = IDLE_LIMIT_S
    message_limit_s = IDLE_LIMIT_S
    deaf_while_sending = False

    def __init__(self, store: Variables, rng: random.Random) -> None:
        self._store = store
        self._rng = rng

    def take(self, inbox: bytes) -> Taken:
        """One read event: every request in it that the server finds."""
        event, rest = inbox[:EVENT_LIMIT], inbox[EVENT_LIMIT:]
        last = _Last()
        jobs = (_Job(self._store, self._rng, request, last) for request in requests(event))
        return Taken(tuple(jobs), rest, bool(rest))


@dataclass
class _Last:
    """The server's answer variable within an event: it outlives a request without an answer."""

    reply: bytes = b""


@dataclass(frozen=True)
class _Job:
    """One request of an event."""

    store: Variables
    rng: random.Random
    request: Request
    last: _Last

    def service_s(self) -> float:
        """The time that the server spends on it."""
        return service_s(self.store, self.request, self.rng)

    def run(self) -> bytes:
        """Do it; an unknown function gets the reply before once more."""
        body = execute(self.store, self.request)
        self.last.reply = framed(self.request.id, self.last.reply if body is None else body)
        return self.last.reply


def access_s(store: Variables, name: str, rng: random.Random, *, write: bool) -> float:
    """The time that one variable takes, network and controller together."""
    stall_s = rng.uniform(*STALL_S) if rng.random() < STALL_PROBABILITY else 0.0
    if not isinstance(store.kind_of(name), Struct):
        return stall_s + SCALAR_S.draw(rng)
    return stall_s + (AGGREGATE_WRITE_S if write else AGGREGATE_READ_S).draw(rng)


def service_s(store: Variables, request: Request, rng: random.Random) -> float:
    """The time that the server spends on a request."""
    if request.function not in (READ, WRITE, READ_ARRAY, WRITE_ARRAY):
        return PING_S
    if request.function == READ and request.name == "PING":
        return PING_S
    return access_s(store, request.name, rng, write=request.function == WRITE)


def execute(store: Variables, request: Request) -> bytes | None:
    """Do what a request asks; returns the reply's body, None for an unknown function.

    Raises:
        UnansweredError: when the server gives no reply.
    """
    function, name = request.function, request.name
    if function == READ:
        text = "PONG" if name == "PING" else _show(store, name)
        return answer(READ, text.encode(TEXT, "replace"), success=True)
    if function == WRITE:
        done = store.write_text(name, request.value)
        return answer(WRITE, request.value.encode(TEXT), success=done)
    if function == READ_ARRAY:
        try:
            packed = words(_show(store, name))
        except ValueError as problem:
            raise UnansweredError(str(problem)) from problem
        return answer(READ_ARRAY, packed, success=True)
    if function == WRITE_ARRAY:
        done = False
        for index, number in enumerate(numbers(request.value), start=1):
            # The flag tells only how the last element went.
            done = store.write_text(f"{name.removesuffix('[]')}[{index}]", number)
        return answer(WRITE_ARRAY, b"", success=done)
    return None


def _show(store: Variables, name: str) -> str:
    """A value as the server shows it: trimmed; unknown and undefined ones are empty."""
    return (store.read_text(name) or "").strip(" ")
