"""The figures of the KR 6 R900 sixx's motion, and `TABLE`: what documents say, what we guess.

Not modelled: load, torque, tracking error, brakes that close by time, the return window.
"""

from __future__ import annotations

from dataclasses import dataclass

Joints = tuple[float, ...]

MADA = (
    "KRC/R1/Mada/$machine.dat and $robcor.dat of a #KR6R900 C4SR FLR 230, KSS 8.3, in "
    "Naqiu06/KUKA-Robotics"
)
MXA = "KUKA mxAutomation Logix 1.0, p. 25"
MANUAL = "KUKA's system integrators' manual KSS 8.3, not re-read"
GUESS = "guess"

TABLE: tuple[tuple[str, str], ...] = (
    ("axis speeds, software limits, path maxima, RED_VEL_AXC, RED_ACC_AXC", MADA),
    ("RED_ACC_EMX, RED_T1, VEL_CP_T1, APO_DIS_PTP, DEF_FLT_PTP as numbers", MADA),
    ("axes are synchronous ($SYNC=1); S-shaped ramps ($ADAP_ACC=#STEP2)", MADA),
    ("$APO.CPTP is percent of half the block; a blend may start later", MXA),
    ("C_PTP suffices before a PTP; before LIN and CIRC a second word is needed", MXA),
    ("a blend's start obeys its block's $APO, its end the next block's", "robot-forum 14422"),
    ("C_DIS alone on a PTP: one $APO.CDIS for both sides", "robot-forum 14422"),
    ("a trigger's delay beyond the half block is trimmed silently", "robot-forum 34556"),
    ("DISTANCE=1 of a blended block is the middle of the arc, 0 its end", MANUAL),
    ("BRAKE keeps what is planned and goes on; the override keeps the path", MANUAL),
    ("STOP 0 leaves the path, 1 keeps it and switches off, 2 keeps it", MANUAL),
    ("BCO: first motion a slow PTP; T1 and T2 wait for a second start, EXT goes on", MANUAL),
    ("its speed and acceleration are RED_VEL_AXC and RED_ACC_AXC", GUESS),
    ("velocity and acceleration are continuous through a blend", GUESS),
    ("in a blend one block's end and the next one's beginning are added", GUESS),
    ("a blend is shortened where the sum would exceed the blocks' own limits", GUESS),
    ("between two paths the sum may be sqrt(2) of the larger $ACC.CP", GUESS),
    ("the main run enters a block in the middle (in time) of the blend before it", GUESS),
    ("a trigger's delay is real time, not scaled by the override", GUESS),
    ("a trigger's PATH lies on the block's own contour and ends with it", GUESS),
    ("C_VEL begins where the end ramp has fallen to $APO.CVEL percent", GUESS),
    ("a path whose axes would be too fast is slowed and told, not stopped", GUESS),
    ("LIN and CIRC pass A5 = 0 on the nearer branch", GUESS),
    ("LIN and CIRC turn evenly about one axis ($ORI_TYPE=#VAR)", GUESS),
    ("acceleration_deg_s2", "guess, from gear torque and inertia; MADA has no such figure"),
    ("filter_s", "guess; DEF_FLT_PTP of MADA is the number, its effect is inferred"),
    ("override_ramp_s", GUESS),
    ("brake_percent", GUESS),
    ("fast_brake_percent", "guess; RED_ACC_EMX of MADA, read as multiple of acceleration"),
    ("fast_path_percent", GUESS),
    ("coast_percent", GUESS),
    ("plan_s", GUESS),
    ("shortest_blend_s", "guess; reports of start-stop jerks at 0.013 to 0.3 deg spacing"),
    ("exact_stop_s", GUESS),
    ("t1_ptp_percent", "guess; RED_T1 of MADA is the number, its meaning is unverified"),
    ("t1_path_mm_s", "VEL_CP_T1 of MADA; other archives have 229"),
    ("bco_stops_in", "guess for AUT"),
    ("drives_off_stop", GUESS),
    ("behind an interrupt routine's own motions: back to the path like a BCO run, then on", GUESS),
    ("moving_at_override_0", GUESS),
)
"""What stands behind the motion, and its source; names are fields of `Options`."""

STEP_S = 0.004
"""Time of one step: KRC4's drives take a new value every 4 ms (RSI's fast cycle)."""

CYCLE_S = 0.012
"""The interpolation cycle, in which the interpreters work."""

SPEED_DEG_S: Joints = (360.0, 300.0, 360.0, 381.2, 388.3, 615.1)
"""Machine maxima: 6000 rpm through the gears of MADA."""

RANGE_DEG: tuple[tuple[float, float], ...] = (
    (-170.0, 170.0),
    (-190.0, 45.0),
    (-120.0, 156.0),
    (-185.0, 185.0),
    (-120.0, 120.0),
    (-350.0, 350.0),
)
"""$SOFTN_END, $SOFTP_END of MADA."""

RANGE_SLACK_DEG = 1e-6
"""Rounding by which a target may be beyond a software limit."""

RED_VEL_AXC_PERCENT: Joints = (17.0, 20.0, 17.0, 16.0, 15.0, 10.0)
RED_ACC_AXC_PERCENT: Joints = (12.0, 25.0, 10.0, 10.0, 10.0, 10.0)
"""Reduction for axis jogging and command mode, MADA; here for the block coincidence run."""

RED_ACC_EMX_PERCENT: Joints = (250.0, 220.0, 250.0, 200.0, 200.0, 200.0)
"""Factor of the path-true emergency-stop ramp, MADA, read as a multiple of normal acceleration."""

APO_DIS_PTP_DEG = 90.0
"""Largest blend distance of each axis, MADA."""

PATH_SPEED_MM_S, TURN_SPEED_DEG_S = 3000.0, 400.0
PATH_ACCELERATION_MM_S2, TURN_ACCELERATION_DEG_S2 = 10_000.0, 1000.0
"""$VEL_MA and $ACC_MA of MADA."""

SAFE_SPEED_MM_S = 250.0
"""T1: neither tool centre nor flange may be faster (ISO 10218-1, reduced speed)."""

MODES = ("T1", "T2", "AUT", "EX")


@dataclass(frozen=True)
class Options:
    """What no document at hand says; each default is a guess.

    Attributes:
        acceleration_deg_s2: axis acceleration at 100 %: 0.15 to 0.2 s to full speed, from gear
            torque over worst-case inertia with the default load.
        filter_s: how long an acceleration takes to build up, DEF_FLT_PTP of MADA; at most as long
            as the ramp without it.
        override_ramp_s: from 0 to 100 % of override; slower where an axis's acceleration asks.
        brake_percent: BRAKE and STOP 2, of normal acceleration.
        fast_brake_percent: BRAKE F and STOP 1, likewise for each axis.
        fast_path_percent: BRAKE F and STOP 1 on LIN and CIRC, of the path maximum.
        coast_percent: STOP 0, likewise; each axis by itself.
        plan_s: a block can be blended into this long after it was fed.
        shortest_blend_s: a block that takes less is not blended (three interpolation cycles).
        exact_stop_s: standstill between two blocks without a blend.
        t1_ptp_percent: axis speed of PTP in T1: $RED_T1 of MADA, whose meaning is unverified.
        t1_path_mm_s: path speed in T1: $VEL_CP_T1 of MADA; other archives say 229.
        bco_stops_in: modes in which the arm waits for a second start at the BCO point.
        drives_off_stop: stop category when the drives are switched off in motion.
        moving_at_override_0: whether `moving` stays on at override 0 ($PRO_MOVE).
    """

    acceleration_deg_s2: Joints = (2400.0, 1500.0, 2400.0, 2540.0, 2590.0, 4100.0)
    filter_s: float = 0.096
    override_ramp_s: float = 0.1
    brake_percent: float = 100.0
    fast_brake_percent: Joints = RED_ACC_EMX_PERCENT
    fast_path_percent: float = 200.0
    coast_percent: Joints = RED_ACC_EMX_PERCENT
    plan_s: float = 0.012
    shortest_blend_s: float = 0.036
    exact_stop_s: float = 0.012
    t1_ptp_percent: float = 7.0
    t1_path_mm_s: float = 100.0
    bco_stops_in: tuple[str, ...] = ("T1", "T2", "AUT")
    drives_off_stop: int = 1
    moving_at_override_0: bool = False


def beyond(joints_deg: Joints) -> int | None:
    """The first axis (from 0) outside its software limits; None when all are inside."""
    for axis in range(6):
        low, high = RANGE_DEG[axis]
        if not low - RANGE_SLACK_DEG <= joints_deg[axis] <= high + RANGE_SLACK_DEG:
            return axis
    return None
