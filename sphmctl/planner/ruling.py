"""What rules each instant of a plan, and what the path asks of the tool there; for people."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby

import numpy as np

from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.planner.blocks import Block
from sphmctl.planner.sampling import Samples
from sphmctl.planner.timing import Trapezoid
from sphmctl.planner.way import Way
from sphmctl.robots import kr6

REST = "rest"
"""What the path itself asks for by `dwell_s`; beside it the labels of `timelaw.LABELS`."""

ALL = 0.99
"""From this share on a limit is used up; what is asked for between a block's rows may be less."""

NO_TIME_S = 1e-9
"""Shorter is rounding."""

Shares = tuple[tuple[str, float], ...]


def shares(times: Iterable[tuple[str, float]]) -> Shares:
    """Each label's share of all the time, the most first; none where there is no time."""
    found: dict[str, float] = {}
    for label, time_s in times:
        found[label] = found.get(label, 0.0) + time_s
    total_s = sum(time_s for time_s in found.values() if time_s > NO_TIME_S)
    order = sorted(found.items(), key=lambda item: -item[1])
    return tuple((label, time_s / total_s) for label, time_s in order if time_s > NO_TIME_S)


def stop_ruling(blocks: list[Block], rows: Samples, scale: float) -> tuple[tuple[str, ...], Shares]:
    """What rules each row as the arm's controller drives the blocks, and how long each does."""
    binding = [] if blocks else [REST]
    times = []
    begin_s, begin = 0.0, 0
    for block, end in zip(blocks, rows.ends, strict=True):
        moved = rows.joints[end] - rows.joints[max(begin - 1, 0)]
        cruise, ramps = _rules(block, moved, scale)
        t, law, duration_s = rows.t[begin : end + 1] - begin_s, block.law, block.duration_s
        ramp_s = law.ramp_s if isinstance(law, Trapezoid) else duration_s / 2.0
        cruising = (t > ramp_s) & (t < duration_s - ramp_s)
        binding += [cruise if steady else ramps for steady in cruising.tolist()]
        times += [(ramps, 2.0 * ramp_s), (cruise, duration_s - 2.0 * ramp_s)]
        begin_s, begin = begin_s + duration_s, end + 1
    return tuple(binding), shares(times)


def _rules(block: Block, moved: Floats, scale: float) -> tuple[str, str]:
    """The limits that rule the cruise and the ramps of a block that moves the joints by so much."""
    law, leg = block.law, block.leg
    if leg is None or not isinstance(law, Trapezoid):
        return REST, REST
    cruise, ramps = law.ruled_by
    arm = np.abs(moved[:6])
    if not ramps:
        hard = arm / kr6.MAX_ACCELERATION * law.acceleration / scale**2
        ramps = _joint(hard, "acceleration") or "tool acceleration"
    if not cruise:
        fast = arm / kr6.MAX_SPEED * law.speed / scale
        cruise = _joint(fast, "speed") or _of_tool(block, leg, law.speed / scale)
    return cruise, ramps


def _joint(share: Floats, kind: str) -> str:
    """The axis whose machine limit is used up, which the controller caps a block by."""
    most = int(share.argmax())
    return f"{JOINT_NAMES[most]} {kind}" if share[most] >= ALL else ""


def _of_tool(block: Block, leg: object, speed: float) -> str:
    """The tool's speed, or what its acceleration leaves of that where the path bends."""
    if not isinstance(leg, Way) or leg.length_m == 0.0:
        return "tool speed"
    begin, end = (share * leg.length_m for share in block.u)
    inner = leg.s[slice(*np.searchsorted(leg.s, [begin, end]))]
    wish = leg.contour.speeds(np.concatenate([[begin], inner, [end]]))[0].min()
    return "tool speed" if speed * (end - begin) >= ALL * wish else "tool acceleration"


def asked(blocks: list[Block], rows: Samples, scale: float) -> Floats:
    """The tool's speed (m/s) and acceleration (m/s2) that each row may have, (n, 2).

    Infinite where the tool follows no path. Where two moves meet, those of the first.
    """
    out = np.full((len(rows.t), 2), np.inf)
    starts = [0, *(end + 1 for end in rows.ends)]
    runs = [list(run) for _, run in groupby(range(len(blocks)), key=lambda i: id(blocks[i].leg))]
    for run in runs:
        leg = blocks[run[0]].leg
        if isinstance(leg, Way) and leg.length_m > 0.0:
            part = slice(starts[run[0]], starts[run[-1] + 1])
            speed, acceleration = leg.contour.speeds(rows.u[part] * leg.length_m)
            out[part] = np.stack([speed * scale, acceleration * scale**2], axis=1)
    return out
