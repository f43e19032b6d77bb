"""What the grammar's rules make of declarations, heads of blocks and statements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl import words
from sphmctl.emulators.krl.build import Children, Expressions


@dataclass(frozen=True)
class Mark:
    """A line of one word that belongs to a block: ELSE, ENDIF, LOOP, ENDDAT ..."""

    at: n.Place
    word: str


@dataclass(frozen=True)
class Until:
    """The end of a REPEAT."""

    at: n.Place
    condition: n.Expression


Line = n.Statement | n.Declaration | n.Case | n.Routine | n.DataList | Mark | Until


class Declarations(Expressions):
    """The rules of declarations and of the heads of modules."""

    def new_name(self, token: str) -> str:
        """A name that is declared."""
        name = token.upper()
        if fault := words.name_fault(name):
            raise self.refuse(fault, "name")
        return name

    def def_(self, c: Children) -> n.Routine:
        """`DEF F(..)`; its end is not known yet."""
        *is_global, name, parameters = c
        return n.Routine(
            self.at, self.new_name(name), parameters, self.at, is_global=bool(is_global)
        )

    def deffct(self, c: Children) -> n.Routine:
        """`DEFFCT T F(..)`; its end is not known yet."""
        *is_global, result, name, parameters = c
        return n.Routine(self.at, self.new_name(name), parameters, self.at, result, bool(is_global))

    def defdat(self, c: Children) -> n.DataList:
        """`DEFDAT NAME PUBLIC`."""
        return n.DataList(self.at, self.new_name(c[0]), (), (), len(c) > 1)

    def parameters(self, c: Children) -> tuple[n.Parameter, ...]:
        """What stands in the parentheses."""
        return tuple(part for part in c if part is not None)

    ext_parameters = parameters

    def dimensions(self, c: Children) -> int:
        """The number of dimensions of `[,]`."""
        return len(self.dimensioned([None, *c]))

    def parameter(self, c: Children) -> n.Parameter:
        """`X :IN`."""
        dimensions = c[1] if len(c) == 3 else 0
        return n.Parameter(self.at, self.new_name(c[0]), c[-1].upper(), dimensions)

    def ext_parameter(self, c: Children) -> n.Parameter:
        """`REAL :IN`, or `REAL X :IN`; the name counts for nothing."""
        dimensions = c[-2] if isinstance(c[-2], int) else 0
        kind = n.TypeName(self.at, c[0].upper())
        return n.Parameter(self.at, "", c[-1].upper(), dimensions, kind)

    def type(self, c: Children) -> n.TypeName:
        """`CHAR[32]`."""
        return n.TypeName(self.at, self.type_word(c[0]), c[1] if len(c) > 1 else ())

    def type_name(self, c: Children) -> n.TypeName:
        """A type of a declaration."""
        return n.TypeName(self.at, self.type_word(c[0]))

    def type_word(self, token: str) -> str:
        """The name of a type."""
        name = token.upper()
        if name in words.NOT_EMULATED:
            raise self.refuse(no_statement(name))
        if name in words.RESERVED:
            raise self.refuse(f"{name} is no type; INT, REAL, BOOL, CHAR or a declared one is due")
        return name

    def sizes(self, c: Children) -> tuple[n.Expression, ...]:
        """`[2,3]`."""
        return self.dimensioned(c)

    open_sizes = sizes

    def declarator(self, c: Children) -> n.Declarator:
        """`X[3]=..`."""
        sizes = c[1] if len(c) == 3 else ()
        return n.Declarator(self.at, self.new_name(c[0]), sizes, c[-1])

    def declare(self, c: Children) -> n.Declare:
        """`DECL GLOBAL CONST T A,B`."""
        start = next(i for i, part in enumerate(c) if isinstance(part, n.TypeName))
        marks = [word.upper() for word in c[:start]]
        kind = c[start]
        if len(set(marks)) < len(marks):
            raise self.refuse("DECL, GLOBAL and CONST stand once each")
        if not marks and kind.name not in words.BARE_TYPES:
            raise self.refuse(no_statement(kind.name))
        return n.Declare(self.at, kind, tuple(c[start + 1 :]), "GLOBAL" in marks, "CONST" in marks)

    def same_type(self, c: Children) -> tuple[Any, ...]:
        """A member of a STRUC whose type stands before another."""
        return (None, self.new_name(c[0]), c[1] if len(c) > 1 else ())

    def new_type(self, c: Children) -> tuple[Any, ...]:
        """A member of a STRUC behind its type."""
        return (self.type_word(c[0]), self.new_name(c[1]), c[2] if len(c) > 2 else ())

    def struc(self, c: Children) -> n.Struc:
        """`STRUC T INT A,B, REAL C`."""
        is_global, name, parts = self._global(c)
        members: list[n.StrucMember] = []
        for kind, member, sizes in parts:
            if kind is None and not members:
                raise self.refuse(f"{member} has no type; write STRUC {name} INT {member}, ...")
            if member in {other.name for other in members}:
                raise self.refuse(f"{member} stands twice in {name}", "double")
            type_name = n.TypeName(self.at, kind) if kind else members[-1].type
            members.append(n.StrucMember(self.at, type_name, member, sizes))
        return n.Struc(self.at, self.new_name(name), tuple(members), is_global)

    def enum(self, c: Children) -> n.Enum:
        """`ENUM T A,B`."""
        is_global, name, members = self._global(c)
        upper = tuple(self.new_name(member) for member in members)
        if len(set(upper)) < len(upper):
            raise self.refuse(f"a value stands twice in {name}", "double")
        return n.Enum(self.at, self.new_name(name), upper, is_global)

    def signal(self, c: Children) -> n.Signal:
        """`SIGNAL N $OUT[1] TO $OUT[8]`."""
        is_global, name, (first, last) = self._global(c)
        return n.Signal(self.at, self.new_name(name), first, last, is_global)

    def no_signal(self, c: Children) -> n.Signal:
        """`SIGNAL $X FALSE`."""
        is_global, name, _ = self._global(c)
        return n.Signal(self.at, self.new_name(name), None, None, is_global)

    def ext(self, c: Children) -> n.Ext:
        """`EXT F(..)`."""
        return n.Ext(self.at, self.new_name(c[0]), c[1])

    def extfct(self, c: Children) -> n.Ext:
        """`EXTFCT T F(..)`."""
        return n.Ext(self.at, self.new_name(c[1]), c[2], c[0])

    @staticmethod
    def _global(c: Children) -> tuple[bool, str, Children]:
        is_global = c[0].type == "GLOBAL"
        start = 1 if is_global else 0
        return is_global, c[start].upper(), c[start + 1 :]


class Lines(Declarations):
    """The rules of statements and of the heads and ends of blocks."""

    def mark(self, c: Children) -> Mark:
        """A line of one word that belongs to a block."""
        return Mark(self.at, c[0].upper())

    def until(self, c: Children) -> Until:
        """`UNTIL condition`."""
        return Until(self.at, c[0])

    def if_(self, c: Children) -> n.If:
        """`IF condition THEN`."""
        return n.If(self.at, c[0])

    def switch(self, c: Children) -> n.Switch:
        """`SWITCH subject`."""
        return n.Switch(self.at, c[0])

    def case(self, c: Children) -> n.Case:
        """`CASE a,b`."""
        return n.Case(self.at, tuple(c))

    def for_(self, c: Children) -> n.For:
        """`FOR i=a TO b STEP c`."""
        return n.For(self.at, *c)

    def while_(self, c: Children) -> n.While:
        """`WHILE condition`."""
        return n.While(self.at, c[0])

    def assign(self, c: Children) -> n.Assign:
        """`a=b`."""
        return n.Assign(self.at, c[0], c[1])

    def label(self, c: Children) -> n.Label:
        """`NAME:`."""
        return n.Label(self.at, self.new_name(c[0]))

    def goto(self, c: Children) -> n.Goto:
        """`GOTO NAME`."""
        return n.Goto(self.at, c[0].upper())

    def word(self, c: Children) -> n.Simple:
        """EXIT, HALT ..."""
        return n.Simple(self.at, c[0].upper())

    def return_(self, c: Children) -> n.Return:
        """`RETURN value`."""
        return n.Return(self.at, c[0] if c else None)

    def wait_for(self, c: Children) -> n.WaitFor:
        """`WAIT FOR condition`."""
        return n.WaitFor(self.at, c[0])

    def wait_sec(self, c: Children) -> n.WaitSec:
        """`WAIT SEC duration`."""
        return n.WaitSec(self.at, c[0])

    def brake(self, c: Children) -> n.Brake:
        """`BRAKE F`."""
        return n.Brake(self.at, c[0].upper() if c else "")

    def pulse(self, c: Children) -> n.Pulse:
        """`PULSE($OUT[1],TRUE,0.3)`."""
        return n.Pulse(self.at, *c)

    def blends(self, c: Children) -> tuple[str, ...]:
        """`C_PTP C_DIS`."""
        upper = tuple(word.upper() for word in c)
        if len(set(upper)) < len(upper):
            raise self.refuse(f"{upper[0]} stands twice")
        return upper

    def frame(self, c: Children) -> tuple[str, str]:
        """`#TOOL` behind a relative motion."""
        word = c[0][1:].strip(" \t").upper()
        if word not in ("BASE", "TOOL"):
            raise self.refuse(f"#{word} is no frame to move in; #BASE or #TOOL is")
        return ("frame", word)

    def settings(self, c: Children) -> tuple[str, tuple[n.Assign, ...]]:
        """`WITH a=b,c=d`."""
        return ("settings", tuple(c))

    def angle(self, c: Children) -> tuple[str, n.Expression]:
        """`CA 90`."""
        return ("angle", c[0])

    def delay(self, c: Children) -> tuple[str, n.Expression]:
        """`DELAY=20`."""
        return ("delay", c[0])

    def priority(self, c: Children) -> tuple[str, n.Expression]:
        """`PRIO=-1`."""
        return ("priority", c[0])

    def motion(self, c: Children) -> n.Motion:
        """`PTP target ..`."""
        return self._motion(c[0].upper(), c[1], c[2:], {})

    def arc(self, c: Children) -> n.Motion:
        """`CIRC via,target ..`."""
        return self._motion(c[0].upper(), c[2], c[3:], {"via": c[1]})

    def _motion(
        self, kind: Any, target: n.Expression, rest: Children, more: dict[str, Any]
    ) -> n.Motion:
        blends = next(p for p in rest if not p or p[0].startswith("C_"))
        more.update(p for p in rest if p is not blends)
        if "settings" in more and not kind.startswith("S"):
            raise self.refuse(f"{kind} takes no WITH; SPTP, SLIN and SCIRC do")
        if "frame" in more and kind not in ("LIN_REL", "CIRC_REL"):
            raise self.refuse(f"{kind} takes no #BASE or #TOOL; LIN_REL and CIRC_REL do")
        if "C_SPL" in blends and not kind.startswith("S"):
            raise self.refuse(f"{kind} takes no C_SPL; C_PTP, C_DIS, C_VEL and C_ORI are for it")
        return n.Motion(self.at, kind, target, blends=blends, **more)

    def trigger(self, c: Children) -> n.Trigger:
        """`TRIGGER WHEN DISTANCE=1 DELAY=0 DO F() PRIO=-1`."""
        kind: Any = c[0].upper()
        action = next(part for part in c[2:] if isinstance(part, n.Assign | n.Call | n.Pulse))
        more: dict[str, Any] = dict(part for part in c[2:] if isinstance(part, tuple))
        on_start = any(str(part).upper() == "ONSTART" for part in c[2:3] if isinstance(part, str))
        if on_start and kind == "DISTANCE":
            raise self.refuse("ONSTART belongs to TRIGGER WHEN PATH; DISTANCE is 0 or 1")
        return n.Trigger(self.at, kind, c[1], action, on_start=on_start, **more)

    def interrupt_declare(self, c: Children) -> n.InterruptDeclare:
        """`GLOBAL INTERRUPT DECL 3 WHEN c DO F()`."""
        *is_global, priority, condition, action = c
        return n.InterruptDeclare(self.at, priority, condition, action, bool(is_global))

    def interrupt_switch(self, c: Children) -> n.InterruptSwitch:
        """`INTERRUPT ON 3`."""
        mode: Any = c[0].upper()
        return n.InterruptSwitch(self.at, mode, c[1] if len(c) > 1 else None)


def no_statement(first: str) -> str:
    """Why a line that begins with this word is none."""
    if first in words.NOT_EMULATED:
        return f"{first} is not emulated; {words.NOT_EMULATED[first]}"
    if first in words.NO_KRL:
        return words.NO_KRL[first]
    return f"no statement begins with {first[:40]}; a declaration of that type begins with DECL"
