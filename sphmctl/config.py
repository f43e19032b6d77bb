"""The cell file: which devices, how the wrist is mounted, limits, tools and frames.

Millimetres and degrees as in the file; the properties that end in `_rad` and the matrices are SI.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import numpy as np
import yaml
from pydantic import AfterValidator, BaseModel, Field, model_validator

from sphmctl.errors import InvalidError
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.obstacles import CellPayload, Obstacles
from sphmctl.robots import sphm
from sphmctl.robots.geometry import pose_matrix
from sphmctl.robots.sphm.bodies import Obstacle
from sphmctl.wire.board_table import BOARD_ID
from sphmctl.yamlfile import STRICT, Numbers, Pose, Version, load, nearest, shown, wrong

TICKS_PER_TURN = 4096
"""XL430-W250 e-manual, "Present Position": 0 to 4095 is one turn."""

BUILT_IN_TOOLS: dict[str, Numbers] = {
    "octagon_pen": (0.0, 0.0, 58.9, 0.0, 0.0, 0.0),
    "face": (0.0, 0.0, 7.5, 0.0, 0.0, 0.0),
}
"""On the platform frame. The pen's length is fitted to Table 5, the face's to Tables 3 and 4, of
Elsamanty et al., Appl. Sci. 2023, 13, 2088."""

EMULATED_SPEED_PERCENT = 100.0
REAL_SPEED_PERCENT = 10.0
"""A real cell starts slowly until somebody says otherwise."""

KVP_PORT = 7000
"""KUKAVARPROXY's default."""

IO_NUMBERS = 4096
"""$IN and $OUT of a KRC4 go from 1 to this."""

CONSTANT_INPUTS = (1025, 1026)
SYSTEM_OUTPUTS = range(993, 1024)
"""What $machine.dat of a KR 6 R900 (KSS 8.3, Naqiu06/KUKA-Robotics) gives to the controller itself:
inputs that are always TRUE and always FALSE, and the outputs of its states."""

MACHINE_RANGES_DEG: Floats = np.degrees(sphm.RANGES9)
MACHINE_SPEEDS_DEG_S: Floats = np.degrees(sphm.MAX_SPEED9)
MACHINE_ACCELERATIONS_DEG_S2: Floats = np.degrees(sphm.MAX_ACCELERATION9)

ROUNDING = 1e-9
"""Relative; 120 degrees by way of radians is not exactly 120."""


class Lines(BaseModel):
    """Numbers of the controller's digital lines to the board: an input and two outputs."""

    model_config = STRICT
    wrist_ok: Annotated[int, Field(ge=1, le=IO_NUMBERS)]
    knot: Annotated[int, Field(ge=1, le=IO_NUMBERS)]
    arm_moving: Annotated[int, Field(ge=1, le=IO_NUMBERS)]

    @model_validator(mode="after")
    def _check(self) -> Lines:
        if self.wrist_ok in CONSTANT_INPUTS:
            raise wrong(
                f"$IN[{self.wrist_ok}] never changes on a KRC4; give the input that is wired",
                "wrist_ok",
            )
        for key in ("knot", "arm_moving"):
            number = getattr(self, key)
            if number in SYSTEM_OUTPUTS:
                raise wrong(
                    f"$OUT[{number}] is the controller's own ({SYSTEM_OUTPUTS[0]} to "
                    f"{SYSTEM_OUTPUTS[-1]}); give the output that is wired",
                    key,
                )
        if self.knot == self.arm_moving:
            raise wrong(f"$OUT[{self.knot}] cannot be both 'knot' and 'arm_moving'", "knot")
        return self


class Arm(BaseModel):
    """The arm's controller."""

    model_config = STRICT
    driver: Literal["kvp", "emulated"]
    host: Annotated[str, Field(min_length=1, max_length=255)] | None = None
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    flavour: Literal["auto", "kvp", "c3"] = "auto"
    lines: Lines | None = None
    model: Literal["KR6R900"] = "KR6R900"

    @model_validator(mode="after")
    def _check(self) -> Arm:
        if self.driver == "kvp" and self.host is None:
            raise wrong("the driver 'kvp' needs 'host', the controller's address")
        for key in ("host", "port"):
            if self.driver == "emulated" and getattr(self, key) is not None:
                raise wrong(f"an emulated arm has no '{key}'; leave it out", key)
        return self

    @property
    def tcp_port(self) -> int:
        """The port to connect to."""
        return KVP_PORT if self.port is None else self.port


class Wrist(BaseModel):
    """The wrist's servos and how they are mounted."""

    model_config = STRICT
    driver: Literal["dynamixel", "emulated"]
    port: Annotated[str, Field(min_length=1, max_length=1024)] | None = None
    baud: Literal[9600, 57600, 115200, 1000000, 2000000, 3000000, 4000000, 4500000] = 1000000
    ids: tuple[int, ...] = (1, 2, 3)
    board_id: Annotated[int, Field(ge=0, le=252)] | None = None
    zero_ticks: tuple[int, ...] = (1365, 1365, 1365)
    direction: tuple[int, ...] = (1, 1, 1)
    mount_yaw_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0

    @model_validator(mode="after")
    def _check(self) -> Wrist:
        if self.driver == "dynamixel" and self.port is None:
            raise wrong("the driver 'dynamixel' needs 'port', the serial device of the servos")
        if self.driver == "emulated" and self.port is not None:
            raise wrong("an emulated wrist has no 'port'; leave it out", "port")
        for key, values in (
            ("ids", self.ids),
            ("zero_ticks", self.zero_ticks),
            ("direction", self.direction),
        ):
            if len(values) != 3:
                raise wrong(
                    f"{shown(values)} has {len(values)} numbers; give one for each leg", key
                )
        for index, servo_id in enumerate(self.ids):
            if not 0 <= servo_id <= 252:
                raise wrong(f"{servo_id} is no servo id; give 0 to 252", "ids", index)
        if self.board_id not in (None, BOARD_ID):
            raise wrong(
                f"{self.board_id} should be {BOARD_ID}, which is fixed in the board, or null "
                "for servos on a USB adapter",
                "board_id",
            )
        if len({*self.ids, self.board_id}) != 4:
            raise wrong(f"{shown(self.ids)}: servos and board need different ids", "ids")
        self._check_ticks()
        return self

    def _check_ticks(self) -> None:
        low_deg, high_deg = MACHINE_RANGES_DEG[6]
        for leg, (zero, sense) in enumerate(zip(self.zero_ticks, self.direction, strict=True)):
            if sense not in (1, -1):
                raise wrong(f"{sense} should be 1 or -1", "direction", leg)
            ends = [zero + sense * round(d * TICKS_PER_TURN / 360) for d in (low_deg, high_deg)]
            if min(ends) < 0 or max(ends) >= TICKS_PER_TURN:
                raise wrong(
                    f"with zero_ticks {zero} and direction {sense} the crank angles {low_deg:g} to "
                    f"{high_deg:g} are the ticks {ends[0]} to {ends[1]}; they should stay within "
                    f"0 to {TICKS_PER_TURN - 1}: mount the horn elsewhere",
                    "zero_ticks",
                    leg,
                )


LEAST_RATE_DEG = 0.001
"""Lowest limit of a joint, deg/s and deg/s2: at which it needs a minute for one servo step."""


class Limit(BaseModel):
    """What one joint may do; what is left out is the machine's own."""

    model_config = STRICT
    range_deg: tuple[float, ...] | None = None
    speed_deg_s: Annotated[float, Field(ge=LEAST_RATE_DEG)] | None = None
    acceleration_deg_s2: Annotated[float, Field(ge=LEAST_RATE_DEG)] | None = None


class Limits(BaseModel):
    """Limits by joint; they may only be narrower than the machine's."""

    model_config = STRICT
    a1: Limit = Limit()
    a2: Limit = Limit()
    a3: Limit = Limit()
    a4: Limit = Limit()
    a5: Limit = Limit()
    a6: Limit = Limit()
    theta7: Limit = Limit()
    theta8: Limit = Limit()
    theta9: Limit = Limit()

    @model_validator(mode="after")
    def _check(self) -> Limits:
        for index, (name, limit) in enumerate(self.by_joint()):
            _check_range(name, limit, MACHINE_RANGES_DEG[index])
            for key, own in (
                ("speed_deg_s", MACHINE_SPEEDS_DEG_S[index]),
                ("acceleration_deg_s2", MACHINE_ACCELERATIONS_DEG_S2[index]),
            ):
                value = getattr(limit, key)
                if value is not None and value > own * (1 + ROUNDING):
                    raise wrong(f"{value:g} is more than the machine's own {own:.6g}", name, key)
        return self

    def by_joint(self) -> list[tuple[str, Limit]]:
        """(name, limit) of the nine joints in order."""
        return [(name.lower(), getattr(self, name.lower())) for name in JOINT_NAMES]


def _check_range(name: str, limit: Limit, own: Floats) -> None:
    if limit.range_deg is None:
        return
    if len(limit.range_deg) != 2 or limit.range_deg[0] >= limit.range_deg[1]:
        raise wrong(f"{shown(limit.range_deg)} should be [lowest, highest]", name, "range_deg")
    low, high = limit.range_deg
    if low < own[0] - ROUNDING * 360 or high > own[1] + ROUNDING * 360:
        raise wrong(
            f"{shown(limit.range_deg)} is wider than the machine's own [{own[0]:.6g}, "
            f"{own[1]:.6g}]; a cell may only narrow it",
            name,
            "range_deg",
        )


def _tools(tools: dict[str, Numbers]) -> dict[str, Numbers]:
    return {**BUILT_IN_TOOLS, **tools}


def _frames(frames: dict[str, Numbers]) -> dict[str, Numbers]:
    return {"world": (0.0,) * 6, **frames}


Tools: TypeAlias = Annotated[dict[str, Pose], AfterValidator(_tools)]
Frames: TypeAlias = Annotated[dict[str, Pose], AfterValidator(_frames)]


class Cell(BaseModel):
    """Everything that is particular to one cell."""

    model_config = STRICT
    version: Version
    name: Annotated[str, Field(min_length=1, max_length=64)]
    arm: Arm
    wrist: Wrist
    limits: Limits = Limits()
    speed_percent: Annotated[float, Field(ge=0.1, le=100)] | None = None
    tools: Tools = _tools({})
    frames: Frames = _frames({})
    obstacles: Obstacles = Obstacles()
    payload: CellPayload = CellPayload()

    def for_dry_run(self) -> Cell:
        """The same cell with both devices emulated, at an emulated cell's default speed."""
        arm = self.arm.model_copy(update={"driver": "emulated", "host": None, "port": None})
        wrist = self.wrist.model_copy(update={"driver": "emulated", "port": None})
        return self.model_copy(update={"arm": arm, "wrist": wrist, "speed_percent": None})

    @property
    def emulated_devices(self) -> tuple[str, ...]:
        """Which of "arm" and "wrist" are emulated."""
        devices = (("arm", self.arm.driver), ("wrist", self.wrist.driver))
        return tuple(name for name, driver in devices if driver == "emulated")

    @property
    def plan_speed_percent(self) -> float:
        """Speed of plans when nobody says otherwise."""
        if self.speed_percent is not None:
            return self.speed_percent
        return EMULATED_SPEED_PERCENT if len(self.emulated_devices) == 2 else REAL_SPEED_PERCENT

    @property
    def ranges_rad(self) -> Floats:
        """Lowest and highest angle of the nine joints, (9, 2)."""
        ranges = MACHINE_RANGES_DEG.copy()
        for index, (_, limit) in enumerate(self.limits.by_joint()):
            if limit.range_deg is not None:
                ranges[index] = limit.range_deg
        return np.radians(ranges)

    @property
    def speeds_rad_s(self) -> Floats:
        """Highest speed of the nine joints, (9,)."""
        given = [limit.speed_deg_s for _, limit in self.limits.by_joint()]
        return _narrowed(MACHINE_SPEEDS_DEG_S, given)

    @property
    def accelerations_rad_s2(self) -> Floats:
        """Highest acceleration of the nine joints, (9,)."""
        given = [limit.acceleration_deg_s2 for _, limit in self.limits.by_joint()]
        return _narrowed(MACHINE_ACCELERATIONS_DEG_S2, given)

    @property
    def mount_yaw_rad(self) -> float:
        """Leg 1 against the flange's x axis."""
        return float(np.radians(self.wrist.mount_yaw_deg))

    @property
    def obstacle_bodies(self) -> tuple[Obstacle, ...]:
        """Boxes, then planes, m."""
        return self.obstacles.bodies()

    def tool_matrix(self, name: str | None) -> Floats:
        """A tool's frame on the platform, m, (4, 4); None is the platform centre O7 itself."""
        if name is None:
            return np.eye(4)
        if name not in self.tools:
            raise InvalidError(_unknown("tool", name, self.name, tuple(self.tools)))
        return _matrix(self.tools[name])

    def frame_matrix(self, frame: str | Numbers) -> Floats:
        """A frame, by name or x, y, z mm and A, B, C deg, in the arm's base frame, m, (4, 4)."""
        if not isinstance(frame, str):
            return _matrix(frame)
        if frame not in self.frames:
            raise InvalidError(_unknown("frame", frame, self.name, tuple(self.frames)))
        return _matrix(self.frames[frame])


def load_cell(path: str | Path) -> Cell:
    """Read a cell file. Raises InvalidError with file, line, field and value."""
    return load(path, Cell)[0]


def emulated_cell() -> Cell:
    """The packaged cell: both devices emulated, everything else at its default."""
    return Cell(
        version=1, name="emulated", arm=Arm(driver="emulated"), wrist=Wrist(driver="emulated")
    )


def dump(cell: Cell) -> str:
    """The cell as YAML that loads back equal."""
    content = cell.model_dump(mode="json", exclude_none=True)
    content["limits"] = {name: limit for name, limit in content["limits"].items() if limit}
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_flow_style=None)


def _narrowed(own_deg: Floats, given_deg: list[float | None]) -> Floats:
    pairs = zip(own_deg, given_deg, strict=True)
    return np.radians([own if given is None else given for own, given in pairs])


def _matrix(pose: Numbers) -> Floats:
    return pose_matrix(np.array(pose[:3]) / 1000.0, np.radians(pose[3:]))


def _unknown(what: str, name: str, cell: str, known: tuple[str, ...]) -> str:
    hint = nearest(name, known) or f"; known are {', '.join(known)}"
    return f"the cell '{cell}' has no {what} {shown(name)}{hint}"
