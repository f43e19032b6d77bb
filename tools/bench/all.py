"""Runs every benchmark, one after the other, and prints one table for the README.

Run `python tools/bench/all.py`, about six minutes, on a machine that does nothing else;
`--quick` takes fewer repeats and leaves out the runs in real time. Not a test.
"""

from __future__ import annotations

import argparse

from tools.bench import (
    bench_help,
    bench_kinematics,
    bench_kvp,
    bench_planning,
    bench_runs,
    bench_servo,
    bench_timing,
    bench_workspace,
    published,
)
from tools.bench.harness import Row, markdown

POSES, QUICK_POSES = 200_000, 20_000
REPEATS, QUICK_REPEATS = 5, 2
SEED = 1
QUICK_ROUNDS = 5
QUICK_CALLS = 3

ARRAY_AIM_S = 1.0
"""200,000 nine-joint poses forward."""

KINEMATICS = "python tools/bench/bench_kinematics.py"
AIMS = {
    ("arm inverse, 8 branches, one pose a call", "opw inverse, public"): 2.0,
    ("arm inverse, 8 branches, array", "opw compiled core, one by one"): 1.0,
    ("arm inverse, 8 branches, array", "opw reach, 1 thread"): 1.0,
}
"""Our time by that of py-opw-kinematics, at most: near it per pose, ahead of it in arrays."""


def kinematics_rows(quick: bool) -> list[Row]:
    """The kinematics' contests as rows of the table."""
    poses, repeats = (QUICK_POSES, QUICK_REPEATS) if quick else (POSES, REPEATS)
    rows = []
    for contest in bench_kinematics.contests(poses, SEED):
        calls = [contest.ours] + ([] if contest.reference is None else [contest.reference])
        ours_s, *others_s = bench_kinematics.median_seconds(calls, repeats)
        print(f"{contest.name}: {ours_s:.3f} s for {contest.poses}", *others_s, flush=True)
        ours = f"{ours_s * 1e6 / contest.poses:.2f} us a pose"
        name = contest.name
        if not others_s:
            limit_s = ARRAY_AIM_S * contest.poses / POSES if name.startswith("forward") else None
            reference = "" if limit_s is None else f"{ARRAY_AIM_S:g} s for {POSES}"
            ratio = None if limit_s is None else ours_s / limit_s
            aim = None if limit_s is None else 1.0
            rows.append(Row(name, ours, reference, ratio, aim, KINEMATICS))
            continue
        other = f"{others_s[0] * 1e6 / contest.poses:.2f} us, {contest.reference_name}"
        aim = AIMS.get((name, contest.reference_name))
        rows.append(Row(name, ours, other, ours_s / others_s[0], aim, KINEMATICS))
    return rows


def main() -> None:
    """Run everything and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer repeats, no real time")
    quick = parser.parse_args().quick
    rows = [
        *bench_kvp.measure(QUICK_ROUNDS if quick else bench_kvp.ROUNDS),
        *bench_servo.measure(QUICK_ROUNDS if quick else bench_servo.ROUNDS),
        *kinematics_rows(quick),
        *bench_workspace.measure(),
        *bench_timing.measure(bench_timing.QUICK_REPEATS if quick else bench_timing.REPEATS),
        *bench_planning.measure(QUICK_CALLS, large=not quick),
        *bench_help.measure(QUICK_CALLS if quick else bench_help.CALLS),
        *bench_runs.measure(real_time=not quick),
        *published.measure(1 if quick else published.SEEDS),
    ]
    print()
    print(markdown(rows))


if __name__ == "__main__":
    main()
