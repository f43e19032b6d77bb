"""The chain from the arm's base to the tool, its limits, and whole turns within them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.robots import kr6, rrs
from sphmctl.robots.geometry import TURN, invert
from sphmctl.robots.kr6_model import FLANGE_M, RANGE_TOLERANCE_RAD
from sphmctl.robots.sphm import single

# L: wrist centre (axes 4, 5, 6) to the wrist's base plane; Elsamanty et al., section 2. The flange
# takes 80 mm of it, the adapter the rest.
BASE_PLANE_M = 0.099
ADAPTER_M = BASE_PLANE_M - FLANGE_M

RANGES9: Floats = np.vstack([kr6.RANGES, rrs.RANGES])
MAX_SPEED9: Floats = np.concatenate([kr6.MAX_SPEED, rrs.MAX_SPEED])
MAX_ACCELERATION9: Floats = np.concatenate([kr6.MAX_ACCELERATION, rrs.MAX_ACCELERATION])

BLOCK = 4096  # poses per piece: memory stays flat, and the work arrays in the processor's cache
NO_TOOL: Floats = np.eye(4)


def platform_in_flange(wrist: ArrayLike, mount_yaw: float = 0.0) -> Floats:
    """Platform poses (..., 4, 4) in the flange frame of crank angles (..., 3).

    The mount yaw turns leg 1 about z against the flange's x.
    """
    c, s = np.cos(mount_yaw), np.sin(mount_yaw)
    mount = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1.0, ADAPTER_M], [0, 0, 0, 1.0]])
    return np.asarray(mount @ rrs.forward(wrist))


def forward(q: ArrayLike, tool: ArrayLike | None = None, mount_yaw: float = 0.0) -> Floats:
    """Tool poses (..., 4, 4) of joints (..., 9); NaN where the wrist does not close.

    Args:
        q: joints, rad; ranges are not applied.
        tool: the tool's frame on the platform, (4, 4); None for the platform centre O7.
        mount_yaw: see `platform_in_flange`.
    """
    q = np.asarray(q, dtype=np.float64)
    if q.shape[-1:] != (9,):
        raise InvalidError(f"joints have shape {q.shape}; the last dimension must be 9")
    if q.ndim == 1:
        platform = single.forward(q.tolist(), mount_yaw, ADAPTER_M)
        return platform if tool is None else np.asarray(platform @ np.asarray(tool))
    flat = q.reshape(-1, 9)
    T = np.empty((len(flat), 4, 4))
    for i in range(0, len(flat), BLOCK):
        block = flat[i : i + BLOCK]
        T[i : i + BLOCK] = kr6.forward(block[:, :6]) @ platform_in_flange(block[:, 6:], mount_yaw)
        if tool is not None:
            T[i : i + BLOCK] = T[i : i + BLOCK] @ np.asarray(tool)
    return T.reshape(*q.shape[:-1], 4, 4)


def flange_target(
    T: ArrayLike, wrist: ArrayLike, tool: ArrayLike | None = None, mount_yaw: float = 0.0
) -> Floats:
    """Flange poses (..., 4, 4) that put the tool at T (..., 4, 4) with crank angles (..., 3)."""
    beyond = platform_in_flange(wrist, mount_yaw) @ (NO_TOOL if tool is None else np.asarray(tool))
    return np.asarray(np.asarray(T, dtype=np.float64) @ invert(beyond))


def margin_of(q: Floats, limits: Floats = RANGES9) -> Floats:
    """Distance (...) of the joint nearest to its limit from it, rad; negative when beyond it."""
    return np.asarray(np.minimum(q - limits[:, 0], limits[:, 1] - q).min(axis=-1))


def turned(q: Floats, wanted: Floats, limits: Floats) -> Floats:
    """Joints moved by whole turns as near to `wanted` as the limits let them."""
    slack = RANGE_TOLERANCE_RAD
    fewest = np.ceil((limits[:, 0] - slack - q) / TURN)
    most = np.floor((limits[:, 1] + slack - q) / TURN)
    turns = np.round((wanted - q) / TURN)
    return q + TURN * np.maximum(np.minimum(turns, most), fewest)


def join(arm: Floats, cranks: Floats) -> Floats:
    """Arm joints (..., K, 6) and crank angles (..., 3) as joints (..., K, 9), whole rows or NaN."""
    q = np.empty((*arm.shape[:-1], 9))
    q[..., :6], q[..., 6:] = arm, cranks[..., None, :]
    q[np.isnan(q).any(axis=-1)] = np.nan
    return q
