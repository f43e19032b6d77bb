"""Where on the plan the arm is, was, and will be; and how far ahead the cranks must be told.

Pure computation over host times handed in. The arm leads: nothing here tells it anything.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats, Plan

STILL_RAD = 1e-9
"""Arm joints closer than this are one point: a thousandth of what a controller's text shows."""

CORRECTION = 0.6
"""Share of a measured progress error that is believed at once, at full path speed."""

SLOW_SHARE = 0.3
"""Below this share of a block's peak speed progress is ill-defined, and is believed less."""

JUMP_S = 0.05
"""A progress error beyond this is no noise: a hold, a brake or a late start. Believed in full."""

FIRST_GAP_S = 0.012
"""Pause between two blocks before any was seen: one interpolation cycle."""

GAP_CORRECTION = 0.3
"""Share by which each observed pause moves the expected one."""

HORIZON_S = 0.15
"""Without a new measurement progress is predicted no further than this."""

RATE_CORRECTION = 0.05
"""Share by which each measurement moves the estimate of the arm's speed against the plan's."""

RATE_RANGE = (0.2, 1.5)
"""Speeds against the override's that are believed."""


UNKNOWN_S = math.inf
"""Instant of a begin that cannot be foretold: the arm is seen to move before it is followed."""


@dataclass(frozen=True)
class Stretch:
    """A piece of the plan: the arm drives one block, or stands while time passes.

    Attributes:
        first, last: its samples, both included.
        sequence: sequence number of its knot, from 1; 0 where the arm stands.
        knot: index into the plan's knots; -1 where the arm stands.
    """

    first: int
    last: int
    sequence: int
    knot: int


def stretches(plan: Plan) -> tuple[Stretch, ...]:
    """Cut a plan where the arm stops; blocks that do not move the arm pass by the clock."""
    arm = plan.joints[:, :6]
    moves = np.abs(np.diff(arm, axis=0)).max(axis=1) > STILL_RAD
    pieces: list[Stretch] = []
    begin, sequence = 0, 0
    for index, knot in enumerate(plan.knots):
        moving = np.flatnonzero(moves[begin : knot.sample])
        start = begin + int(moving[0]) if moving.size else knot.sample
        if start > begin:
            pieces.append(Stretch(begin, start, 0, -1))
        if start < knot.sample:
            sequence += 1
            pieces.append(Stretch(start, knot.sample, sequence, index))
        begin = knot.sample
    if begin < len(plan.t) - 1:
        pieces.append(Stretch(begin, len(plan.t) - 1, 0, -1))
    return tuple(pieces)


class Follower:
    """Tracks plan time tau from the arm's measured joints.

    Args:
        plan: what the arm drives.
        begin_s: host time of the first look at the arm.
    """

    def __init__(self, plan: Plan, begin_s: float) -> None:
        self._t = plan.t
        self._arm = plan.joints[:, :6]
        self._cranks = plan.joints[:, 6:]
        self._crank_rates = np.gradient(self._cranks, plan.t, axis=0)
        steps = np.diff(self._arm, axis=0)
        self._speed = np.abs(steps).max(axis=1) / np.diff(plan.t)
        self.pieces = stretches(plan)
        self._index = 0
        self._tau = float(plan.t[0])
        # When the stretch was, or will be, at `_tau`; UNKNOWN_S for a block nobody has seen begin.
        self._at_s = begin_s if self.pieces and not self.pieces[0].sequence else UNKNOWN_S
        self._override = 1.0
        self._scale = 1.0
        self._stopped = False
        self._begun = False
        self._measured_s = begin_s
        self._gap_s = FIRST_GAP_S
        self._published = 0
        self.off_plan_rad = 0.0

    @property
    def piece(self) -> Stretch | None:
        """The stretch that is being driven; None when all are done."""
        return self.pieces[self._index] if self._index < len(self.pieces) else None

    @property
    def open_sequence(self) -> int:
        """Sequence number of the newest knot the arm may have: none beyond a pause."""
        newest = 0
        for piece in self.pieces[self._index :]:
            if piece.sequence == 0:
                break
            newest = piece.sequence
        return newest

    def publish(self, sequence: int) -> None:
        """The arm has been given every knot up to `sequence`."""
        self._published = sequence

    def update(
        self, joints: Floats, at_s: float, passed: int, override: float, stopped: bool
    ) -> None:
        """Learn from one cycle of the controller.

        Args:
            joints: measured A1..A6, rad, shape (6,).
            at_s: host time of the cycle.
            passed: sequence number of the newest knot passed.
            override: the controller's override, 0..1.
            stopped: whether the controller says that the arm stands.
        """
        self._measured_s = max(self._measured_s, at_s)
        self._override = override
        self._stopped = stopped
        self._pass_clock(at_s)
        while (piece := self.piece) is not None and 0 < piece.sequence <= passed:
            self._enter_next(at_s)
        if piece is not None and piece.sequence:
            self._measure(piece, joints, at_s)
        else:
            stand = self._arm[-1 if piece is None else piece.first]
            self.off_plan_rad = float(np.abs(joints - stand).max())

    def tau(self, host_s: float) -> float:
        """Plan time at which the arm is, was or will be at a host time."""
        host_s = min(host_s, self._measured_s + HORIZON_S)
        index, tau, at_s = self._index, self._tau, self._at_s
        rate = self._rate()
        while index < len(self.pieces):
            piece = self.pieces[index]
            end = float(self._t[piece.last])
            pace = rate if piece.sequence else 1.0
            reached = tau + pace * max(0.0, host_s - at_s)
            if reached < end or pace == 0.0:
                return reached
            at_s += (end - tau) / pace
            tau = end
            index += 1
            if index < len(self.pieces):
                following = self.pieces[index].sequence
                if following > self._published:
                    break
                if following and piece.sequence:
                    at_s += self._gap_s
        return tau

    def cranks(self, tau: float) -> Floats:
        """Planned crank angles at plan time `tau`, rad, shape (3,)."""
        return self._at(self._cranks, tau)

    def crank_rates(self, tau: float) -> Floats:
        """Planned crank velocities at plan time `tau`, as the arm runs now, rad/s, shape (3,)."""
        return self._at(self._crank_rates, tau) * self._rate()

    def _at(self, rows: Floats, tau: float) -> Floats:
        i = int(np.searchsorted(self._t, tau, side="right")) - 1
        i = max(0, min(i, len(self._t) - 2))
        share = (tau - self._t[i]) / (self._t[i + 1] - self._t[i])
        result: Floats = rows[i] + min(1.0, max(0.0, share)) * (rows[i + 1] - rows[i])
        return result

    def _rate(self) -> float:
        if self._stopped and self._begun:
            return 0.0
        return self._override * self._scale

    def _pass_clock(self, at_s: float) -> None:
        """Leave a stretch that passes by the clock when its time is over."""
        piece = self.piece
        if piece is None or piece.sequence:
            return
        end = float(self._t[piece.last])
        over_s = self._at_s + end - self._tau
        if at_s >= over_s:
            self._index += 1
            following = self.piece
            driven = following is not None and following.sequence
            self._tau, self._begun = end, False
            self._at_s = UNKNOWN_S if driven else over_s

    def _enter_next(self, at_s: float) -> None:
        """The knot of this block was passed: expect the next stretch to begin."""
        piece = self.pieces[self._index]
        end = float(self._t[piece.last])
        rate = max(self._rate(), self._override * self._scale)
        over_s = self._at_s + (end - self._tau) / rate if rate > 0.0 else at_s
        over_s = min(over_s, at_s)  # also where the block's begin was never seen
        self._index += 1
        following = 0 if self.piece is None else self.piece.sequence
        self._tau, self._begun = end, False
        if following > self._published:
            self._at_s = UNKNOWN_S
        else:
            self._at_s = over_s + (self._gap_s if following else 0.0)

    def _measure(self, piece: Stretch, joints: Floats, at_s: float) -> None:
        begin = float(self._t[piece.first])
        expected = self.tau(at_s) if at_s >= self._at_s else self._tau
        expected = min(expected, float(self._t[piece.last]))
        measured, sample, self.off_plan_rad = self._project(piece, joints)
        if measured <= begin + 1e-6:
            if not self._begun:
                # Not under way by now, whatever was expected.
                self._tau, self._at_s = begin, max(self._at_s, at_s)
            return
        error = measured - expected
        speeds = self._speed[piece.first : piece.last]
        share = min(1.0, float(self._speed[sample]) / (SLOW_SHARE * float(speeds.max())))
        weight = CORRECTION * share
        if not self._begun:
            rate = max(self._override * self._scale, RATE_RANGE[0])
            self._learn_gap(at_s - (measured - begin) / rate)
            self._begun, weight = True, 1.0
        elif abs(error) > JUMP_S:
            weight = 1.0
        elif self._override > 0.0 and not self._stopped:
            scale = self._scale + RATE_CORRECTION * share * error / max(JUMP_S, at_s - self._at_s)
            self._scale = min(max(scale, RATE_RANGE[0]), RATE_RANGE[1])
        self._tau = max(begin, expected + weight * error)
        self._at_s = at_s

    def _learn_gap(self, began_s: float) -> None:
        before = self.pieces[self._index - 1] if self._index else None
        if before is None or before.sequence == 0:
            return
        seen_s = self._gap_s + began_s - self._at_s
        if 0.0 <= seen_s <= JUMP_S:
            self._gap_s += GAP_CORRECTION * (seen_s - self._gap_s)

    def _project(self, piece: Stretch, joints: Floats) -> tuple[float, int, float]:
        """Nearest plan time on a stretch, the sample before it, and the distance in rad."""
        arm = self._arm[piece.first : piece.last + 1]
        nearest = int(np.abs(arm - joints).max(axis=1).argmin())
        best = (math.inf, 0.0, nearest)
        for low in (nearest - 1, nearest):
            if not 0 <= low < len(arm) - 1:
                continue
            step = arm[low + 1] - arm[low]
            length = float(step @ step)
            share = float((joints - arm[low]) @ step) / length if length > 0.0 else 0.0
            share = min(1.0, max(0.0, share))
            distance = float(np.abs(arm[low] + share * step - joints).max())
            if distance < best[0]:
                best = (distance, share, low)
        distance, share, low = best
        sample = piece.first + low
        t = self._t
        return float(t[sample] + share * (t[sample + 1] - t[sample])), sample, distance


FIRST_LEAD_S = 0.035
"""Lead before any motion was seen: the middle of what an XL430 needs, and half a cycle."""

LEAD_LIMITS_S = (0.0, 0.12)
"""Leads that are believed: more would be a fault, not a delay."""

FAST_GAIN, SLOW_GAIN, FAST_CYCLES = 0.12, 0.02, 30
"""Share of an observed lateness by which the lead moves: first, at last, and how soon it falls.
The servo answers after about four cycles, which a gain of 0.12 does not make ring."""

LEARN_RAD_S = math.radians(5.0)
"""Cranks slower than this show counts, not lateness."""


class Lead:
    """How far ahead of the arm each servo must be told its goal, learnt from what it did."""

    def __init__(self) -> None:
        self.seconds = np.full(3, FIRST_LEAD_S)
        self._cycles = np.zeros(3)

    def update(self, required: Floats, measured: Floats, rates: Floats) -> None:
        """Learn from one cycle.

        Args:
            required: crank angles that fit the arm at the instant of measuring, rad, shape (3,).
            measured: crank angles measured then, rad; NaN where unknown.
            rates: planned velocities then, rad/s.
        """
        for leg in range(3):
            if abs(rates[leg]) < LEARN_RAD_S or not math.isfinite(measured[leg]):
                continue
            late_s = (required[leg] - measured[leg]) / rates[leg]
            gain = SLOW_GAIN + (FAST_GAIN - SLOW_GAIN) * math.exp(-self._cycles[leg] / FAST_CYCLES)
            self._cycles[leg] += 1.0
            moved = self.seconds[leg] + gain * late_s
            self.seconds[leg] = min(max(moved, LEAD_LIMITS_S[0]), LEAD_LIMITS_S[1])
