"""Whether a random path is feasible: its poses followed by the robot's kinematics alone."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np

from sphmctl.config import emulated_cell
from sphmctl.errors import InfeasibleError
from sphmctl.motion import Floats
from sphmctl.pathfile import Path, load_path
from sphmctl.planner.contour import WristGoal
from sphmctl.planner.legs import Setup
from sphmctl.planner.outline import contours
from sphmctl.robots import rrs, sphm
from sphmctl.robots.sphm import bodies
from tests.planner.many_paths import PEN, Drawing, drawing

CELL = emulated_cell()
ROW_M = 0.0005
STEP_RAD = 0.05
"""A joint that moves further between two rows is near a singularity, or on another branch."""

JUMP_RAD = 0.005
"""Cranks whose steps differ by more would start with a jump, as at straight legs they can."""

NEAR_RAD = float(np.radians(2.0))
ATTEMPTS = 400


def feasible(seed: int, folder: FilePath) -> tuple[Drawing, Path]:
    """The first attempt of a seed for which the robot's kinematics know a way."""
    for attempt in range(ATTEMPTS):
        drawn = drawing(seed, attempt)
        file = folder / "path.yaml"
        file.write_text(drawn.text)
        (folder / "path.csv").write_text(drawn.csv)
        path = load_path(file)
        joints = witness(drawn, path)
        if joints is not None and _near(drawn.near, joints):
            return drawn, path
    raise AssertionError(f"seed {seed} gave no feasible path in {ATTEMPTS} attempts")


def witness(drawn: Drawing, path: Path) -> Floats | None:
    """Joints (n, 9) along the path, or None where there are none from its begin on."""
    setup = Setup.of(path, CELL)
    q = drawn.begin
    try:
        found = contours(path.file, path.moves[1:], setup.tool_pose(q), setup.tool_pose, q[6:])
    except InfeasibleError:
        return None
    rows: list[Floats] = [q[None]]
    flange = sphm.forward(q, PEN)[:3, :3]
    for contour in found:
        s = contour.grid(ROW_M)
        pose = contour.pose(s)
        goal = contour.wrist_at(s, q[6:])
        cranks = _cranks(goal, pose, q, flange)
        if cranks is None or np.isnan(cranks).any():
            return None
        along = sphm.inverse_along(pose, cranks, q, PEN, sphm.RANGES9)
        if np.isnan(along).any():
            return None
        rows.append(along)
        q = along[-1]
    joints = np.concatenate(rows)
    steps = np.abs(np.diff(joints, axis=0))
    steps[0, 6:] = 0.0
    jumps = np.abs(np.diff(joints[1:, 6:], 2, axis=0)).max()
    if steps.max() > STEP_RAD or jumps > JUMP_RAD or bodies.clearances(joints, PEN).min() < 0.001:
        return None
    return joints


def _cranks(goal: WristGoal, pose: Floats, q: Floats, R: Floats) -> Floats | None:
    """Crank angles (n, 3): what the path says, or one choice of those it leaves open."""
    low, high = sphm.RANGES9[6:].T
    if goal.policy == "tilt":
        heave = rrs.tilt_of(rrs.forward(q[6:]))[2]
        turned = np.einsum("ji,njk->nik", R, pose[:, :3, :3])
        lean = np.arctan2(np.hypot(turned[:, 0, 2], turned[:, 1, 2]), turned[:, 2, 2])
        towards = np.arctan2(turned[:, 1, 2], turned[:, 0, 2])
        found = rrs.inverse(towards, lean, np.full(len(pose), heave))
    elif goal.cranks_rad is not None:
        found = goal.cranks_rad
    elif goal.heave_m is not None:
        still = np.zeros(len(pose))
        direction = still if goal.direction_rad is None else goal.direction_rad
        tilt = still if goal.tilt_rad is None else goal.tilt_rad
        found = rrs.inverse(direction, tilt, goal.heave_m)
    else:
        found = np.tile(q[6:], (len(pose), 1))
    if np.isnan(found).any() or (found < low - 1e-6).any() or (found > high + 1e-6).any():
        return None
    return np.clip(found, low, high)


def _near(near: str, joints: Floats) -> bool:
    """Whether the way comes as near as it is to."""
    low, high = sphm.RANGES9[6:].T
    if near == "a5":
        return bool(np.abs(joints[:, 4]).min() < NEAR_RAD)
    if near == "crank":
        return bool(np.minimum(joints[:, 6:] - low, high - joints[:, 6:]).min() < NEAR_RAD)
    return True
