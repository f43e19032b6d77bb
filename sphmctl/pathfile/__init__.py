"""The path file: named points and moves, still in millimetres and degrees; knows no robot."""

from sphmctl.pathfile.inputs import inputs, sources
from sphmctl.pathfile.model import (
    Arc,
    Circle,
    Helix,
    Move,
    Orientation,
    Path,
    Point,
    Polyline,
    Speed,
    Spline,
    Wrist,
)
from sphmctl.pathfile.read import load_path

__all__ = [
    "Arc",
    "Circle",
    "Helix",
    "Move",
    "Orientation",
    "Path",
    "Point",
    "Polyline",
    "Speed",
    "Spline",
    "Wrist",
    "inputs",
    "load_path",
    "sources",
]
