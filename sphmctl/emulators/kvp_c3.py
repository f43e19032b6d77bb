"""The flavour `c3`: C3 Bridge, the successor of KUKAVARPROXY, in front of one controller.

What each function does and when the server hangs up is after ulsu-tech/c3bridge-server (1.4.0),
source/client.cpp and source/handlers. Not there: motion (11), keys (12), benchmark (17) and files
(20 to 30); who asks for one is disconnected, as by a server that was built without it. Guesses:
an access takes as long as KUKAVARPROXY's, since nobody has published figures of this server, and
what the controller refuses has the code "general", which is what an unknown HRESULT becomes.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta

from sphmctl.emulators import kvp_c3_frames as c3
from sphmctl.emulators.controller import Controller
from sphmctl.emulators.krc_keys import ROBOT
from sphmctl.emulators.kvp_flavour import HangUpError, Taken
from sphmctl.emulators.kvp_service import PING_S, access_s

CLIENTS_LIMIT = 2**31
"""The server keeps a list without an end."""

VERSION = (1, 4)
"""Release 1.4.0, "Open Source"."""

HOSTNAME = "WINDOWS-KRC4"
"""Any name; the controller's Windows has one."""

POWER_ON = datetime(2026, 1, 1, 8, 0)
"""What the controller's clock showed at the start: the same seed must give the same bytes."""


@dataclass(frozen=True)
class _Answer:
    """A reply without its head: payload, error code, and the success flag that follows from it."""

    payload: bytes
    code: int = c3.SUCCESS

    @property
    def success(self) -> bool:
        """The flag."""
        return self.code == c3.SUCCESS


class C3:
    """C3 Bridge as a `Flavour`.

    Args:
        controller: whose variables and programs it reaches.
        rng: draws the service times.
        idle_limit_s: its setting NetworkIdleTimeout; off as it is shipped.
        message_limit_s: NetworkMessageTimeout, for a message that has begun; off as well.
    """

    clients_limit = CLIENTS_LIMIT
    deaf_while_sending = True

    def __init__(
        self,
        controller: Controller,
        rng: random.Random,
        *,
        idle_limit_s: float = math.inf,
        message_limit_s: float = math.inf,
    ) -> None:
        self._controller = controller
        self._store = controller.store
        self._rng = rng
        self.idle_limit_s = idle_limit_s
        # Without its own limit a message has the idle client's (Client::onHeader).
        self.message_limit_s = min(message_limit_s, idle_limit_s)
        self._functions: dict[int, Callable[[int, c3.Reader], _Answer]] = {
            c3.READ_ASCII: self._read_ascii,
            c3.WRITE_ASCII: self._write_ascii,
            c3.READ: self._read,
            c3.WRITE: self._write,
            c3.READ_MANY: self._many,
            c3.WRITE_MANY: self._many,
            c3.PROGRAM: self._program,
            c3.INFO: self._info,
            c3.FEATURES: self._features,
            c3.CONFIRM_ALL: self._confirm_all,
        }

    def take(self, inbox: bytes) -> Taken:
        """One message, once all of it has come; what cannot be one ends the connection at once."""
        if len(inbox) < c3.HEADER:
            return Taken((), inbox, again=False)
        length, function = int.from_bytes(inbox[2:4], "big"), inbox[4]
        if length == 0 or function not in self._functions:
            return Taken((), b"", again=False, hang_up=True)
        end = 4 + length
        if len(inbox) < end:
            return Taken((), inbox, again=False)
        job = _Job(self, inbox[:2], function, inbox[c3.HEADER : end])
        return Taken((job,), inbox[end:], again=len(inbox) > end)

    def answer(self, tag: bytes, function: int, payload: bytes) -> bytes:
        """Do what a message asks for; the whole reply.

        Raises:
            HangUpError: the reply is longer than its length field can say.
        """
        answer = self._functions[function](function, c3.Reader(payload))
        if len(answer.payload) > c3.PAYLOAD_LIMIT:
            if function not in (c3.READ_MANY, c3.WRITE_MANY):
                raise HangUpError
            answer = _Answer(b"\x00", c3.ERROR_LONG_ANSWER)
        return c3.reply(tag, function, answer.payload, answer.code, success=answer.success)

    def service_s(self, function: int, payload: bytes) -> float:
        """The sum of the accesses, one after the other, with the network's share once."""
        accesses = _accesses(function, c3.Reader(payload))
        times_s = (access_s(self._store, name, self._rng, write=w) - PING_S for name, w in accesses)
        return PING_S + sum(times_s)

    def _show(self, name: str) -> str | None:
        """A value as it is; None where there is none. PING and @ words come after variables."""
        value = self._store.read_text(name)
        # KUKAVARPROXY's empty answer to an undefined variable is a failure here.
        return value or ("PONG" if name == "PING" else self._proxy(name))

    def _proxy(self, name: str) -> str | None:
        features = "".join(str(int(f in self._functions)) for f in range(256)).rstrip("0")
        words = {
            "@PROXY_TYPE": "C3 BRIDGE INTERFACE",
            "@PROXY_VERSION": f"{VERSION[0]}.{VERSION[1]} (OPEN SOURCE)",
            "@PROXY_FEATURES": features[::-1],
            "@PROXY_HOSTNAME": HOSTNAME,
            "@PROXY_TIME": self._now().strftime("%Y-%m-%dT%H:%M:%SZ"),
            "@PROXY_ADDRESS": "0.0.0.0",
            "@PROXY_PORT": "7000",
            "@PROXY_ENABLED": "TRUE",
        }
        return words.get(name)

    def _now(self) -> datetime:
        return POWER_ON + timedelta(seconds=self._controller.world_s)

    def _read_ascii(self, function: int, reader: c3.Reader) -> _Answer:
        try:
            value = self._show(reader.ascii())
        except c3.ShortError:
            value = None
        code = c3.ERROR_GENERAL if value is None else c3.SUCCESS
        return _Answer(c3.ascii_text(value or ""), code)

    def _write_ascii(self, function: int, reader: c3.Reader) -> _Answer:
        try:
            name, value = reader.ascii(), reader.ascii()
        except c3.ShortError:
            return _Answer(c3.ascii_text(""), c3.ERROR_GENERAL)
        if not self._store.write_text(name, value):
            return _Answer(c3.ascii_text(""), c3.ERROR_GENERAL)
        return _Answer(c3.ascii_text(value))

    def _read(self, function: int, reader: c3.Reader) -> _Answer:
        try:
            value = self._show(reader.wide())
        except c3.ShortError:
            return _Answer(c3.wide_text(""), c3.ERROR_PROTOCOL)
        code = c3.ERROR_GENERAL if value is None else c3.SUCCESS
        return _Answer(c3.wide_text(value or ""), code)

    def _write(self, function: int, reader: c3.Reader) -> _Answer:
        try:
            name, value = reader.wide(), reader.wide()
        except c3.ShortError:
            return _Answer(c3.wide_text(""), c3.ERROR_PROTOCOL)
        if not self._store.write_text(name, value):
            return _Answer(c3.wide_text(""), c3.ERROR_GENERAL)
        return _Answer(c3.wide_text(value))

    def _many(self, function: int, reader: c3.Reader) -> _Answer:
        """Functions 6 and 7; what comes before a payload's early end is still done."""
        parts = []
        failed = False
        try:
            count = reader.byte()
            for _ in range(count):
                name = reader.wide()
                if function == c3.READ_MANY:
                    value, done = self._shown(name)
                else:
                    value, done = self._changed(name, reader.wide())
                failed = failed or not done
                code = c3.SUCCESS if done else c3.ERROR_GENERAL
                parts.append(bytes((code,)) + c3.wide_text(value))
        except c3.ShortError:
            return _Answer(b"\x00", c3.ERROR_PROTOCOL)
        code = c3.ERROR_GENERAL if failed else c3.SUCCESS
        return _Answer(bytes((count,)) + b"".join(parts), code)

    def _shown(self, name: str) -> tuple[str, bool]:
        value = self._show(name)
        return value or "", value is not None

    def _changed(self, name: str, value: str) -> tuple[str, bool]:
        """Write and read again; a refused value comes back as it was sent."""
        if not self._store.write_text(name, value):
            return value, False
        return self._store.read_text(name) or "", True

    def _program(self, function: int, reader: c3.Reader) -> _Answer:
        command, code = 0, c3.ERROR_PROTOCOL
        try:
            command = reader.byte()
            interpreter = reader.short()
            name = ""
            if command in (5, 6):
                name, _, force = reader.wide(), reader.wide(), reader.byte() != 0
            code = c3.ERROR_NOT_IMPLEMENTED
            if 1 <= command <= 4:
                code = int(self._controller.keys.press(COMMANDS[command - 1], interpreter))
            elif command in (5, 6):
                code = int(self._controller.keys.select(name, force=force))
                if code and command == 6:
                    code = int(self._controller.keys.press("start", ROBOT))
        except c3.ShortError:
            code = c3.ERROR_PROTOCOL
        return _Answer(bytes((command,)), code)

    def _info(self, function: int, reader: c3.Reader) -> _Answer:
        now = self._now()
        weekday = now.isoweekday() % 7
        fields = (now.year, now.month, weekday, now.day, now.hour, now.minute, now.second)
        clock = (*fields, now.microsecond // 1000)
        time = b"".join(field.to_bytes(2, "big") for field in clock)
        return _Answer(bytes((*VERSION, 0)) + time + c3.wide_text(HOSTNAME))

    def _features(self, function: int, reader: c3.Reader) -> _Answer:
        bits = sum(1 << number for number in self._functions)
        return _Answer(bits.to_bytes(32, "big"))

    def _confirm_all(self, function: int, reader: c3.Reader) -> _Answer:
        return _Answer(b"", int(self._controller.keys.confirm_messages()))


COMMANDS = ("reset", "start", "stop", "cancel")
"""Function 10's commands 1 to 4; 5 is select, 6 select and start."""


@dataclass(frozen=True)
class _Job:
    """One message."""

    server: C3
    tag: bytes
    function: int
    payload: bytes

    def service_s(self) -> float:
        """The time that the server spends on it."""
        return self.server.service_s(self.function, self.payload)

    def run(self) -> bytes:
        """Do it; every variable is of the instant of the reply."""
        return self.server.answer(self.tag, self.function, self.payload)


def _accesses(function: int, reader: c3.Reader) -> list[tuple[str, bool]]:
    """The variables that a message reaches, and whether each is written."""
    found: list[tuple[str, bool]] = []
    try:
        if function in (c3.READ_ASCII, c3.WRITE_ASCII):
            found.append((reader.ascii(), function == c3.WRITE_ASCII))
        elif function in (c3.READ, c3.WRITE):
            found.append((reader.wide(), function == c3.WRITE))
        elif function == c3.READ_MANY:
            found.extend([(reader.wide(), False) for _ in range(reader.byte())])
        elif function == c3.WRITE_MANY:
            for _ in range(reader.byte()):
                name, _value = reader.wide(), reader.wide()
                # It is read again after writing.
                found += [(name, True), (name, False)]
    except c3.ShortError:
        pass
    return found
