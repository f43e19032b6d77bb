"""The cell file's part on what stands around the robot, and what hangs on its platform.

Millimetres as in the file; `bodies` and `on_platform` are SI.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import AfterValidator, BaseModel, Field, model_validator

from sphmctl.robots.geometry import pose_matrix
from sphmctl.robots.sphm.bodies import Box, Obstacle, Plane
from sphmctl.robots.sphm.load import Payload
from sphmctl.yamlfile import POSITION_LIMIT_MM, STRICT, Numbers, Pose, check_numbers, wrong

PAYLOAD_KG = 0.05
PAYLOAD_CENTRE_MM: Numbers = (0.0, 0.0, 30.0)
"""When the cell does not say: a guess, a pen with its holder, its centre half-way up the pen."""

LARGEST_PAYLOAD_KG = 6.0
"""What a KR 6 carries at most; more is a slip of the unit."""


def _check_size(values: Numbers) -> Numbers:
    check_numbers(values, 3, "the box's size along x, y, z in mm", POSITION_LIMIT_MM)
    for index, value in enumerate(values):
        if value <= 0.0:
            raise wrong(f"{value:g} is no size; give more than 0", index)
    return values


def _check_point(values: Numbers) -> Numbers:
    return check_numbers(values, 3, "x, y, z in mm", POSITION_LIMIT_MM)


def _check_normal(values: Numbers) -> Numbers:
    check_numbers(values, 3, "the direction x, y, z", POSITION_LIMIT_MM)
    if not any(values):
        raise wrong("[0, 0, 0] is no direction; up is [0, 0, 1]")
    return values


class BoxObstacle(BaseModel):
    """Something that stands in the cell: a box by its size and the pose of its centre."""

    model_config = STRICT
    size_mm: Annotated[Numbers, AfterValidator(_check_size)]
    pose: Pose = (0.0,) * 6


class PlaneObstacle(BaseModel):
    """A floor or wall: a point on it, and the direction away from it into the free room."""

    model_config = STRICT
    point_mm: Annotated[Numbers, AfterValidator(_check_point)]
    normal: Annotated[Numbers, AfterValidator(_check_normal)]


class Obstacles(BaseModel):
    """What the robot must not touch, by name, in the arm's base frame."""

    model_config = STRICT
    boxes: dict[str, BoxObstacle] = {}
    planes: dict[str, PlaneObstacle] = {}

    @model_validator(mode="after")
    def _check(self) -> Obstacles:
        for name in self.planes:
            if name in self.boxes:
                raise wrong(f"the name '{name}' is taken by a box; give another", "planes", name)
        return self

    def bodies(self) -> tuple[Obstacle, ...]:
        """Boxes, then planes, m."""
        boxes = [
            Box(
                name,
                pose_matrix(np.array(box.pose[:3]) / 1000.0, np.radians(box.pose[3:])),
                np.array(box.size_mm) / 2000.0,
            )
            for name, box in self.boxes.items()
        ]
        planes = [
            Plane(
                name,
                np.array(plane.point_mm) / 1000.0,
                np.array(plane.normal) / np.linalg.norm(plane.normal),
            )
            for name, plane in self.planes.items()
        ]
        return (*boxes, *planes)


class CellPayload(BaseModel):
    """What hangs on the platform: mass, and its centre on the platform's frame."""

    model_config = STRICT
    mass_kg: Annotated[float, Field(ge=0, le=LARGEST_PAYLOAD_KG)] = PAYLOAD_KG
    centre_mm: Annotated[Numbers, AfterValidator(_check_point)] = PAYLOAD_CENTRE_MM

    def on_platform(self) -> Payload:
        """The same in metres."""
        x, y, z = self.centre_mm
        return Payload(self.mass_kg, (x / 1000.0, y / 1000.0, z / 1000.0))
