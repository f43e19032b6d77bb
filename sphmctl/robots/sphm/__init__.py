"""The nine-joint hybrid robot: arm, wrist and tool in one chain, and its inverse.

Metres and radians; joints in the order A1..A6, theta7..theta9. Poses are those of the tool (the
platform centre O7 without one) in the arm's base frame. The arm has six joints, so the wrist's
three are free in the inverse: the caller fixes them, or `auto` chooses them.
"""

from sphmctl.robots.sphm.along import branches_along, inverse_along
from sphmctl.robots.sphm.apart import inverse_apart
from sphmctl.robots.sphm.chain import (
    MAX_ACCELERATION9,
    MAX_SPEED9,
    RANGES9,
    flange_target,
    forward,
    margin_of,
    platform_in_flange,
)
from sphmctl.robots.sphm.reason import why_not
from sphmctl.robots.sphm.search import Solutions, auto, inverse, inverse_best

__all__ = [
    "MAX_ACCELERATION9",
    "MAX_SPEED9",
    "RANGES9",
    "Solutions",
    "auto",
    "branches_along",
    "flange_target",
    "forward",
    "inverse",
    "inverse_along",
    "inverse_apart",
    "inverse_best",
    "margin_of",
    "platform_in_flange",
    "why_not",
]
