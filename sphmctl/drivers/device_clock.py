"""When, on the host's clock, something happened by a device's own clock."""

from __future__ import annotations

CRYSTAL_DRIFT = 200e-6
"""Rate at which the bounds widen between two crystals of 100 ppm each."""


class DeviceClock:
    """Bounds the offset between both clocks by what each reply proves.

    A reply that was asked for at `sent_s` and came at `received_s` was sampled in between, after
    the instant with stamp T and before the next refresh. With host = T + offset this proves
    sent_s - refresh_s - T <= offset <= received_s - T. Many replies at random phases leave a
    window of about one service time, and its middle is used.

    Args:
        refresh_s: how old the device's stamp may be when it is sampled.
        drift: rate at which the bounds widen.
    """

    def __init__(self, refresh_s: float, drift: float = CRYSTAL_DRIFT) -> None:
        self._refresh_s = refresh_s
        self._drift = drift
        self._low_s = float("-inf")
        self._high_s = float("inf")
        self._seen_s = 0.0

    def update(self, stamp_s: float, sent_s: float, received_s: float) -> None:
        """Learn from one reply; `stamp_s` is the device's time in it."""
        widening_s = self._drift * max(0.0, received_s - self._seen_s) if self._seen_s else 0.0
        self._seen_s = received_s
        low_s = sent_s - self._refresh_s - stamp_s
        high_s = received_s - stamp_s
        self._low_s = max(self._low_s - widening_s, low_s)
        self._high_s = min(self._high_s + widening_s, high_s)
        if self._low_s > self._high_s:
            # The device's clock was set, or a refresh was late: begin anew.
            self._low_s, self._high_s = low_s, high_s

    def host_s(self, stamp_s: float) -> float:
        """The host's instant of the device's `stamp_s`; needs one `update` before."""
        return stamp_s + (self._low_s + self._high_s) / 2

    @property
    def window_s(self) -> float:
        """Width of what is still possible, s."""
        return self._high_s - self._low_s
