"""What the interpreter hands to the mover, and what the mover tells. Data only, KRL's units."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from sphmctl.emulators.motion.figures import Joints
from sphmctl.emulators.motion.frames import NULL_FRAME, Frame

APPROXIMATIONS = ("C_PTP", "C_DIS", "C_VEL", "C_ORI")

MAX_TRIGGER_DISTANCE = 1


class MotionError(ValueError):
    """A block that the controller refuses: a run-time error of the program."""


class AxisLimitError(MotionError):
    """A block that would leave the software limits."""


@dataclass(frozen=True)
class Ptp:
    """Synchronous motion in axis space.

    Attributes:
        target_deg: A1..A6; for a POS see `kinematics.axes_of`.
        velocity_percent: $VEL_AXIS of each axis.
        acceleration_percent: $ACC_AXIS of each axis.
        tool: $TOOL, for the speed limit of T1 alone.
    """

    target_deg: Joints
    velocity_percent: Joints
    acceleration_percent: Joints
    tool: Frame = NULL_FRAME


@dataclass(frozen=True)
class PathSpeed:
    """$VEL.CP, .ORI1, .ORI2 and $ACC.CP, .ORI1, .ORI2 in m/s, deg/s, m/s2, deg/s2.

    ORI1 is the swivel of the tool's X, ORI2 the turn about it.
    """

    vel_cp_m_s: float
    acc_cp_m_s2: float
    vel_ori1_deg_s: float = 400.0
    vel_ori2_deg_s: float = 400.0
    acc_ori1_deg_s2: float = 1000.0
    acc_ori2_deg_s2: float = 1000.0


@dataclass(frozen=True)
class Lin:
    """A straight line of the tool's centre to `target`, of the tool on `base`."""

    target: Frame
    speed: PathSpeed
    tool: Frame = NULL_FRAME
    base: Frame = NULL_FRAME


@dataclass(frozen=True)
class Circ:
    """An arc of the tool's centre through `auxiliary` (whose A, B, C do not count) to `target`."""

    auxiliary: Frame
    target: Frame
    speed: PathSpeed
    tool: Frame = NULL_FRAME
    base: Frame = NULL_FRAME


@dataclass(frozen=True)
class Apo:
    """$APO as it is when the block is planned; the defaults are INITMOV's."""

    cptp_percent: float = 50.0
    cdis_mm: float = 3.0
    cvel_percent: float = 100.0
    cori_deg: float = 5.0


@dataclass(frozen=True)
class Trigger:
    """TRIGGER WHEN DISTANCE or PATH; exactly one of the two is given.

    Attributes:
        tag: the caller's, told when it fires.
        distance: 0 at the block's start, 1 at its end.
        path_mm: from the block's end (or start), signed; LIN and CIRC only.
        onstart: `path_mm` counts from the start.
        delay_s: later (or, negative, earlier) than the place.
    """

    tag: int
    distance: int | None = None
    path_mm: float | None = None
    onstart: bool = False
    delay_s: float = 0.0

    def __post_init__(self) -> None:
        if (self.distance is None) == (self.path_mm is None):
            raise MotionError("a trigger has either DISTANCE or PATH")
        if self.distance is not None and not 0 <= self.distance <= MAX_TRIGGER_DISTANCE:
            raise MotionError(f"DISTANCE of a trigger is 0 or 1, not {self.distance}")


@dataclass(frozen=True)
class Block:
    """One motion instruction with everything that was valid when it was planned.

    Attributes:
        tag: the caller's sequence number.
        approximation: the words behind it: none, `("C_PTP",)`, `("C_PTP", "C_DIS")`, `("C_DIS",)`
            and so on.
        apo: $APO; also without words, since it ends the blend before this block.
    """

    tag: int
    motion: Ptp | Lin | Circ
    approximation: tuple[str, ...] = ()
    apo: Apo = Apo()
    triggers: tuple[Trigger, ...] = ()

    def __post_init__(self) -> None:
        for word in self.approximation:
            if word not in APPROXIMATIONS:
                raise MotionError(f"{word} is not one of {', '.join(APPROXIMATIONS)}")
        if isinstance(self.motion, Ptp) and any(t.path_mm is not None for t in self.triggers):
            raise MotionError("TRIGGER WHEN PATH goes with LIN and CIRC, not with PTP")


class Kind(Enum):
    """What the mover tells."""

    ENTERED = "the main run pointer is on the block"
    FINISHED = "the block's end, or the middle of its blend, is passed"
    BLENDED = "the approximation zone at the block's end is left"
    EXACT_STOP = "the block should have been blended, and was not"
    TRIGGER = "a trigger fired"
    STANDSTILL = "the arm came to rest"
    AXIS_LIMIT = "a software limit is violated"
    SLOWED = "the path is slower than programmed: an axis would be too fast"
    BCO_NEEDED = "the next motion is the block coincidence run"
    BCO_REACHED = "the block coincidence run is at its end"
    RETURNED = "the arm is back on the path it had left"


@dataclass(frozen=True)
class Event:
    """Something that happened.

    Attributes:
        time_s: the mover's time; between two steps where it is known better.
        tag: the block's tag, for TRIGGER the trigger's; -1 where none is concerned.
        detail: the reason of an EXACT_STOP, the axis of an AXIS_LIMIT or SLOWED.
    """

    kind: Kind
    time_s: float
    tag: int = -1
    detail: str = ""
