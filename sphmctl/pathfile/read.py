"""Reads a path file: names become points, what a move leaves out comes from the path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath

from sphmctl.errors import InvalidError
from sphmctl.pathfile.model import (
    Arc,
    Circle,
    Course,
    Helix,
    Kind,
    Move,
    Orientation,
    Path,
    Point,
    Speed,
    Spline,
    Wrist,
)
from sphmctl.pathfile.schema import (
    ArcModel,
    CircleModel,
    HelixModel,
    MoveModel,
    OrientationModel,
    PathModel,
    PlaceModel,
    PolylineModel,
    SplineModel,
    TargetModel,
    WristModel,
)
from sphmctl.pathfile.table import read_polyline
from sphmctl.yamlfile import Document, Loc, load, nearest, shown


def load_path(path: str | FilePath) -> Path:
    """Read a path file, and the CSV files that it names.

    Raises:
        InvalidError: with file, line, column, field, value and what would be right.
    """
    model, document = load(path, PathModel)
    points = {
        name: Point(name, item.pose, item.joints_deg, item.cranks_deg)
        for name, item in model.points.items()
    }
    reader = _Reader(document, model, points)
    return Path(
        model.name,
        model.tool,
        model.base,
        tuple(reader.move(index, item) for index, item in enumerate(model.moves)),
        points,
        document.file,
        document.line(("tool",)),
        document.line(("base",)),
    )


@dataclass(frozen=True)
class _Reader:
    """Turns the models of one file into its moves."""

    document: Document
    model: PathModel
    points: dict[str, Point]

    def move(self, index: int, item: MoveModel) -> Move:
        """The move at `index`."""
        kind: Kind = item.kind
        loc: Loc = ("moves", index, kind)
        line, column = self.document.values["moves", index]
        speed = self.model.speed.over(Speed())
        if item.dwell_s is not None:
            return Move(index + 1, line, kind, None, item.dwell_s, speed, Wrist(), column=column)
        own_speed = item.beside("speed")
        wrist = _wrist(item.beside("wrist") or self.model.wrist)
        course, point = self._course(loc, item, wrist)
        return Move(
            index + 1,
            line,
            kind,
            point,
            0.0,
            own_speed.over(speed) if own_speed else speed,
            wrist,
            course,
            _orientation(item.beside("orientation") or self.model.orientation),
            item.beside("blend_mm") or 0.0,
            column,
        )

    def _course(
        self, loc: Loc, item: MoveModel, wrist: Wrist
    ) -> tuple[Course | None, Point | None]:
        """The way of a move, and the point at its end."""
        match item.ptp or item.lin or item.arc or item.circle or item.helix or item.spline:
            case TargetModel() as target:
                return None, self._stop(loc, target, wrist)
            case ArcModel() as arc:
                via = self._point((*loc, "via"), arc.via)
                return Arc(via), self._stop((*loc, "to"), arc.to, wrist)
            case CircleModel(via=(one, two)):
                places = [self._point((*loc, "via", i), item) for i, item in enumerate((one, two))]
                return Circle((places[0], places[1])), None
            case CircleModel(centre=PlaceModel() as centre, normal=tuple() as normal) as circle:
                turn = 360.0 if circle.turn_deg is None else circle.turn_deg
                return Helix(self._point((*loc, "centre"), centre), normal, turn), None
            case HelixModel() as helix:
                middle = self._point((*loc, "centre"), helix.centre)
                return Helix(middle, helix.normal, helix.turn_deg, helix.pitch_mm), None
            case SplineModel() as spline:
                through = tuple(
                    self._stop((*loc, "through", i), place, wrist)
                    for i, place in enumerate(spline.through)
                )
                return Spline(through, spline.closed), None if spline.closed else through[-1]
        assert item.polyline is not None  # the model checked that it is one of these
        return self._polyline(loc, item.polyline, wrist), None

    def _stop(self, loc: Loc, item: TargetModel | PlaceModel, wrist: Wrist) -> Point:
        """A point at which the cranks must be known."""
        point = self._point(loc, item)
        known = point.cranks_deg is not None or point.joints_deg is not None
        if wrist.policy == "cranks" and not known:
            raise self.document.error(
                loc,
                "the wrist policy 'cranks' needs 'cranks_deg' at this point, or choose another",
            )
        return point

    def _point(self, loc: Loc, item: TargetModel | PlaceModel) -> Point:
        if item.point is None:
            xyz = item.xyz_mm if isinstance(item, PlaceModel) else None
            return Point("", item.pose, item.joints_deg, item.cranks_deg, xyz)
        if item.point not in self.points:
            known = tuple(self.points)
            hint = nearest(item.point, known) or f"; known are {', '.join(known) or 'none'}"
            raise self.document.error(loc, f"there is no point {shown(item.point)}{hint}")
        return self.points[item.point]

    def _polyline(self, loc: Loc, item: PolylineModel, wrist: Wrist) -> Course:
        file = FilePath(self.document.file).parent / item.csv
        try:
            return read_polyline(str(file), wrist.policy == "cranks")
        except InvalidError as problem:
            if problem.where == str(file):  # about the file as a whole
                told = f"{file}: {problem.message}"
                raise self.document.error((*loc, "csv"), told) from None
            raise


def _wrist(model: WristModel) -> Wrist:
    return Wrist(
        model.policy,
        model.cranks_deg,
        model.heave_mm,
        model.tilt_deg or (0.0, 0.0),
        model.tilt_turns or 0.0,
        model.tilt_towards_deg or 0.0,
    )


def _orientation(model: OrientationModel) -> Orientation:
    default = Orientation()
    return Orientation(
        model.named,
        model.normal_to or default.surface,
        model.centre or default.centre_mm,
        model.axis or model.normal or default.axis,
        bool(model.inside),
    )
