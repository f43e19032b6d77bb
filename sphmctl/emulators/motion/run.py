"""One block under way: its contour, its time law, and how it goes over into the next."""

from __future__ import annotations

from sphmctl.emulators.motion.blocks import Block, Circ, Lin, MotionError, Ptp
from sphmctl.emulators.motion.contours import (
    AxisLine,
    ToolPath,
    axis_line,
    path_rates,
    ptp_rates,
    tool_path,
)
from sphmctl.emulators.motion.figures import (
    PATH_SPEED_MM_S,
    RED_ACC_AXC_PERCENT,
    RED_VEL_AXC_PERCENT,
    SPEED_DEG_S,
    Joints,
    Options,
)
from sphmctl.emulators.motion.frames import (
    NULL_FRAME,
    Frame,
    minus,
    plus,
    reverse,
    times,
)
from sphmctl.emulators.motion.profile import Profile


class Run:
    """A planned block and where the arm is on it.

    Attributes:
        block: None for the way back to a path that a STOP 0 left.
        t_s: own time, scaled by the override.
        overlap_s: how long before its end the next block begins; 0 for an exact stop.
        head_s: the same of the block before.
        reason: why it ends in an exact stop although it should be blended; "" while it may be.
        follower: the next block, once it has begun.
        ready_s: mover's time from which a blend into this block is possible.
        bco: whether it is the block coincidence run.
        t1_share: largest override in T1.
        axis_limits: speeds and accelerations that a blend may use, deg/s and deg/s2.
        begun: whether it moves; `finished` whether its end, or the middle of its blend, is passed.
        before, behind: its neighbours in the plan.
    """

    def __init__(
        self,
        block: Block,
        contour: AxisLine | ToolPath,
        profile: Profile,
        t1_share: float,
        axis_limits: tuple[Joints, Joints],
    ) -> None:
        self.block: Block | None = block
        self.contour = contour
        self.profile = profile
        self.t1_share = t1_share
        self.t_s = 0.0
        self.overlap_s = 0.0
        self.head_s = 0.0
        self.reason = "no next block in time"
        self.follower: Run | None = None
        self.ready_s = 0.0
        self.axis_limits = axis_limits
        self.bco = False
        self.begun = False
        self.finished = False
        self.before: Run | None = None
        self.behind: Run | None = None

    @property
    def tag(self) -> int:
        """The block's tag; -1 for a way back."""
        return -1 if self.block is None else self.block.tag

    @property
    def tool(self) -> Frame:
        """The block's tool."""
        return NULL_FRAME if self.block is None else self.block.motion.tool

    @property
    def t1_cap(self) -> float:
        """Largest override in T1, with the follower's."""
        follower = self.follower
        return self.t1_share if follower is None else min(self.t1_share, follower.t1_share)

    @property
    def follows_s(self) -> float:
        """Own time at which the next block begins."""
        return self.profile.duration_s - self.overlap_s


def plan(block: Block, start_deg: Joints, options: Options, bco: bool) -> Run:
    """Plan a block from `start_deg`.

    Raises:
        MotionError: for a block that the controller refuses.
    """
    motion = block.motion
    if isinstance(motion, Ptp):
        run = _plan_ptp(block, motion, start_deg, options, bco)
    elif bco:
        raise MotionError("the first motion must be a PTP to a full position (BCO)")
    else:
        run = _plan_path(block, motion, start_deg, options)
    run.bco = bco
    return run


def way_back(start_deg: Joints, target_deg: Joints, options: Options) -> Run:
    """The motion back to the place where the path was left, at the speed of a BCO run."""
    motion = Ptp(target_deg, RED_VEL_AXC_PERCENT, RED_ACC_AXC_PERCENT)
    run = _plan_ptp(Block(-1, motion), motion, start_deg, options, False)
    run.block = None
    return run


def _plan_ptp(block: Block, motion: Ptp, start_deg: Joints, options: Options, bco: bool) -> Run:
    for name, percents in (
        ("$VEL_AXIS", motion.velocity_percent),
        ("$ACC_AXIS", motion.acceleration_percent),
    ):
        for axis, percent in enumerate(percents, start=1):
            if not 0.0 < percent <= 100.0:
                raise MotionError(f"{name}[{axis}] = {percent} is not above 0 and at most 100")
    if bco:
        motion = Ptp(
            motion.target_deg,
            tuple(map(min, motion.velocity_percent, RED_VEL_AXC_PERCENT)),
            tuple(map(min, motion.acceleration_percent, RED_ACC_AXC_PERCENT)),
        )
    line = axis_line(start_deg, motion.target_deg, options)
    profile = Profile.plan(*ptp_rates(line, motion, SPEED_DEG_S), options.filter_s)
    shares = (profile.peak * abs(way) / v for way, v in zip(line.stretch, SPEED_DEG_S, strict=True))
    fastest = max(shares)
    share = min(1.0, options.t1_ptp_percent / 100.0 / fastest) if fastest > 0.0 else 1.0
    limits = (
        _percent_of(SPEED_DEG_S, motion.velocity_percent),
        _percent_of(line.hardest, motion.acceleration_percent),
    )
    return Run(block, line, profile, share, limits)


def _plan_path(block: Block, motion: Lin | Circ, start_deg: Joints, options: Options) -> Run:
    speed = motion.speed
    for name, value in vars(speed).items():
        if not value > 0.0:
            raise MotionError(f"{name} = {value} is not above 0")
    if speed.vel_cp_m_s * 1e3 > PATH_SPEED_MM_S:
        raise MotionError(f"$VEL.CP = {speed.vel_cp_m_s} m/s is above {PATH_SPEED_MM_S / 1e3}")
    path = tool_path(start_deg, motion)
    profile = Profile.plan(*path_rates(path, speed), options.filter_s)
    fastest = profile.peak * path.length_mm
    share = min(1.0, options.t1_path_mm_s / fastest) if fastest > 0.0 else 1.0
    return Run(block, path, profile, share, (SPEED_DEG_S, options.acceleration_deg_s2))


def _percent_of(maxima: Joints, percent: Joints) -> Joints:
    return tuple([most * share / 100.0 for most, share in zip(maxima, percent, strict=True)])


def joints_at(run: Run, t_s: float, near_deg: Joints) -> Joints:
    """The axes at `t_s` of a run, with what its follower adds.

    Two PTP, or PTP and a path, are added in axis space; two paths with the same frames as tool
    centre and turn.
    """
    way = run.profile.at(t_s)[0]
    follower = run.follower
    first = run.contour
    if follower is None:
        return first.joints(way, near_deg)
    second = follower.contour
    after = follower.profile.at(t_s - run.follows_s)[0]
    if isinstance(first, AxisLine) and isinstance(second, AxisLine):
        d = second.stretch
        return tuple([q + d[i] * after for i, q in enumerate(first.joints(way, near_deg))])
    if (
        isinstance(first, ToolPath)
        and isinstance(second, ToolPath)
        and first.frames == second.frames
    ):
        place = plus(first.place(way), minus(second.place(after), second.start[0]))
        turn = times(times(second.turn(after), reverse(second.start[1])), first.turn(way))
        return first.axes(place, turn, near_deg)
    knot = second.start_deg
    begun, beyond = first.joints(way, near_deg), second.joints(after, near_deg)
    return tuple([begun[i] + beyond[i] - knot[i] for i in range(6)])
