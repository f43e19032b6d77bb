"""KRL's types as the checker sees them; None stands for a type that is not known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True)
class Basic:
    """INT, REAL, BOOL or CHAR."""

    name: str


@dataclass(frozen=True)
class EnumKind:
    """An ENUM."""

    name: str
    members: tuple[str, ...]


@dataclass(frozen=True)
class AnyEnum:
    """The type of `#NAME` before it is known of which ENUM it is."""

    member: str

    @property
    def name(self) -> str:
        """As it is written."""
        return f"#{self.member}"


@dataclass(frozen=True)
class StructKind:
    """A STRUC; two are the same when their names are."""

    name: str
    fields: tuple[tuple[str, Kind | None], ...]

    def field(self, name: str) -> tuple[bool, Kind | None]:
        """Whether there is such a field, and its type."""
        for own, kind in self.fields:
            if own == name:
                return True, kind
        return False, None


@dataclass(frozen=True)
class ArrayKind:
    """An array; a size is None where it is not known."""

    element: Kind | None
    sizes: tuple[int | None, ...]

    @property
    def name(self) -> str:
        """As it would be declared."""
        inner = ",".join("" if size is None else str(size) for size in self.sizes)
        return f"{self.element.name if self.element else '?'}[{inner}]"


@dataclass(frozen=True)
class AggregateKind:
    """The type of an aggregate without a tag: whatever has these components."""

    components: tuple[str, ...]

    @property
    def name(self) -> str:
        """As it is written."""
        return f"{{{', '.join(self.components)}}}"


Kind: TypeAlias = "Basic | EnumKind | AnyEnum | StructKind | ArrayKind | AggregateKind"

INT, REAL, BOOL, CHAR = (Basic(name) for name in ("INT", "REAL", "BOOL", "CHAR"))
NUMBERS = (INT, REAL)

FRAMES = ("FRAME", "POS", "E3POS", "E6POS")
AXES = ("AXIS", "E3AXIS", "E6AXIS")
"""Within each of the two a value of one type is taken for another; missing parts stay open."""


def is_text(kind: Kind | None) -> bool:
    """Whether it is a CHAR array of one dimension."""
    return isinstance(kind, ArrayKind) and kind.element == CHAR and len(kind.sizes) == 1


def fits(target: Kind | None, value: Kind | None) -> bool:
    """Whether a value can be given to a variable; what is not known always can.

    INT and REAL mix: a REAL given to an INT is rounded (SI, "Data types").
    """
    if target is None or value is None or target == value:
        return True
    if target in NUMBERS and value in NUMBERS:
        return True
    if isinstance(target, EnumKind):
        member = isinstance(value, AnyEnum) and value.member in target.members
        return member or (isinstance(value, EnumKind) and value.name == target.name)
    if isinstance(target, StructKind) and isinstance(value, StructKind):
        pairs = ({target.name, value.name} <= set(family) for family in (FRAMES, AXES))
        return target.name == value.name or any(pairs)
    if isinstance(target, StructKind) and isinstance(value, AggregateKind):
        return all(target.field(name)[0] for name in value.components)
    if is_text(target) and is_text(value):
        return True
    # One character in quotation marks is a CHAR as well.
    return target == CHAR and isinstance(value, ArrayKind) and value == ArrayKind(CHAR, (1,))
