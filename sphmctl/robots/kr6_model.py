"""The KUKA KR 6 R900 sixx in numbers: lengths, axis limits, tolerances. Metres and radians."""

from __future__ import annotations

import math

import numpy as np

from sphmctl.motion import Floats

# Lengths: Elsamanty et al., Appl. Sci. 2023, 13, 2088, D-H table (a: 25, 455, 35; d: 400, 420), and
# the same in ros-industrial/kuka_experimental, kuka_kr6_support/urdf/kr6r900sixx_macro.xacro.
AXIS2_HEIGHT_M = 0.400  # M: base to axis 2, upwards
AXIS2_FORWARD_M = 0.025  # N: base to axis 2, forwards
UPPER_ARM_M = 0.455  # H: axis 2 to axis 3
FOREARM_M = 0.420  # G: axis 3 to the wrist centre, along the forearm
FOREARM_OFFSET_M = 0.035  # I: the same, square to the forearm, up when it is level
FLANGE_M = 0.080  # wrist centre (axes 4, 5, 6) to the flange

FOREARM_LENGTH_M = math.hypot(FOREARM_M, FOREARM_OFFSET_M)  # axis 3 to the wrist centre, straight
FOREARM_ANGLE_RAD = math.atan2(FOREARM_OFFSET_M, FOREARM_M)  # that line over the forearm

# Axis ranges and speeds: KUKA "Spez KR AGILUS sixx" V12, 26.03.2015, as quoted by the URDF above.
RANGES: Floats = np.radians(
    [
        [-170.0, 170.0],
        [-190.0, 45.0],
        [-120.0, 156.0],
        [-185.0, 185.0],
        [-120.0, 120.0],
        [-350.0, 350.0],
    ]
)
MAX_SPEED: Floats = np.radians([360.0, 300.0, 360.0, 381.0, 388.0, 615.0])  # rad/s
# rad/s2; kroshu/kuka_robot_descriptions, kr6_r900_sixx_joint_limits.yaml, for want of KUKA's own.
MAX_ACCELERATION: Floats = np.array([21.7, 6.89, 31.4, 133.0, 136.0, 268.0])

A2_MIDDLE_RAD = float(RANGES[1].mean())  # A2 is given within half a turn of this

# A wrist centre this far beyond reach (m) stands on the edge: a thousand times the rounding of a
# pose, a thousandth of a micrometre.
REACH_TOLERANCE_M = 1e-9
# Below this sine of A5, A4 and A6 are noise (rounding 1e-16 over 1e-9 is 1e-7 rad), and any A4
# moves a tool 0.3 m from the wrist centre by less than 1e-6 mm.
SINGULAR_SINE = 1e-9
# Below this distance (m) of the wrist centre from axis 1, A1 is noise in the same way.
SHOULDER_RADIUS_M = 1e-10
# A joint that rounding has put this far (rad) beyond its range stands on the edge; at the full
# reach of 1 m that is less than 1e-6 mm.
RANGE_TOLERANCE_RAD = 1e-9
