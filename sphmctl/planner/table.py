"""A plan as the text of `plan.csv`: degrees and millimetres, one row for each sample."""

from __future__ import annotations

import numpy as np

from sphmctl.motion import Plan
from sphmctl.robots.geometry import matrix_to_abc

COLUMNS = (
    "t_s,a1_deg,a2_deg,a3_deg,a4_deg,a5_deg,a6_deg,theta7_deg,theta8_deg,theta9_deg,"
    "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,knot"
)


def plan_csv(plan: Plan) -> str:
    """Rows of time, joints, tool pose in the base, and the number, from 1, of a knot there."""
    knots = {knot.sample: str(number) for number, knot in enumerate(plan.knots, 1)}
    numbers = np.column_stack(
        [
            plan.t,
            np.degrees(plan.joints),
            plan.tool[:, :3, 3] * 1000.0,
            np.degrees(matrix_to_abc(plan.tool[:, :3, :3])),
        ]
    )
    lines = [COLUMNS]
    for row, values in enumerate(numbers.tolist()):
        cells = [f"{value + 0.0:.12g}" for value in values]
        lines.append(",".join([*cells, knots.get(row, "")]))
    return "\n".join(lines) + "\n"
