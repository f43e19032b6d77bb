"""What tells one kind of variable server from another, as the network side sees it."""

from __future__ import annotations

from typing import NamedTuple, Protocol


class UnansweredError(Exception):
    """The server runs into an error of its own and forgets the rest of the read event."""


class HangUpError(Exception):
    """The server ends the connection instead of answering."""


class Job(Protocol):
    """One request that the server understood."""

    def service_s(self) -> float:
        """The time that the server spends on it; drawn anew at each call."""

    def run(self) -> bytes:
        """Do it now; the reply as it is sent.

        Raises:
            UnansweredError: there is no reply, and the rest of the event is forgotten.
            HangUpError: the connection ends.
        """


class Taken(NamedTuple):
    """What a server made of the bytes that a socket holds.

    Attributes:
        jobs: to be done one after the other.
        rest: the bytes that stay in the socket.
        again: whether the rest is worth another look before more bytes arrive.
        hang_up: whether the connection ends now.
    """

    jobs: tuple[Job, ...]
    rest: bytes
    again: bool
    hang_up: bool = False


class Flavour(Protocol):
    """One kind of server; knows frames and variables, but no connection."""

    @property
    def clients_limit(self) -> int:
        """Connections at the same time; one more is accepted and closed at once."""

    @property
    def idle_limit_s(self) -> float:
        """A client that says nothing for longer is closed."""

    @property
    def message_limit_s(self) -> float:
        """The same within a message that has begun."""

    @property
    def deaf_while_sending(self) -> bool:
        """Whether bytes that arrive while a reply is not fully sent are thrown away."""

    def take(self, inbox: bytes) -> Taken:
        """Read once from a socket that holds `inbox`."""
