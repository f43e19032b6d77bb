"""Times the kinematics: nine joints to pose and back, and the arm beside three other libraries.

Run `python tools/bench/bench_kinematics.py`; one thread, medians of several repeats, contestants
taking turns so that a busy machine slows all of them alike. The others: py-opw-kinematics and eaik,
all branches in closed form; roboticstoolbox, one answer by iteration from 3 degrees beside it.
Not a test.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import py_opw_kinematics as opw
import roboticstoolbox
from eaik.IK_DH import DhRobot
from py_opw_kinematics import _internal as opw_internal
from scipy.spatial.transform import RigidTransform

from sphmctl.cli import solving
from sphmctl.cli.columns import POSE_COLUMNS
from sphmctl.cli.robot import Robot
from sphmctl.config import emulated_cell
from sphmctl.motion import Floats
from sphmctl.robots import kr6, sphm
from sphmctl.robots.geometry import matrix_to_abc, pose_matrix

SINGLE_POSES = 2_000  # one call each; enough to hide the timer
AUTO_POSES = 2_000  # searched together
FILE_ROWS = 100_000
BESIDE_RAD = 0.05  # where the iterating solver starts: 3 degrees from the answer
# The arm's D-H table; Elsamanty et al., Appl. Sci. 2023, 13, 2088, Table 2 with d6 to the flange.
DH_A_M: Floats = np.array([-0.025, -0.455, -0.035, 0.0, 0.0, 0.0])
DH_D_M: Floats = np.array([0.400, 0.0, 0.0, -0.420, 0.0, -0.080])
DH_ALPHA: Floats = np.radians([90.0, 0.0, -90.0, 90.0, -90.0, 180.0])
PEN: Floats = pose_matrix([0.0, 0.0, 0.0589], [0.0, 0.0, 0.0])


@dataclass(frozen=True)
class Contest:
    """Our call and, where there is one, the reference's; `poses` is how many each call handles."""

    name: str
    poses: int
    ours: Callable[[], object]
    reference_name: str = ""
    reference: Callable[[], object] | None = None


def opw_model() -> opw.KinematicModel:
    """The KR6 R900 sixx as py-opw-kinematics describes it: metres, and KUKA's signs."""
    return opw.KinematicModel(
        a1=0.025,
        a2=-0.035,
        b=0.0,
        c1=0.400,
        c2=0.455,
        c3=0.420,
        c4=0.080,
        offsets=(0.0, -np.pi / 2, 0.0, 0.0, 0.0, 0.0),
        flip_axes=(True, False, False, True, False, True),
    )


def dh_angles(arm: Floats) -> Floats:
    """The D-H table's angles of axis angles (n, 6)."""
    return arm * [-1.0, 1.0, 1.0, 1.0, 1.0, 1.0] + [np.pi, 0.0, -np.pi / 2, 0.0, 0.0, 0.0]


def library_contests(arm: Floats, flange: Floats) -> list[Contest]:
    """The arm alone beside eaik and roboticstoolbox, one pose a call."""
    eaik = DhRobot(DH_ALPHA, DH_A_M, DH_D_M)
    links = [
        roboticstoolbox.RevoluteDH(d=d, a=a, alpha=alpha)
        for d, a, alpha in zip(DH_D_M, DH_A_M, DH_ALPHA, strict=True)
    ]
    toolbox = roboticstoolbox.DHRobot(links).ets()
    angles = dh_angles(arm)
    if max(np.abs(eaik.fwdKin(q) - T).max() for q, T in zip(angles, flange, strict=True)) > 1e-9:
        raise AssertionError("the D-H table is not the arm that kr6 describes")
    starts = angles + BESIDE_RAD

    def iterate() -> list[object]:
        pairs = zip(flange, starts, strict=True)
        return [toolbox.ik_LM(T, q0=q, joint_limits=False) for T, q in pairs]

    def every() -> list[object]:
        return [eaik.IK(T) for T in flange]

    def ours() -> object:
        return [kr6.inverse(T) for T in flange]

    name = "arm inverse, 8 branches, one pose a call"
    several = "arm inverse, 8 branches, array"
    return [
        Contest(
            name, len(flange), ours, "eaik, all branches", lambda: [eaik.IK(T) for T in flange]
        ),
        Contest(name, len(flange), ours, "roboticstoolbox ik_LM (1 answer)", iterate),
        Contest(
            several,
            len(flange),
            lambda: kr6.inverse(flange),
            "eaik IK_batched, 1 thread",
            lambda: eaik.IK_batched(flange, 1),
        ),
    ]


def file_contest(folder: Path) -> Contest:
    """`ik --csv` with a fixed wrist, reading and writing included, on random poses."""
    rng = np.random.default_rng(1)
    joints = rng.uniform(sphm.RANGES9[:, 0], sphm.RANGES9[:, 1], (FILE_ROWS, 9))
    joints[:, 6:] = np.radians([60.0, 50.0, 70.0])
    T = sphm.forward(joints)
    abc = np.degrees(matrix_to_abc(T[:, :3, :3]))
    source, out = folder / "poses.csv", folder / "joints.csv"
    table = np.hstack([T[:, :3, 3] * 1000.0, abc])
    np.savetxt(source, table, "%.9f", ",", header=",".join(POSE_COLUMNS), comments="")
    robot = Robot.of(emulated_cell(), None)
    free = solving.Free.of(robot, "60,50,70", None)
    return Contest(
        "ik --csv, fixed wrist, a file of poses",
        FILE_ROWS,
        lambda: solving.inverse_file(robot, free, source, out),
    )


def contests(count: int, seed: int) -> list[Contest]:
    """The table's rows on random joints within their ranges."""
    rng = np.random.default_rng(seed)
    joints = rng.uniform(sphm.RANGES9[:, 0], sphm.RANGES9[:, 1], (count, 9))
    poses = sphm.forward(joints, PEN)
    flange = kr6.forward(joints[:, :6])
    rows = flange.reshape(-1, 16)
    few = flange[:SINGLE_POSES]
    transforms = [RigidTransform.from_matrix(T) for T in few]
    raw = opw_internal.Robot(opw_model(), degrees=False)
    public = opw.Robot(opw_model(), degrees=False)
    arm = joints[:, :6].copy()
    some = poses[:AUTO_POSES]
    return [
        Contest("auto, nine joints, array", len(some), lambda: sphm.auto(some, PEN)),
        *library_contests(arm[:SINGLE_POSES], few),
        Contest("forward, nine joints, array", count, lambda: sphm.forward(joints, PEN)),
        Contest(
            "inverse, nine joints, best answer, array",
            count,
            lambda: sphm.inverse_best(poses, joints[:, 6:], PEN),
        ),
        Contest(
            "arm forward, array",
            count,
            lambda: kr6.forward(arm),
            "opw batch_forward",
            lambda: raw.batch_forward(arm),
        ),
        Contest(
            "arm inverse, 8 branches, one pose a call",
            SINGLE_POSES,
            lambda: [kr6.inverse(T) for T in few],
            "opw inverse, public",
            lambda: [public.inverse(T) for T in transforms],
        ),
        Contest(
            "arm inverse, 8 branches, one pose a call",
            SINGLE_POSES,
            lambda: [kr6.inverse(T) for T in few],
            "opw inverse, compiled core",
            lambda: [raw.inverse(T) for T in few],
        ),
        Contest(
            "arm inverse, 8 branches, array",
            count,
            lambda: kr6.inverse(flange),
            "opw compiled core, one by one",
            lambda: [raw.inverse(T) for T in flange],
        ),
        Contest(
            "arm inverse, 8 branches, array",
            count,
            lambda: kr6.inverse(flange),
            "opw reach, 1 thread",
            lambda: raw.reach(rows, threads=1),
        ),
        Contest(
            "arm inverse, 8 branches, array",
            count,
            lambda: kr6.inverse(flange),
            "opw batch_inverse (1 answer)",
            lambda: raw.batch_inverse(rows),
        ),
    ]


def median_seconds(calls: list[Callable[[], object]], repeats: int) -> list[float]:
    """The median time of each call, the calls taking turns."""
    seconds: list[list[float]] = [[] for _ in calls]
    for _ in range(repeats):
        for call, spent in zip(calls, seconds, strict=True):
            started = time.perf_counter()
            call()
            spent.append(time.perf_counter() - started)
    return [statistics.median(spent) for spent in seconds]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=200_000, help="poses per array call")
    parser.add_argument("--repeats", type=int, default=5, help="medians are over this many")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random joints")
    options = parser.parse_args()
    print(f"{options.poses} random poses in range, median of {options.repeats}, us per pose")
    print(f"{'what':41} {'total s':>8} {'ours':>8} {'ref':>8} {'ours/ref':>9}  reference")
    with tempfile.TemporaryDirectory() as folder:
        rows = [*contests(options.poses, options.seed), file_contest(Path(folder))]
        show(rows, options.repeats)


def show(rows: list[Contest], repeats: int) -> None:
    """Time each row and print its line."""
    for row in rows:
        calls = [row.ours] if row.reference is None else [row.ours, row.reference]
        ours, *other = median_seconds(calls, repeats)
        line = f"{row.name:41} {ours:8.3f} {ours / row.poses * 1e6:8.2f}"
        if other:
            line += f" {other[0] / row.poses * 1e6:8.2f} {ours / other[0]:9.2f}"
            line += f"  {row.reference_name}"
        print(line, flush=True)


if __name__ == "__main__":
    main()
