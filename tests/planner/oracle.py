"""The robot a second time: the paper's D-H table and the controller's law, for wrists held level.

Elsamanty et al., Appl. Sci. 2023, 13, 2088: D-H table of the arm; with equal crank angles the
platform is level at heave 25 sin(90 - theta) + sqrt(61^2 - 25^2 cos^2(90 - theta)).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

A_MM = (-25.0, -455.0, -35.0, 0.0, 0.0, 0.0)
D_MM = (400.0, 0.0, 0.0, -420.0, 0.0, -99.0)
ALPHA_DEG = (90.0, 0.0, -90.0, 90.0, -90.0, 180.0)
PEN_MM = 58.9
SPEEDS_DEG_S = np.array([360.0, 300, 360, 381, 388, 615, 366, 366, 366])
ACCELERATIONS_RAD_S2 = np.array([21.7, 6.89, 31.4, 133, 136, 268, 60, 60, 60])


def pen_mm(joints_deg: Floats) -> tuple[Floats, Floats]:
    """Tip of the pen, mm, and the direction it points in, for nine joints with equal cranks."""
    a = joints_deg
    theta = np.radians([180.0 - a[0], a[1] - 90.0 + 90.0, a[2] - 90.0, a[3], a[4], a[5]])
    T = np.eye(4)
    for t, d, r, alpha in zip(theta, D_MM, A_MM, np.radians(ALPHA_DEG), strict=True):
        ct, st, ca, sa = np.cos(t), np.sin(t), np.cos(alpha), np.sin(alpha)
        T = T @ np.array(
            [
                [ct, -st * ca, st * sa, r * ct],
                [st, ct * ca, -ct * sa, r * st],
                [0, sa, ca, d],
                [0, 0, 0, 1],
            ]
        )
    up = np.radians(90.0 - joints_deg[6])
    heave = 25.0 * np.sin(up) + np.sqrt(61.0**2 - 25.0**2 * np.cos(up) ** 2)
    return T[:3, 3] + (heave + PEN_MM) * T[:3, 2], T[:3, 2]


def controller_block_s(begin: Floats, end: Floats, velocity: float, acceleration: float) -> float:
    """How long a synchronous PTP takes between arm joints (6,), rad; shares of the maxima."""
    moved = np.abs(end - begin)
    speeds, accelerations = np.radians(SPEEDS_DEG_S[:6]), ACCELERATIONS_RAD_S2[:6]
    # Every axis alone would need its own trapezoid; the slowest leads and the others follow it.
    v = min(velocity * s / m for s, m in zip(speeds, moved, strict=True) if m > 1e-12)
    a = min(acceleration * s / m for s, m in zip(accelerations, moved, strict=True) if m > 1e-12)
    return float(1.0 / v + v / a if v * v / a <= 1.0 else 2.0 / np.sqrt(a))


def controller_progress(v: float, a: float, step_s: float) -> Floats:
    """Progress 0 to 1 of a trapezoid, integrated step by step."""
    w, rate, out = 0.0, 0.0, [0.0]
    while w < 1.0:
        brake = rate * rate / (2.0 * a)
        rate = max(rate - a * step_s, a * step_s) if 1.0 - w <= brake else min(rate + a * step_s, v)
        w = min(w + rate * step_s, 1.0)
        out.append(w)
    return np.array(out)


def aside_mm(point: Floats, begin: Floats, end: Floats) -> float:
    """Distance of a point from the segment between two points."""
    way = end - begin
    share = np.clip((point - begin) @ way / (way @ way), 0.0, 1.0)
    return float(np.linalg.norm(point - begin - share * way))
