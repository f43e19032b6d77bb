"""The tree of a KRL module: frozen data, one class for each thing that KRL can say.

Every node carries its `Place`, which does not count in comparisons: two texts that say the same
have equal trees. Names, keywords and enum values stand in upper case, since KRL is not
case-sensitive; strings stand as written. A body is a tuple of statements.
Declarations and expressions stand in modules of their own; all their names are here as well.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from sphmctl.emulators.krl.declarations import (
    MAX_DIMENSIONS as MAX_DIMENSIONS,
)
from sphmctl.emulators.krl.declarations import (
    Declaration as Declaration,
)
from sphmctl.emulators.krl.declarations import (
    Declarator as Declarator,
)
from sphmctl.emulators.krl.declarations import (
    Declare as Declare,
)
from sphmctl.emulators.krl.declarations import (
    Enum as Enum,
)
from sphmctl.emulators.krl.declarations import (
    Ext as Ext,
)
from sphmctl.emulators.krl.declarations import (
    Parameter as Parameter,
)
from sphmctl.emulators.krl.declarations import (
    Signal as Signal,
)
from sphmctl.emulators.krl.declarations import (
    Struc as Struc,
)
from sphmctl.emulators.krl.declarations import (
    StrucMember as StrucMember,
)
from sphmctl.emulators.krl.declarations import (
    TypeName as TypeName,
)
from sphmctl.emulators.krl.expressions import (
    PRECEDENCE as PRECEDENCE,
)
from sphmctl.emulators.krl.expressions import (
    UNARY_PRECEDENCE as UNARY_PRECEDENCE,
)
from sphmctl.emulators.krl.expressions import (
    Aggregate as Aggregate,
)
from sphmctl.emulators.krl.expressions import (
    Binary as Binary,
)
from sphmctl.emulators.krl.expressions import (
    BoolLiteral as BoolLiteral,
)
from sphmctl.emulators.krl.expressions import (
    Call as Call,
)
from sphmctl.emulators.krl.expressions import (
    Component as Component,
)
from sphmctl.emulators.krl.expressions import (
    EnumLiteral as EnumLiteral,
)
from sphmctl.emulators.krl.expressions import (
    Expression as Expression,
)
from sphmctl.emulators.krl.expressions import (
    Field as Field,
)
from sphmctl.emulators.krl.expressions import (
    Index as Index,
)
from sphmctl.emulators.krl.expressions import (
    IntLiteral as IntLiteral,
)
from sphmctl.emulators.krl.expressions import (
    Name as Name,
)
from sphmctl.emulators.krl.expressions import (
    Node as Node,
)
from sphmctl.emulators.krl.expressions import (
    Place as Place,
)
from sphmctl.emulators.krl.expressions import (
    RealLiteral as RealLiteral,
)
from sphmctl.emulators.krl.expressions import (
    Reference as Reference,
)
from sphmctl.emulators.krl.expressions import (
    StringLiteral as StringLiteral,
)
from sphmctl.emulators.krl.expressions import (
    Unary as Unary,
)

# Statements


@dataclass(frozen=True, slots=True)
class Assign(Node):
    """`target=value`; in a data list also outside of a declaration."""

    target: Reference
    value: Expression


@dataclass(frozen=True, slots=True)
class Label(Node):
    """`NAME:`."""

    name: str


@dataclass(frozen=True, slots=True)
class Goto(Node):
    """`GOTO NAME`."""

    label: str


@dataclass(frozen=True, slots=True)
class If(Node):
    """`IF condition THEN then ELSE otherwise ENDIF`."""

    condition: Expression
    then: Body = ()
    otherwise: Body = ()


@dataclass(frozen=True, slots=True)
class Case(Node):
    """`CASE a,b` with what follows; never falls through."""

    values: tuple[Expression, ...]
    body: Body = ()


@dataclass(frozen=True, slots=True)
class Switch(Node):
    """`SWITCH subject`; `default` is None without DEFAULT."""

    subject: Expression
    cases: tuple[Case, ...] = ()
    default: Body | None = None


@dataclass(frozen=True, slots=True)
class For(Node):
    """`FOR counter=start TO end STEP step`; a missing step is 1."""

    counter: Reference
    start: Expression
    end: Expression
    step: Expression | None = None
    body: Body = ()


@dataclass(frozen=True, slots=True)
class While(Node):
    """`WHILE condition ... ENDWHILE`."""

    condition: Expression
    body: Body = ()


@dataclass(frozen=True, slots=True)
class Repeat(Node):
    """`REPEAT ... UNTIL until`; `until_at` is the place of the condition."""

    until: Expression
    body: Body
    until_at: Place = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Loop(Node):
    """`LOOP ... ENDLOOP`."""

    body: Body = ()


@dataclass(frozen=True, slots=True)
class Simple(Node):
    """A statement that is one word."""

    word: Literal["EXIT", "HALT", "CONTINUE", "RESUME", "ON_ERROR_PROCEED"]


@dataclass(frozen=True, slots=True)
class Return(Node):
    """`RETURN` or `RETURN value`."""

    value: Expression | None = None


@dataclass(frozen=True, slots=True)
class WaitFor(Node):
    """`WAIT FOR condition`."""

    condition: Expression


@dataclass(frozen=True, slots=True)
class WaitSec(Node):
    """`WAIT SEC duration`, in seconds."""

    duration: Expression


MotionKind = Literal[
    "PTP", "PTP_REL", "LIN", "LIN_REL", "CIRC", "CIRC_REL", "SPTP", "SLIN", "SCIRC"
]


@dataclass(frozen=True, slots=True)
class Motion(Node):
    """A motion block.

    Attributes:
        via: the auxiliary point of CIRC, CIRC_REL and SCIRC, else None.
        angle: behind CA, in degrees.
        blends: of C_PTP C_DIS C_VEL C_ORI C_SPL, as written; () for an exact stop.
        frame: "BASE" or "TOOL" behind LIN_REL and CIRC_REL, else "".
        settings: behind WITH, for the S motions.
    """

    kind: MotionKind
    target: Expression
    via: Expression | None = None
    angle: Expression | None = None
    blends: tuple[str, ...] = ()
    frame: str = ""
    settings: tuple[Assign, ...] = ()


@dataclass(frozen=True, slots=True)
class Trigger(Node):
    """`TRIGGER WHEN DISTANCE=1 DELAY=20 DO F() PRIO=-1`; delay in ms, PATH in mm."""

    kind: Literal["DISTANCE", "PATH"]
    value: Expression
    action: Assign | Call | Pulse
    delay: Expression | None = None
    priority: Expression | None = None
    on_start: bool = False


@dataclass(frozen=True, slots=True)
class InterruptDeclare(Node):
    """`GLOBAL INTERRUPT DECL 20 WHEN condition DO F()`; a statement, not a declaration."""

    priority: Expression
    condition: Expression
    action: Assign | Call | Pulse
    is_global: bool = False


@dataclass(frozen=True, slots=True)
class InterruptSwitch(Node):
    """`INTERRUPT ON 20`; all of them without a priority."""

    mode: Literal["ON", "OFF", "ENABLE", "DISABLE"]
    priority: Expression | None = None


@dataclass(frozen=True, slots=True)
class Brake(Node):
    """`BRAKE`, `BRAKE F` or `BRAKE FF`: `kind` is "", "F" or "FF"."""

    kind: Literal["", "F", "FF"] = ""


@dataclass(frozen=True, slots=True)
class Pulse(Node):
    """`PULSE($OUT[1],TRUE,0.3)`; duration in seconds."""

    output: Reference
    level: Expression
    duration: Expression


Statement = (
    Assign
    | Call
    | Label
    | Goto
    | If
    | Switch
    | For
    | While
    | Repeat
    | Loop
    | Simple
    | Return
    | WaitFor
    | WaitSec
    | Motion
    | Trigger
    | InterruptDeclare
    | InterruptSwitch
    | Brake
    | Pulse
)
Body = tuple[Statement, ...]

# Modules


@dataclass(frozen=True, slots=True)
class Comment(Node):
    """A `;` line or line end, without the mark; `FOLD ...` and `ENDFOLD ...` are comments."""

    text: str


@dataclass(frozen=True, slots=True)
class Header(Node):
    """A line that begins with `&`, as it stands."""

    text: str


@dataclass(frozen=True, slots=True)
class Routine(Node):
    """`DEF NAME(..) .. END`; a function, from DEFFCT, has a `result`.

    Attributes:
        is_global: as written; a module's first routine is global by itself.
        end: the place of END or ENDFCT.
    """

    name: str
    parameters: tuple[Parameter, ...]
    end: Place = field(compare=False, repr=False)
    result: TypeName | None = None
    is_global: bool = False
    declarations: tuple[Declaration, ...] = ()
    body: Body = ()


@dataclass(frozen=True, slots=True)
class Program(Node):
    """A .src or .sub file; `routines` is never empty, and the first one is the program."""

    kind: Literal["src", "sub"]
    headers: tuple[Header, ...]
    comments: tuple[Comment, ...]
    routines: tuple[Routine, ...]

    @property
    def name(self) -> str:
        """The module's name, which is its first routine's."""
        return self.routines[0].name


@dataclass(frozen=True, slots=True)
class DataList(Node):
    """A .dat file; `entries` in the order written, since assignments change declared values."""

    name: str
    headers: tuple[Header, ...]
    comments: tuple[Comment, ...]
    is_public: bool = False
    entries: tuple[Declaration | Assign, ...] = ()


Module = Program | DataList
