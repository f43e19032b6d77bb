"""What is done with the wrist's three free joints: policies by name, and how each is resolved."""

from sphmctl.planner.policies.kinds import (
    Auto,
    Cranks,
    Fixed,
    Known,
    Level,
    Motion,
    Policy,
    Tilt,
)
from sphmctl.planner.policies.outcome import Outcome, Reason, Resolved, Unresolved

__all__ = [
    "Auto",
    "Cranks",
    "Fixed",
    "Known",
    "Level",
    "Motion",
    "Outcome",
    "Policy",
    "Reason",
    "Resolved",
    "Tilt",
    "Unresolved",
]
