"""What the commands `fk` and `ik` compute: poses and joints in mm and degrees, one or a file.

Imported when one of them runs, for it brings numpy with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sphmctl.cli.columns import JOINT_COLUMNS, POSE_COLUMNS, UNITS, read_columns
from sphmctl.cli.common import numbers, say, whole_file
from sphmctl.cli.following import follow
from sphmctl.cli.robot import Robot
from sphmctl.errors import InfeasibleError, InvalidError
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.robots import rrs, sphm
from sphmctl.robots.geometry import matrix_to_abc, pose_matrix
from sphmctl.yamlfile import ANGLE_LIMIT_DEG, POSITION_LIMIT_MM

TYPED_TOLERANCE_DEG = 1e-6
"""A joint typed this far beyond its range stands on the edge: what rounding in a file may do."""

MEASURED_TOLERANCE_DEG = 0.15
"""The same for --near, which may be measured: one servo step of 0.09 degrees, and rounding."""

JSON_DECIMALS = 12
"""120 degrees by way of radians is not exactly 120; what is cut is far below any accuracy."""

POSE_LIMITS: Floats = np.repeat([POSITION_LIMIT_MM, ANGLE_LIMIT_DEG], 3)
"""Of x, y, z, A, B, C; the same as in path files."""


@dataclass(frozen=True)
class Free:
    """What settles the three joints that an inverse leaves free.

    Attributes:
        cranks: crank angles, rad, (3,); None: they are searched.
        near: joints to stay near to, rad, (9,), or None.
    """

    cranks: Floats | None
    near: Floats | None

    @staticmethod
    def of(robot: Robot, wrist: str, near: str | None) -> Free:
        """From --wrist and --near. Raises InvalidError and InfeasibleError."""
        cranks = joints = None
        if wrist != "auto":
            angles = np.array(numbers(wrist, 3, "--wrist"))
            _check_ranges(robot.ranges[6:], angles, TYPED_TOLERANCE_DEG, "--wrist")
            cranks = np.clip(np.radians(angles), *robot.ranges[6:].T)
        if near is not None:
            angles = np.array(numbers(near, 9, "--near"))
            _check_ranges(robot.ranges, angles, MEASURED_TOLERANCE_DEG, "--near")
            joints = np.radians(angles)
        return Free(cranks, joints)


def forward(robot: Robot, text: str, no_limits: bool) -> dict[str, Any]:
    """`fk --joints`. Raises InvalidError and InfeasibleError."""
    angles = np.array(numbers(text, 9, "--joints"))
    if not no_limits:
        _check_ranges(robot.ranges, angles, TYPED_TOLERANCE_DEG, "--joints")
    joints = np.radians(angles)
    direction, tilt, heave = rrs.tilt_of(rrs.forward_checked(joints[6:]))
    matrix = robot.pose(joints)
    pose = _poses(matrix)
    matrix[:3, 3] *= 1000.0
    return {
        "position_mm": _rounded(pose[:3]),
        "abc_deg": _rounded(pose[3:]),
        "matrix": _rounded(matrix),
        "wrist": {
            "heave_mm": _rounded(heave * 1000.0),
            "tilt_deg": _rounded(np.degrees(tilt)),
            "tilt_direction_deg": _rounded(np.degrees(direction)),
        },
    }


def forward_file(robot: Robot, source: Path, out: Path, no_limits: bool) -> dict[str, Any]:
    """`fk --csv`. Raises InvalidError and InfeasibleError."""
    columns = read_columns(source)
    angles = columns.numbers(JOINT_COLUMNS)
    if not no_limits:
        _check_ranges(robot.ranges, angles, TYPED_TOLERANCE_DEG, columns.where)
    given = ~np.isnan(angles[:, 0])
    poses = np.full((len(angles), 6), np.nan)
    with whole_file(out) as stream:
        poses[given] = _poses(robot.pose(np.radians(angles[given])))
        columns.write(stream, POSE_COLUMNS, poses)
    return {"rows": len(angles), "answered": int((~np.isnan(poses[:, 0])).sum()), "out": str(out)}


def inverse(robot: Robot, free: Free, text: str) -> dict[str, Any]:
    """`ik --pose`. Raises InvalidError, and InfeasibleError where there is no answer."""
    pose = np.array(numbers(text, 6, "--pose"))
    _check_poses(pose, "--pose")
    T = _matrices(pose)
    found = sphm.inverse(T, robot.tool, free.cranks, free.near, robot.ranges, robot.mount_yaw)
    if not len(found.joints):
        raise InfeasibleError(_reason(robot, free, T), "--pose")
    answers = zip(np.degrees(found.joints), np.degrees(found.margins), strict=True)
    return {
        "solutions": [
            {"joints_deg": _rounded(joints), "margin_deg": _rounded(margin)}
            for joints, margin in answers
        ]
    }


def inverse_file(robot: Robot, free: Free, source: Path, out: Path) -> dict[str, Any]:
    """`ik --csv`. Raises InvalidError; rows without an answer are told on stderr."""
    columns = read_columns(source)
    poses = columns.numbers(POSE_COLUMNS)
    _check_poses(poses, columns.where)
    given = np.flatnonzero(~np.isnan(poses[:, 0]))
    T = _matrices(poses[given])
    joints = np.full((len(poses), 9), np.nan)
    with whole_file(out) as stream:
        joints[given] = follow(robot, free.cranks, free.near, T)
        columns.write(stream, JOINT_COLUMNS, np.degrees(joints))
    lost = np.flatnonzero(np.isnan(joints[given, 0]))
    if len(lost):
        first, reason = columns.where(int(given[lost[0]])), _reason(robot, free, T[lost[0]])
        say(f"rows without an answer: {len(lost)}; the first, {first}: {reason}")
    return {"rows": len(poses), "answered": len(given) - len(lost), "out": str(out)}


def _reason(robot: Robot, free: Free, T: Floats) -> str:
    """Why a pose (4, 4) has no answer."""
    problem = sphm.why_not(T, free.cranks, robot.tool, robot.ranges, robot.mount_yaw)
    reason = problem.message if problem else "no joints within their ranges reach it"
    if free.cranks is None:
        return f"no wrist pose reaches it; with all cranks in mid-range {reason}"
    return reason


def _check_ranges(
    ranges: Floats,
    angles_deg: Floats,
    tolerance_deg: float,
    where: str | Callable[[int, str], str],
) -> None:
    """Refuse joints (..., k), the last k of nine, of which one is beyond its range (k, 2), rad."""
    low, high = np.degrees(ranges).T
    angles = angles_deg.reshape(-1, len(ranges))
    wrong = np.argwhere((angles < low - tolerance_deg) | (angles > high + tolerance_deg))
    if len(wrong):
        row, index = (int(item) for item in wrong[0])
        joint = index + len(JOINT_NAMES) - len(ranges)
        raise InfeasibleError(
            f"{JOINT_NAMES[joint]} is {angles[row, index]:.9g} degrees; its range is "
            f"{low[index]:.6g} to {high[index]:.6g}",
            where if isinstance(where, str) else where(row, JOINT_COLUMNS[joint]),
        )


def _check_poses(poses: Floats, where: str | Callable[[int, str], str]) -> None:
    """Refuse numbers (..., 6) that no pose can have."""
    rows = poses.reshape(-1, 6)
    wrong = np.argwhere(np.abs(rows) > POSE_LIMITS)
    if len(wrong):
        row, index = (int(item) for item in wrong[0])
        name = POSE_COLUMNS[index]
        raise InvalidError(
            f"{name} {rows[row, index]:g} is out of range; at most {POSE_LIMITS[index]:g} "
            f"{UNITS[name.rsplit('_', 1)[1]]} is allowed",
            where if isinstance(where, str) else where(row, name),
        )


def _matrices(poses: Floats) -> Floats:
    """Poses (..., 6), x, y, z mm, A, B, C deg, as matrices in metres."""
    return pose_matrix(poses[..., :3] / 1000.0, np.radians(poses[..., 3:]))


def _poses(T: Floats) -> Floats:
    """The other way round."""
    abc_deg = np.degrees(matrix_to_abc(T[..., :3, :3]))
    return np.concatenate([T[..., :3, 3] * 1000.0, abc_deg], axis=-1)


def _rounded(values: Any) -> Any:
    """An array as numbers for JSON, without the noise of the last digits."""
    return (np.round(values, JSON_DECIMALS) + 0.0).tolist()
