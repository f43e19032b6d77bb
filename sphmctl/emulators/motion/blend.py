"""Where and how long two blocks are blended, and why not.

The end of one block and the beginning of the next run at the same time for `overlap_s`; never
longer than either ramp, so that equal blocks in line keep their speed through the knot.
"""

from __future__ import annotations

import math
from itertools import pairwise

from sphmctl.emulators.motion.blocks import Apo, Block, Ptp
from sphmctl.emulators.motion.contours import ToolPath
from sphmctl.emulators.motion.figures import (
    APO_DIS_PTP_DEG,
    Joints,
    Options,
)
from sphmctl.emulators.motion.frames import length, minus
from sphmctl.emulators.motion.kinematics import forward
from sphmctl.emulators.motion.profile import Profile
from sphmctl.emulators.motion.run import Run

MIDDLE = 0.5
"""A blend never passes the middle of a block, so that two blends of one block cannot meet."""

CHORDS = 8
"""Chords by which the tool centre's way of a PTP is measured for $APO.CDIS."""

PATH_FACTOR = math.sqrt(2.0)
"""By which the sum of two paths may exceed the larger $ACC.CP: what a right angle needs to be cut
as deep as $APO allows."""

HALVINGS = 6
"""Halvings in the search for the longest overlap within the limits: 2 % of it."""

ROUNDING = 1.0 + 1e-6
KINK_S = 1e-9
"""Beside a kink of an acceleration, so that a jump is seen from both sides."""


def link(first: Run, second: Run, options: Options) -> None:
    """Make two blocks neighbours, and blend them if the first asks for it."""
    first.behind, second.before = second, first
    if first.block is None or not first.block.approximation:
        return
    overlap_s, first.reason = join(first, second, options)
    if overlap_s > 0.0 and first.t_s > first.profile.duration_s - overlap_s:
        overlap_s, first.reason = 0.0, "next block planned too late"
    first.overlap_s = overlap_s


def join(first: Run, second: Run, options: Options) -> tuple[float, str]:
    """The overlap in seconds of two planned blocks, and, where that is 0, the reason."""
    block, then = first.block, second.block
    if block is None or then is None or first.bco or second.bco:
        return 0.0, "block coincidence run"
    for run in (first, second):
        if run.profile.duration_s == 0.0:
            return 0.0, "a block without way"
        if run.profile.duration_s < options.shortest_blend_s:
            return 0.0, "a block too short to be planned in time"
    zones = _zones(first, second, block, then)
    if zones is None:
        return 0.0, "the second word for PTP to LIN or CIRC is missing, or C_PTP stands on a path"
    a, b = first.profile, second.profile
    overlap_s = min(
        a.rise_s,
        b.rise_s,
        a.time_to(zones[0]),
        b.time_to(zones[1]),
    )
    if "C_VEL" in block.approximation:
        overlap_s = min(overlap_s, a.ramp_time_to_speed(min(1.0, block.apo.cvel_percent / 100.0)))
    overlap_s = _within_limits(first, second, overlap_s)
    return (overlap_s, "") if overlap_s > 0.0 else (0.0, "$APO is 0")


def _zones(first: Run, second: Run, block: Block, then: Block) -> tuple[float, float] | None:
    """The shares of both blocks in which they may be blended; None where the words forbid it.

    KUKA mxAutomation Logix 1.0, p. 25; the two values of $APO: robot-forum 14422.
    """
    words = block.approximation
    path_words = [word for word in words if word != "C_PTP"]
    if isinstance(block.motion, Ptp):
        if isinstance(then.motion, Ptp) and "C_PTP" in words:
            return _ptp_zone(first, block.apo), _ptp_zone(second, then.apo)
        if not path_words:
            return None
        if "C_PTP" in words:
            return _ptp_zone(first, block.apo), _path_zone(second, path_words[0], then.apo)
        # C_DIS alone on a PTP, as KRC4's inline forms write: one distance for both sides.
        start = _path_zone(first, path_words[0], block.apo)
        return start, _path_zone(second, path_words[0], block.apo)
    if not path_words:
        return None
    start = _path_zone(first, path_words[0], block.apo)
    if isinstance(then.motion, Ptp):
        return start, _ptp_zone(second, then.apo)
    return start, _path_zone(second, path_words[0], then.apo)


def _ptp_zone(run: Run, apo: Apo) -> float:
    """$APO.CPTP is percent of half the block; $APO_DIS_PTP caps it for each axis."""
    longest = max(map(abs, run.contour.stretch))
    return min(MIDDLE * apo.cptp_percent / 100.0, APO_DIS_PTP_DEG / longest, MIDDLE)


def _path_zone(run: Run, word: str, apo: Apo) -> float:
    if word == "C_VEL":
        return MIDDLE
    if word == "C_ORI":
        turn = run.contour.stretch[1] if isinstance(run.contour, ToolPath) else 0.0
        return min(MIDDLE, apo.cori_deg / turn) if turn > 0.0 else MIDDLE
    way_mm = _way_mm(run)
    return min(MIDDLE, apo.cdis_mm / way_mm) if way_mm > 0.0 else MIDDLE


def _way_mm(run: Run) -> float:
    if isinstance(run.contour, ToolPath):
        return run.contour.length_mm
    line = run.contour
    places = [forward(line.joints(k / CHORDS, line.start_deg))[0] for k in range(CHORDS + 1)]
    return sum(length(minus(b, a)) for a, b in pairwise(places))


def _within_limits(first: Run, second: Run, overlap_s: float) -> float:
    """The longest overlap up to `overlap_s` in which the sum keeps the blocks' own limits.

    The shortest of both build-up times always does: there one acceleration fades linearly while
    the other builds up linearly, so the sum is nowhere above the larger one.
    """
    low = min(first.profile.smooth_s, second.profile.smooth_s, overlap_s)
    check = _Check(first, second)
    if overlap_s <= low or check.holds(overlap_s):
        return overlap_s
    high = overlap_s
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        if check.holds(middle):
            low = middle
        else:
            high = middle
    return low


class _Check:
    """Speeds and accelerations of the sum of one block's end and the next one's beginning.

    For two paths as lengths of vectors, against the larger of both blocks'; otherwise for each
    axis, against its $VEL_AXIS and $ACC_AXIS, or the machine's maxima beside a path.
    """

    def __init__(self, first: Run, second: Run) -> None:
        self._a, self._b = first.profile, second.profile
        one, two = first.contour, second.contour
        self._paths = isinstance(one, ToolPath) and isinstance(two, ToolPath)
        if isinstance(one, ToolPath) and isinstance(two, ToolPath):
            self._ends: tuple[Joints, Joints] = (one.direction(True), two.direction(False))
            u, v = (math.hypot(*end) for end in self._ends)
            self._speeds: Joints = (max(u * self._a.peak, v * self._b.peak),)
            hardest = max(u * self._a.acceleration, v * self._b.acceleration)
            self._accelerations: Joints = (hardest * PATH_FACTOR,)
        else:
            self._ends = (one.tangent(True), two.tangent(False))
            limits = [run.axis_limits for run in (first, second)]
            self._speeds, self._accelerations = (
                tuple(map(max, *pair)) for pair in zip(*limits, strict=True)
            )

    def holds(self, overlap_s: float) -> bool:
        """Whether the sum keeps the limits at every kink of both accelerations."""
        a, b = self._a, self._b
        begin_s = a.duration_s - overlap_s
        kinks = [overlap_s - t_s for t_s in _kinks(a)] + _kinks(b)
        return all(
            self._fits(a.at(begin_s + t_s), b.at(t_s))
            for kink_s in kinks
            for t_s in (kink_s - KINK_S, kink_s + KINK_S)
            if 0.0 < t_s < overlap_s
        )

    def _fits(self, one: tuple[float, float, float], two: tuple[float, float, float]) -> bool:
        for order, limits in ((1, self._speeds), (2, self._accelerations)):
            u, v = one[order], two[order]
            sums = [e * u + f * v for e, f in zip(*self._ends, strict=True)]
            sizes = [math.hypot(*sums)] if self._paths else map(abs, sums)
            if any(s > limit * ROUNDING for s, limit in zip(sizes, limits, strict=True)):
                return False
        return True


def _kinks(profile: Profile) -> list[float]:
    """Times at which the acceleration of the first ramp bends, and one between."""
    w, r = profile.smooth_s, profile.rise_s
    return [0.0, w, r / 2.0, r - w, r]
