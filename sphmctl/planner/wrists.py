"""The wrist's parameters along what a move draws, as a track over its arc length."""

from __future__ import annotations

import numpy as np

from sphmctl.motion import Floats
from sphmctl.pathfile import Wrist
from sphmctl.planner.drawing import Part
from sphmctl.planner.spline import Track, monotone_slopes

OPEN: Floats = np.array([0.0, 0.0, 0.0, 1.0])
"""Cranks as at the contour's begin, whatever they are: the fourth column is their share."""


CRANKS = ("cranks", True)
"""The group of the policies that give crank angles."""


def group(wrist: Wrist) -> tuple[str, bool]:
    """What must be the same for the wrist to run on from one move into the next."""
    if wrist.policy in ("cranks", "fixed"):
        return CRANKS
    return wrist.policy, wrist.heave_mm is None


def wrist_track(part: Part, now: Floats) -> Track | None:
    """The wrist's parameters on a part.

    Args:
        now: the values at the end of the part before: cranks and the share of the begin's in them
            (4,), or heave, tilt, direction (3,); OPEN where they are not known.

    Returns:
        For "cranks" and "fixed" three cranks and the share (k, 4); for "level" the heave (k, 1);
        for "motion" heave, tilt and direction (k, 3); None for the others.
    """
    wrist, length = part.move.wrist, part.shape.length_m
    if wrist.policy in ("cranks", "fixed"):
        return _crank_track(part, now if len(now) == len(OPEN) else OPEN)
    if wrist.heave_mm is None:
        return None
    share = np.array([part.offset_m, part.offset_m + length]) / part.total_m
    heave, tilt = np.array(wrist.heave_mm) / 1000.0, np.radians(wrist.tilt_deg)
    columns = [heave]
    if wrist.policy == "motion":
        towards = np.radians(wrist.tilt_towards_deg)
        direction = towards + np.array([0.0, 2.0 * np.pi * wrist.tilt_turns])
        if len(now) == len(columns) + 2:
            # The same direction after full turns: the wrist does not turn back.
            apart = now[2] - direction[0] - share[0] * (direction[1] - direction[0])
            direction = direction + 2.0 * np.pi * np.round(apart / (2.0 * np.pi))
        columns += [tilt, direction]
    begin, end = np.array(columns).T
    values = begin + share[:, None] * (end - begin)
    return Track.monotone(np.array([0.0, length]), values)


def _crank_track(part: Part, now: Floats) -> Track:
    """Through the cranks that the path gives; as they are, where it gives none."""
    wrist, length = part.move.wrist, part.shape.length_m
    s, cranks = part.cranks
    if wrist.policy == "fixed":
        s, cranks = np.empty(0), np.empty((0, 3))
        if wrist.cranks_deg is not None:
            share = (part.offset_m + length) / part.total_m
            s, cranks = np.array([length]), np.radians([wrist.cranks_deg])
            if share < 1.0:  # a polyline's stop on the way
                s = np.array([part.total_m - part.offset_m])
    if not len(s):
        return Track(np.array([0.0, length]), np.stack([now, now]), np.zeros((2, 4)))
    known = np.column_stack([cranks, np.zeros(len(s))])
    s, values = np.append(0.0, s), np.concatenate([now[None], known])
    if s[-1] < length:
        s, values = np.append(s, length), np.concatenate([values, values[-1:]])
    shown = values.copy()
    if now[3] > 0.0 and len(s) > 2:
        shown[0] = shown[1]  # unknown yet: no slope at the first point can overshoot
    slopes = monotone_slopes(s, shown)
    slopes[0] = (values[1] - values[0]) / s[1]
    track = Track(s, values, slopes)
    return track if s[-1] <= length else track.part(0.0, length)
