"""How the emulated KRC4 moves its arm: blocks in, axes over time out. No KRL text.

`Mover` is the whole of it; `figures` holds the numbers and says which are guesses.
"""

from sphmctl.emulators.motion.blocks import (
    Apo,
    AxisLimitError,
    Block,
    Circ,
    Event,
    Kind,
    Lin,
    MotionError,
    PathSpeed,
    Ptp,
    Trigger,
)
from sphmctl.emulators.motion.figures import Options
from sphmctl.emulators.motion.mover import Mover

__all__ = [
    "Apo",
    "AxisLimitError",
    "Block",
    "Circ",
    "Event",
    "Kind",
    "Lin",
    "MotionError",
    "Mover",
    "Options",
    "PathSpeed",
    "Ptp",
    "Trigger",
]
