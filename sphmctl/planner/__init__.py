"""From a path to a plan, before anything moves; pure computation, no I/O."""

from sphmctl.planner.approach import approach
from sphmctl.planner.plan import TIMINGS, outcome, plan
from sphmctl.planner.report import CheckReport, Margin, check
from sphmctl.planner.table import plan_csv

__all__ = [
    "TIMINGS",
    "CheckReport",
    "Margin",
    "approach",
    "check",
    "outcome",
    "plan",
    "plan_csv",
]
