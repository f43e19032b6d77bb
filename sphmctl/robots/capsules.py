"""Distances between line segments, and from segments to boxes and planes; arrays, no robot.

A capsule is all that lies within a radius of a segment, so the clearance of two capsules is the
distance of their axes less both radii. Points are (3, ...) with the component first: numpy then
runs along whole rows of samples. Metres.
"""

from __future__ import annotations

import numpy as np

from sphmctl.motion import Floats

# Stands in for the square (m2) of a length that is zero: far below that of any body, and far above
# what overflows as a divisor.
NO_LENGTH_M2 = 1e-30


def dot(a: Floats, b: Floats) -> Floats:
    """The products (...) of vectors (3, ...)."""
    return np.asarray(np.einsum("i...,i...->...", a, b))  # a third of the time of a sum of three


def between_segments(p: Floats, d: Floats, q: Floats, e: Floats) -> Floats:
    """Distances (...) of the segments p to p + d and q to q + e, each (3, ...), broadcast.

    The nearest points of the lines, put back into one segment and then the other: Ericson,
    Real-Time Collision Detection, section 5.1.9. Points and parallels need no case of their own.
    """
    r = p - q
    dd, ee = np.maximum(dot(d, d), NO_LENGTH_M2), np.maximum(dot(e, e), NO_LENGTH_M2)
    de, dr, er = dot(d, e), dot(d, r), dot(e, r)
    s = (de * er - dr * ee) / np.maximum(dd * ee - de * de, NO_LENGTH_M2)
    s = _share(s)
    t = _share((de * s + er) / ee)
    s = _share((de * t - dr) / dd)
    apart = r + s * d - t * e
    return np.asarray(np.sqrt(dot(apart, apart)))


def _share(s: Floats) -> Floats:
    """`s`, put into 0 to 1 where it stands; numpy's own clip takes longer."""
    return np.minimum(np.maximum(s, 0.0, out=s), 1.0, out=s)


def to_box(p: Floats, d: Floats, box: Floats, half_m: Floats) -> Floats:
    """Distances (...) of segments p to p + d, each (3, ...), from a box; 0 where they meet.

    The square of a point's distance from a box is convex along the segment and changes its formula
    only where the point passes the plane of a face. Its slope, linear between these places, is
    taken at all of them; the minimum is where it passes zero.

    Args:
        box: pose of the box's centre, (4, 4).
        half_m: half of its size along x, y and z, (3,).
    """
    R, shape = box[:3, :3], p.shape[1:]
    p = R.T @ (p.reshape(3, -1) - box[:3, 3:])
    d = R.T @ d.reshape(3, -1)
    half = half_m[:, None]
    step = np.where(np.abs(d) < np.sqrt(NO_LENGTH_M2), np.sqrt(NO_LENGTH_M2), d)
    t = np.concatenate([(-half - p) / step, (half - p) / step, np.zeros((1, p.shape[1]))])
    t = np.sort(np.concatenate([np.clip(t, 0.0, 1.0), np.ones((1, p.shape[1]))]), axis=0)

    def beyond(at: Floats) -> Floats:
        """How far (3, k, n) the points at shares (k, n) are outside each pair of faces, signed."""
        x = p[:, None] + d[:, None] * at
        return np.asarray(x - np.clip(x, -half[:, None], half[:, None]))

    slope = dot(beyond(t), np.broadcast_to(d[:, None], (3, *t.shape)))
    last = np.maximum((slope <= 0.0).sum(axis=0) - 1, 0)  # the slope never falls
    after = np.minimum(last + 1, len(t) - 1)
    (t0, s0), (t1, s1) = (
        [np.take_along_axis(a, at[None], axis=0) for a in (t, slope)] for at in (last, after)
    )
    rise = np.maximum(s1 - s0, NO_LENGTH_M2)
    best = np.where(s0 < 0.0, t0 + (t1 - t0) * np.minimum(-s0 / rise, 1.0), t0)
    apart = beyond(best)
    return np.sqrt(dot(apart, apart)).reshape(shape)


def to_plane(p: Floats, d: Floats, point_m: Floats, normal: Floats) -> Floats:
    """Distances (...) of segments from a plane; negative behind it. The normal has length 1."""
    height = np.einsum("i,i...->...", normal, p) - float(normal @ point_m)
    return np.asarray(height + np.minimum(np.einsum("i,i...->...", normal, d), 0.0))
