"""The path file's keys and what their values may be; raises through pydantic, with places."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, TypeAlias

from pydantic import BaseModel, BeforeValidator, Field, model_validator

from sphmctl.pathfile.fields import (
    NAME,
    Blend,
    Cranks,
    Direction,
    Heave,
    Joints,
    Name,
    Pitch,
    Tilt,
    Turn,
    Xyz,
    as_base,
    as_place,
    as_policy,
    as_rule,
    as_span,
    as_target,
    check_point,
)
from sphmctl.pathfile.model import Kind, Rule, Speed, Surface
from sphmctl.yamlfile import (
    STRICT,
    Pose,
    Version,
    nearest,
    shown,
    wrong,
)

POLICIES = ("cranks", "fixed", "level", "tilt", "motion", "auto")
"""Wrist policies."""

DWELL_LIMIT_S = 3600.0
"""One hour; a longer rest is two runs."""

KINDS: tuple[Kind, ...] = ("ptp", "lin", "arc", "circle", "helix", "spline", "polyline", "dwell_s")

BESIDE = ("speed", "wrist", "orientation", "blend_mm")
"""Keys that may stand inside a move's braces or beside them."""


class SpeedModel(BaseModel):
    """`speed: {...}`."""

    model_config = STRICT
    tcp_mm_s: Annotated[float, Field(ge=0.1, le=10_000)] | None = None
    tcp_mm_s2: Annotated[float, Field(ge=1, le=100_000)] | None = None
    joint_percent: Annotated[float, Field(ge=0.1, le=100)] | None = None
    joint_acceleration_percent: Annotated[float, Field(ge=0.1, le=100)] | None = None

    def over(self, speed: Speed) -> Speed:
        """`speed` with what is given here in its place."""
        return replace(speed, **self.model_dump(exclude_none=True))


class WristModel(BaseModel):
    """`wrist: level` or `wrist: {...}`."""

    model_config = STRICT
    policy: str = "motion"
    cranks_deg: Cranks | None = None
    heave_mm: Annotated[tuple[Heave, Heave], BeforeValidator(as_span)] | None = None
    tilt_deg: Annotated[tuple[Tilt, Tilt], BeforeValidator(as_span)] | None = None
    tilt_turns: Annotated[float, Field(ge=-100, le=100)] | None = None
    tilt_towards_deg: Annotated[float, Field(ge=-360, le=360)] | None = None

    @model_validator(mode="after")
    def _check(self) -> WristModel:
        known = "available are " + ", ".join(POLICIES)
        if self.policy not in POLICIES:
            hint = nearest(self.policy, POLICIES)
            raise wrong(f"{shown(self.policy)} is no wrist policy{hint}; {known}")
        if self.cranks_deg is not None and self.policy != "fixed":
            raise wrong("only the policy 'fixed' takes 'cranks_deg'", "cranks_deg")
        if self.heave_mm is not None and self.policy not in ("level", "motion"):
            raise wrong("only the policies 'level' and 'motion' take 'heave_mm'", "heave_mm")
        for key in ("tilt_deg", "tilt_turns", "tilt_towards_deg"):
            if getattr(self, key) is not None and self.policy != "motion":
                raise wrong(f"the policy '{self.policy}' takes no '{key}'; leave 'policy' out", key)
        if self.policy == "motion" and (self.heave_mm is None or self.tilt_deg is None):
            raise wrong("a wrist motion needs 'heave_mm' and 'tilt_deg'; or name a policy")
        return self


Policy: TypeAlias = Annotated[WristModel, BeforeValidator(as_policy)]


class OrientationModel(BaseModel):
    """`orientation: tangent` or `orientation: {normal_to: sphere, centre: [...]}`."""

    model_config = STRICT
    rule: Annotated[str | None, Field(exclude=True)] = None
    normal_to: Surface | None = None
    centre: Xyz | None = None
    axis: Direction | None = None
    normal: Direction | None = None
    inside: bool | None = None

    @model_validator(mode="after")
    def _check(self) -> OrientationModel:
        rules = ("fixed", "interpolated", "tangent")
        if self.rule is not None:
            if self.rule not in rules:
                hint = nearest(self.rule, rules) or f"; known are {', '.join(rules)}"
                raise wrong(f"{shown(self.rule)} is no rule for the orientation{hint}")
            return self
        needed = {"plane": ("normal",), "cylinder": ("centre", "axis"), "sphere": ("centre",)}
        if self.normal_to is None:
            raise wrong("give 'normal_to': plane, cylinder or sphere")
        for key in ("centre", "axis", "normal"):
            if (getattr(self, key) is not None) != (key in needed[self.normal_to]):
                verb = "needs" if key in needed[self.normal_to] else "takes no"
                raise wrong(f"a {self.normal_to} {verb} '{key}'", key)
        if self.inside is not None and self.normal_to == "plane":
            raise wrong("a plane has no inside; turn its normal round", "inside")
        return self

    @property
    def named(self) -> Rule:
        """The rule."""
        names: tuple[Rule, ...] = ("fixed", "interpolated", "tangent")
        return next((name for name in names if name == self.rule), "normal_to")


Orienting: TypeAlias = Annotated[OrientationModel, BeforeValidator(as_rule)]


class PointModel(BaseModel):
    """A named point."""

    model_config = STRICT
    pose: Pose | None = None
    joints_deg: Joints | None = None
    cranks_deg: Cranks | None = None

    @model_validator(mode="after")
    def _check(self) -> PointModel:
        check_point(self.pose, self.joints_deg, self.cranks_deg)
        return self


class PlaceModel(BaseModel):
    """A point inside a move: a name, a list of numbers, or as a named point."""

    model_config = STRICT
    point: Annotated[str | None, Field(exclude=True)] = None
    xyz_mm: Annotated[Xyz | None, Field(exclude=True)] = None
    pose: Pose | None = None
    joints_deg: Joints | None = None
    cranks_deg: Cranks | None = None

    @model_validator(mode="after")
    def _check(self) -> PlaceModel:
        if self.point is None and self.xyz_mm is None:
            check_point(self.pose, self.joints_deg, self.cranks_deg)
        return self


Place: TypeAlias = Annotated[PlaceModel, BeforeValidator(as_place)]


class _InsideModel(BaseModel):
    """What every move may carry inside its braces."""

    model_config = STRICT
    speed: SpeedModel | None = None
    wrist: Policy | None = None


class TargetModel(_InsideModel):
    """`ptp: ...` and `lin: ...`."""

    point: Annotated[str | None, Field(exclude=True)] = None
    pose: Pose | None = None
    joints_deg: Joints | None = None
    cranks_deg: Cranks | None = None
    orientation: Orienting | None = None
    blend_mm: Blend | None = None

    @model_validator(mode="after")
    def _check(self) -> TargetModel:
        if self.point is None:
            check_point(self.pose, self.joints_deg, self.cranks_deg)
        return self


Target: TypeAlias = Annotated[TargetModel, BeforeValidator(as_target)]


class _DrawnModel(_InsideModel):
    """What moves along a path may carry too."""

    orientation: Orienting | None = None
    blend_mm: Blend | None = None


class ArcModel(_DrawnModel):
    """`arc: {via: ..., to: ...}`."""

    via: Place
    to: Place


class CircleModel(_DrawnModel):
    """`circle: {via: [..., ...]}` or `circle: {centre: ..., normal: ..., turn_deg: ...}`."""

    via: tuple[Place, Place] | None = None
    centre: Place | None = None
    normal: Direction | None = None
    turn_deg: Turn | None = None

    @model_validator(mode="after")
    def _check(self) -> CircleModel:
        for key in ("centre", "normal"):
            if (getattr(self, key) is None) != (self.via is not None):
                raise wrong("give a circle either 'via: [P, Q]', or 'centre' and 'normal'")
        if self.via is not None and self.turn_deg is not None:
            raise wrong("a circle through points is a full one; leave this out", "turn_deg")
        return self


class HelixModel(_DrawnModel):
    """`helix: {centre: ..., normal: ..., turn_deg: ..., pitch_mm: ...}`."""

    centre: Place
    normal: Direction
    turn_deg: Turn
    pitch_mm: Pitch


class SplineModel(_DrawnModel):
    """`spline: {through: [...], closed: true}`."""

    through: Annotated[tuple[Place, ...], Field(min_length=1)]
    closed: bool = False

    @model_validator(mode="after")
    def _check(self) -> SplineModel:
        if self.closed and len(self.through) < 2:
            raise wrong("a closed spline needs at least two points besides the present one")
        return self


class PolylineModel(_DrawnModel):
    """`polyline: {csv: FILE}`."""

    csv: Annotated[str, Field(min_length=1)]


class MoveModel(BaseModel):
    """One item of `moves`."""

    model_config = STRICT
    ptp: Target | None = None
    lin: Target | None = None
    arc: ArcModel | None = None
    circle: CircleModel | None = None
    helix: HelixModel | None = None
    spline: SplineModel | None = None
    polyline: PolylineModel | None = None
    dwell_s: Annotated[float, Field(gt=0, le=DWELL_LIMIT_S)] | None = None
    speed: SpeedModel | None = None
    wrist: Policy | None = None
    orientation: Orienting | None = None
    blend_mm: Blend | None = None

    @model_validator(mode="after")
    def _check(self) -> MoveModel:
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(kinds) != 1:
            named = ", ".join(f"'{kind}: ...'" for kind in KINDS[:-1])
            raise wrong(f"a move is one of {named} or '{KINDS[-1]}: ...'")
        if self.dwell_s is not None and (self.speed or self.wrist):
            raise wrong("a rest takes neither 'speed' nor 'wrist'")
        inside = getattr(self, kinds[0])
        for key in BESIDE:
            if getattr(self, key) is not None and getattr(inside, key, None) is not None:
                raise wrong(f"'{key}' is given twice: inside the point and beside it", key)
        if kinds[0] in ("ptp", "dwell_s"):
            for key in ("orientation", "blend_mm"):
                if self.beside(key) is not None:
                    raise wrong(f"'{key}' is for moves along a path; '{kinds[0]}' takes none", key)
        return self

    @property
    def kind(self) -> Kind:
        """Which of KINDS it is."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    def beside(self, key: str) -> Any:
        """One of BESIDE, from wherever it stands."""
        own = getattr(self, key)
        return own if own is not None else getattr(getattr(self, self.kind), key, None)


class PathModel(BaseModel):
    """The whole file."""

    model_config = STRICT
    version: Version
    name: Name
    tool: str | None = None
    base: Annotated[Any, BeforeValidator(as_base)] = "world"
    speed: SpeedModel = SpeedModel()
    wrist: Policy = WristModel(policy="cranks")
    orientation: Orienting = OrientationModel(rule="interpolated")
    points: dict[str, PointModel] = {}
    moves: Annotated[tuple[MoveModel, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> PathModel:
        for name in self.points:
            if not NAME.fullmatch(name):
                raise wrong(f"{shown(name)} is no name for a point", "points", name)
        if self.moves[0].ptp is None:
            raise wrong("a path begins with 'ptp: ...' to its start", "moves", 0)
        for index, (move, following) in enumerate(
            zip(self.moves, (*self.moves[1:], None), strict=True)
        ):
            drawn = following is not None and following.kind not in ("ptp", "dwell_s")
            if move.beside("blend_mm") is not None and not drawn:
                raise wrong(
                    "a corner is blended into the next move along a path, and none follows; "
                    "leave 'blend_mm' out",
                    "moves",
                    index,
                )
        return self
