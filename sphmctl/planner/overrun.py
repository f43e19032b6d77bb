"""Looks at the stream that a motion gives: by how much, and where, it goes beyond the bounds.

Speeds and accelerations are differences over 4 ms, as a controller would see them, taken every
0.8 ms so that the stream may begin at any instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.jerk import Pieces
from sphmctl.planner.topp import SAMPLE_S, Caps
from sphmctl.planner.track import Track

PHASES = 5
"""Begins of the 4 ms stream that are looked at."""

BLOCK = 50_000
"""Samples differentiated at a time; bounds the memory of long paths."""


@dataclass(frozen=True)
class Use:
    """What the stream takes of the bounds: 1 is all of it.

    Attributes:
        speed, acceleration: largest share in the neighbourhood of each interval, (N,).
    """

    speed: Floats
    acceleration: Floats


def look(track: Track, pieces: Pieces, caps: Caps) -> Use:
    """The use of the bounds along the track."""
    step_s = SAMPLE_S / PHASES
    count = int(pieces.duration_s / step_s) + 2 * PHASES + 2
    t = step_s * (np.arange(count, dtype=np.float64) - PHASES)
    s = pieces.at(t)[0]
    speed, acceleration = np.zeros(count), np.zeros(count)
    for low in range(0, count - 2 * PHASES, BLOCK):
        part = slice(low, min(low + BLOCK + 2 * PHASES, count))
        inner = slice(part.start + PHASES, part.stop - PHASES)
        speed[inner], acceleration[inner] = _shares(track, s[part], caps)
    reach = int(np.ceil((pieces.filter_s / 2.0 + SAMPLE_S) / step_s))
    return Use(_spread(track, s, speed, reach), _spread(track, s, acceleration, reach))


def _shares(track: Track, s: Floats, caps: Caps) -> tuple[Floats, Floats]:
    """Shares (m - 2 PHASES,) of the speeds and accelerations at the inner ones of s (m,)."""
    values, interval = track.at(s)
    before, here, after = (slice(k * PHASES, len(s) - (2 - k) * PHASES) for k in range(3))
    rate = np.abs(values[here] - values[before]) / SAMPLE_S
    force = np.abs(values[after] - 2.0 * values[here] + values[before]) / SAMPLE_S**2
    # A difference that spans two moves is held against the more generous of their limits.
    tool_speed, tool_force = caps.tool_speed[interval], caps.tool_acceleration[interval]
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = _worst(rate, caps.joint_speeds, np.maximum(tool_speed[here], tool_speed[before]))
        farthest = np.maximum(tool_force[after], tool_force[before])
        acceleration = _worst(force, caps.joint_accelerations, farthest)
    return speed, acceleration


def _worst(rates: Floats, joints: Floats, tool: Floats) -> Floats:
    point = np.linalg.norm(rates[:, -3:], axis=1)
    alone = np.where(rates[:, :-3] > 0.0, rates[:, :-3] / joints, 0.0).max(axis=1)
    return np.asarray(np.maximum(alone, np.where(point > 0.0, point / tool, 0.0)))


def _spread(track: Track, s: Floats, share: Floats, reach: int) -> Floats:
    """The largest share (N,) within `reach` samples of each interval."""
    wide = share.copy()
    for away in range(1, reach + 1):
        wide[away:] = np.maximum(wide[away:], share[:-away])
        wide[:-away] = np.maximum(wide[:-away], share[away:])
    middle = (track.s[1:] + track.s[:-1]) / 2.0
    out = wide[np.clip(np.searchsorted(s, middle), 0, len(s) - 1)]
    interval = np.clip(np.searchsorted(track.s, s, side="right") - 1, 0, len(out) - 1)
    np.maximum.at(out, interval, wide)
    return np.asarray(out)
