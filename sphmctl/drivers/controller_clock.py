"""When, on the host's clock, a cycle of the controller happened."""

from __future__ import annotations

CYCLE_S = 0.012
"""Interpolation cycle of a KRC4, at which the state structure is refreshed."""

DRIFT = 200e-6
"""Rate at which the bounds widen: two crystals of 100 ppm each."""


class ControllerClock:
    """Bounds the offset between both clocks by what each reply proves.

    A reply that was asked for at `sent_s` and came at `received_s` was sampled in between, after
    the cycle with stamp T and before the next one. With host = T + offset this proves
    sent_s - CYCLE_S - T <= offset <= received_s - T. Many replies at random phases of the cycle
    leave a window of about one service time, and its middle is used.
    """

    def __init__(self) -> None:
        self._low_s = float("-inf")
        self._high_s = float("inf")
        self._seen_s = 0.0

    def update(self, stamp_s: float, sent_s: float, received_s: float) -> None:
        """Learn from one reply; `stamp_s` is the controller's time in it."""
        widening_s = DRIFT * max(0.0, received_s - self._seen_s) if self._seen_s else 0.0
        self._seen_s = received_s
        low_s = sent_s - CYCLE_S - stamp_s
        high_s = received_s - stamp_s
        self._low_s = max(self._low_s - widening_s, low_s)
        self._high_s = min(self._high_s + widening_s, high_s)
        if self._low_s > self._high_s:
            # The controller's clock was set, or a cycle was late: begin anew.
            self._low_s, self._high_s = low_s, high_s

    def host_s(self, stamp_s: float) -> float:
        """The host's instant of the controller's cycle `stamp_s`; needs one `update` before."""
        return stamp_s + (self._low_s + self._high_s) / 2

    @property
    def window_s(self) -> float:
        """Width of what is still possible, s."""
        return self._high_s - self._low_s
