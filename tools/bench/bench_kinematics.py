"""Times the kinematics: nine joints to pose and back, and the arm beside py-opw-kinematics.

Run `python tools/bench/bench_kinematics.py`; one thread, medians of several repeats, contestants
taking turns so that a busy machine slows all of them alike. Not a test.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import py_opw_kinematics as opw
from py_opw_kinematics import _internal as opw_internal
from scipy.spatial.transform import RigidTransform

from sphmctl.motion import Floats
from sphmctl.robots import kr6, sphm
from sphmctl.robots.geometry import pose_matrix

SINGLE_POSES = 2_000  # one call each; enough to hide the timer
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
    return [
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
    for row in contests(options.poses, options.seed):
        calls = [row.ours] if row.reference is None else [row.ours, row.reference]
        ours, *other = median_seconds(calls, options.repeats)
        line = f"{row.name:41} {ours:8.3f} {ours / row.poses * 1e6:8.2f}"
        if other:
            line += f" {other[0] / row.poses * 1e6:8.2f} {ours / other[0]:9.2f}"
            line += f"  {row.reference_name}"
        print(line, flush=True)


if __name__ == "__main__":
    main()
