"""KRL's built-in functions; the string functions stand in `texts`.

Trigonometry is in degrees (SI, "Standard functions"). A function that `krl.functions` knows and
that is not here is refused as the program is loaded.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sphmctl.emulators.interpreter import buffers, texts
from sphmctl.emulators.interpreter.code import Fn
from sphmctl.emulators.interpreter.expressions import Typed
from sphmctl.emulators.interpreter.faults import OUT_OF_RANGE, RAISED, KrlFaultError, invalid
from sphmctl.emulators.interpreter.operators import PLACE_PARTS, place_of
from sphmctl.emulators.interpreter.paths import NAME, steps_of, value_at
from sphmctl.emulators.interpreter.values import fully_set, is_set, real, whole
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl.functions import FUNCTIONS
from sphmctl.emulators.krl_text import Bool, Int, Real, Struct, Type
from sphmctl.emulators.motion.figures import beyond
from sphmctl.emulators.motion.frames import chained, frame_of, inverted, pose_of
from sphmctl.emulators.motion.kinematics import axes_of, status_and_turn, tool_centre

if TYPE_CHECKING:
    from sphmctl.emulators.interpreter.compiler import Builder

EXTERNAL = ("E1", "E2", "E3", "E4", "E5", "E6")

SPLINES = ("SVEL_JOINT", "SACC_JOINT", "SVEL_CP", "SACC_CP", "STOOL2", "SBASE")
"""Behind WITH of a single spline motion; the others that KSS has are refused."""

FAULTS = {"unreachable": 1, "limits": 2, "undefined": 3}
"""What FORWARD and INVERSE put into their error argument; 0 is success (numbers are a guess)."""


@dataclass(frozen=True)
class Pure:
    """A function of values; `kind` None for that of the first argument."""

    compute: Callable[..., Any]
    kind: Type | None


def _root(x: float) -> float:
    if x < 0.0:
        raise KrlFaultError(OUT_OF_RANGE, f"SQRT({x}): below 0 there is no root")
    return math.sqrt(x)


def _arc(function: Callable[[float], float], name: str) -> Callable[[float], float]:
    def compute(x: float) -> float:
        if not -1.0 <= x <= 1.0:
            raise KrlFaultError(OUT_OF_RANGE, f"{name}({x}): the argument is within -1 and 1")
        return math.degrees(function(x))

    return compute


def _inverted(frame: Any) -> Any:
    made = dict(frame)
    pose = inverted(pose_of(place_of(frame, "INV_POS()")))
    made.update(zip(PLACE_PARTS, (real(x) for x in frame_of(pose)), strict=True))
    return made


def _size_of(x: int | float) -> int | float:
    return whole(abs(x)) if isinstance(x, int) else abs(x)


def _of_degrees(function: Callable[[float], float]) -> Pure:
    return Pure(lambda x: real(function(math.radians(x))), Real())


PURE = {
    "ABS": Pure(_size_of, None),
    "SIN": _of_degrees(math.sin),
    "COS": _of_degrees(math.cos),
    "TAN": _of_degrees(math.tan),
    "ACOS": Pure(lambda x: real(_arc(math.acos, "ACOS")(x)), Real()),
    "ASIN": Pure(lambda x: real(_arc(math.asin, "ASIN")(x)), Real()),
    "ATAN2": Pure(lambda y, x: real(math.degrees(math.atan2(y, x))), Real()),
    "SQRT": Pure(lambda x: real(_root(x)), Real()),
    "B_NOT": Pure(lambda x: whole(~x), Int()),
    "INV_POS": Pure(_inverted, None),
}

WITH_MACHINE = ("CWRITE", "ERR_CLEAR", "ERR_RAISE", "FORWARD", "INVERSE", "ROB_STOP",
                "ROB_STOP_RELEASE", "VARSTATE")  # fmt: skip


def compiled(builder: Builder, node: n.Call) -> Typed:
    """A call of a built-in function.

    Raises:
        KrlError: there is none of the name, or it is not emulated.
    """
    function = FUNCTIONS.get(node.name)
    if function is None:
        raise fail(node.at, "call", f"there is no routine {node.name}")
    given = () if node.arguments == (None,) else node.arguments
    if not function.least <= len(given) <= function.most:
        raise fail(node.at, "arguments", f"{node.name} takes {function.least} arguments")
    if node.name in WITH_MACHINE:
        return _special(builder, node)
    if node.name in texts.TEXTS:
        return texts.compiled(builder, node)
    if node.name in buffers.BUFFERS:
        return buffers.compiled(builder, node)
    if node.name in SPLINES:
        return _spline(builder, node)
    pure = PURE.get(node.name)
    if pure is None:
        raise fail(node.at, "call", f"{node.name} is not emulated")
    arguments = [builder.expressions.of(part) for part in given if part is not None]
    wanted = Struct if node.name == "INV_POS" else Int | Real
    if not all(part.kind is None or isinstance(part.kind, wanted) for part in arguments):
        what = "frames" if node.name == "INV_POS" else "numbers"
        raise fail(node.at, "type", f"{node.name} takes {what}")
    kind = pure.kind if pure.kind is not None else arguments[0].kind
    return Typed(_apply(pure.compute, [part.fn for part in arguments]), kind)


def _apply(compute: Callable[..., Any], parts: list[Fn]) -> Fn:
    if len(parts) == 1:
        only = parts[0]
        return lambda f: compute(only(f))
    return lambda f: compute(*[part(f) for part in parts])


def _special(builder: Builder, node: n.Call) -> Typed:
    given = [part for part in node.arguments if part is not None]
    if node.name in ("FORWARD", "INVERSE"):
        return _kinematics(builder, node)
    if node.name == "VARSTATE":
        return Typed(_state(builder, builder.expressions.of(given[0]).fn), None)
    if node.name == "CWRITE":
        answer = builder.expressions.reference(_reference(given[1]))
        text = builder.expressions.of(given[3]).fn

        def write(f: Any) -> None:
            done = f.machine.command(text(f))
            holder = answer.box(f)
            holder.value = dict(holder.value) | {"RET1": "CMD_OK" if done else "CMD_REJ"}

        return Typed(write, None)
    if node.name == "ERR_RAISE":
        return Typed(_raise, None)
    if node.name == "ERR_CLEAR":
        return Typed(lambda f: f.machine.clear_error(), None)
    stops = node.name == "ROB_STOP"
    return Typed(lambda f: f.machine.robot_stop(stops), Bool())


def _spline(builder: Builder, node: n.Call) -> Typed:
    """SVEL_JOINT and its kin, as the inline forms of KSS 8 use them (meanings are a guess).

    A number is taken as it is, of a data set the part that fits; STOOL2 and SBASE look up the
    frame of the number in an FDAT.
    """
    first = node.arguments[0]
    if first is None:
        raise fail(node.at, "arguments", f"{node.name} needs its first argument")
    fn, names, name = builder.expressions.of(first).fn, builder.names, node.name

    def give(f: Any) -> Any:
        value = fn(f)
        if name in ("STOOL2", "SBASE"):
            return _numbered_frame(names, value, tool=name == "STOOL2")
        if isinstance(value, dict):
            value = value["ACC" if name.startswith("SACC") else "VEL"]
        if name.endswith("JOINT"):
            return value
        most = _global(names, "$VEL_MA" if name == "SVEL_CP" else "$ACC_MA")
        return dict(most) | {"CP": value}

    return Typed(give, None)


def _numbered_frame(names: Any, value: Any, tool: bool) -> Any:
    number = value.get("TOOL_NO" if tool else "BASE_NO") if isinstance(value, dict) else None
    if number is None:
        raise invalid("the number of the tool" if tool else "the number of the base")
    frames = _global(names, "TOOL_DATA" if tool else "BASE_DATA")
    if number == 0:
        return _global(names, "$NULLFRAME")
    if not 1 <= number <= len(frames):
        raise KrlFaultError(OUT_OF_RANGE, f"there is no frame {number}")
    return frames[number - 1]


def _raise(f: Any) -> None:
    raise KrlFaultError(RAISED, "the program raised an error with ERR_RAISE")


def _reference(node: n.Expression) -> n.Reference:
    if isinstance(node, n.Name | n.Field | n.Index):
        return node
    raise fail(node.at, "arguments", "a variable must stand here, to be written to")


def _state(builder: Builder, text: Fn) -> Fn:
    """VARSTATE: by the name of a variable or component, of the routine or any wider scope."""
    local, names = builder.code.locals, builder.names

    def look(f: Any) -> str:
        name: str = text(f)
        match = NAME.match(name)
        if match is None:
            return "UNKNOWN"
        own = local.get(match[1].upper())
        known = names.variable(match[1].upper())
        if own is not None:
            kind, value = own.kind, f.cells[own.index].value
        elif known is not None:
            kind, value = known.kind, known.box.value
        else:
            return "UNKNOWN"
        way = steps_of(name, match.end(), kind, bare=True)
        if way is None:
            return "UNKNOWN"
        return "INITIALIZED" if is_set(value_at(value, way.steps)) else "DECLARED"

    return look


def _kinematics(builder: Builder, node: n.Call) -> Typed:
    """FORWARD(axes,error) and INVERSE(point,start,error), with $TOOL and $BASE."""
    parts = [part for part in node.arguments if part is not None]
    fault = builder.expressions.reference(_reference(parts[-1]))
    values = [builder.expressions.of(part).fn for part in parts[:-1]]
    names = builder.names
    compute = forward_point if node.name == "FORWARD" else inverse_axes
    kind = names.type(node.at, "E6POS" if node.name == "FORWARD" else "E6AXIS")

    def solve(f: Any) -> Any:
        frames = [place_of(_global(names, name), name) for name in ("$TOOL", "$BASE")]
        made, number = compute(*[value(f) for value in values], *frames)
        fault.box(f).value = number
        return made

    return Typed(solve, kind)


def _global(names: Any, name: str) -> Any:
    variable = names.variable(name)
    return None if variable is None else variable.box.value


def axes_value(joints_deg: tuple[float, ...]) -> dict[str, Any]:
    """An E6AXIS of the six axes."""
    made: dict[str, Any] = {f"A{axis}": real(q) for axis, q in enumerate(joints_deg, start=1)}
    return made | dict.fromkeys(EXTERNAL, 0.0)


def point_value(joints_deg: tuple[float, ...], tool: Any, base: Any) -> dict[str, Any]:
    """The E6POS of the tool on the base."""
    here = inverted(pose_of(base)), tool_centre(joints_deg, tool)
    made: dict[str, Any] = dict(
        zip(PLACE_PARTS, (real(x) for x in frame_of(chained(*here))), strict=True)
    )
    status, turn = status_and_turn(joints_deg)
    return made | {"S": status, "T": turn} | dict.fromkeys(EXTERNAL, 0.0)


def joints_of(axes: Any, what: str) -> tuple[float, ...]:
    """A1..A6 of an axis value; all must be set."""
    joints_deg = tuple(axes.get(f"A{axis}") for axis in range(1, 7)) if axes else (None,)
    if not fully_set(list(joints_deg)):
        raise invalid(what)
    return joints_deg


def forward_point(axes: Any, tool: Any, base: Any) -> tuple[Any, int]:
    """FORWARD: the point of axes, and its error number."""
    return point_value(joints_of(axes, "FORWARD()"), tool, base), 0


def inverse_axes(point: Any, start: Any, tool: Any, base: Any) -> tuple[Any, int]:
    """INVERSE: the axes of a point near `start`, and its error number."""
    near_deg = joints_of(start, "INVERSE()")
    place = place_of(point, "INVERSE()")
    joints_deg = axes_of(place, tool, base, near_deg, point.get("S"), point.get("T"))
    if joints_deg is None:
        return dict(start), FAULTS["unreachable"]
    number = FAULTS["limits"] if beyond(joints_deg) is not None else 0
    return axes_value(joints_deg), number
