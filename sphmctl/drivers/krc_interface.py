"""Names and numbers of the KRL program's interface; firmware/krc/INTERFACE.md defines them.

They stand in INTERFACE.md, here, and in sph_run.dat; a test compares the three.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType

VERSION = 3
"""Version of the interface that this driver speaks."""

RING = 64
"""Slots of the ring of knots."""

LATE_MS = 120
"""A heartbeat unchanged for longer holds the arm, ms."""

LOST_MS = 1000
"""A heartbeat unchanged for longer ends the motion, ms."""


CYCLE_S = 0.012
"""Interpolation cycle of a KRC4, at which the state structure is refreshed."""


class Command(IntEnum):
    """What the daemon writes to SPH_CMD."""

    IDLE = 0
    RUN = 1
    HOLD = 2
    STOP = 3


class Status(IntEnum):
    """What the program is doing."""

    IDLE = 0
    READY = 1
    RUNNING = 2
    HOLDING = 3
    STOPPED = 4
    ENDED = 5
    FAULT = 6


class Fault(IntEnum):
    """Why the program ended a motion by itself."""

    NONE = 0
    BEAT = 1
    SEQUENCE = 2
    KNOT = 3
    CONTROLLER = 4
    WRIST = 5
    SUBMIT = 6


class Wrist(IntEnum):
    """The input "wrist ok"."""

    NONE = 0
    OFF = 1
    ON = 2


KNOT = "SPH_KNOT"
WRITTEN = "SPH_WR"
LAST = "SPH_LAST"
COMMAND = "SPH_CMD"
SESSION = "SPH_SESSION"
BEAT = "SPH_BEAT"
STATE = "SPH_STATE"

KNOT_TYPE = "SPH_KNOT_T"
STATE_TYPE = "SPH_STATE_T"

VARIABLES: Mapping[str, str] = MappingProxyType(
    {
        KNOT: f"{KNOT_TYPE}[{RING}]",
        WRITTEN: "INT",
        LAST: "INT",
        COMMAND: "INT",
        SESSION: "INT",
        BEAT: "INT",
        STATE: STATE_TYPE,
    }
)
"""Each variable with its KRL type."""

KNOT_FIELDS: Mapping[str, str] = MappingProxyType(
    {"SEQ": "INT", "VEL": "REAL", "ACC": "REAL", "Q": "E6AXIS"}
)
"""The fields of a knot in order, each with its KRL type."""

STATE_FIELDS: Mapping[str, str] = MappingProxyType(
    {
        "VERSION": "INT",
        "CHECK": "INT",
        "SESSION": "INT",
        "STATUS": "INT",
        "FAULT": "INT",
        "WRIST": "INT",
        "RD": "INT",
        "DONE": "INT",
        "BEAT": "INT",
        "TIME": "INT",
        "OV": "INT",
        "MOVING": "BOOL",
        "STOPPED": "BOOL",
        "DRIVES": "BOOL",
        "SAFE": "BOOL",
        "STOPMESS": "BOOL",
        "MODE": "MODE_OP",
        "Q": "E6AXIS",
    }
)
"""The fields of the state in order, each with its KRL type."""


NUMBERS: Mapping[str, int] = MappingProxyType(
    {"VERSION": VERSION, "RING": RING, "LATE_MS": LATE_MS, "LOST_MS": LOST_MS}
    | {
        f"{prefix}_{member.name}": member.value
        for prefix, members in (
            ("CMD", Command),
            ("STATUS", Status),
            ("FAULT", Fault),
            ("WRIST", Wrist),
        )
        for member in members
    }
)
"""The numbers of the interface, in the order of INTERFACE.md."""


def checksum(
    numbers: Mapping[str, int], variables: Mapping[str, str], *structures: Mapping[str, str]
) -> int:
    """The interface in one number, as INTERFACE.md, "Checksum", says."""
    lines = [f"{name}={value}" for name, value in numbers.items()]
    for table in (variables, *structures):
        lines += [f"{name}:{kind}" for name, kind in table.items()]
    # A KRL INT has 31 bits beside the sign.
    return zlib.crc32("\n".join(lines).encode("ascii")) & 0x7FFFFFFF


CHECK = checksum(NUMBERS, VARIABLES, KNOT_FIELDS, STATE_FIELDS)
"""Checksum of the interface that this driver speaks."""

OUTPUT_KNOT, OUTPUT_MOVING, INPUT_OK = "SPH_OUT_KNOT", "SPH_OUT_MOVING", "SPH_IN_OK"
"""Where the lines to a board are, as numbers of $OUT and $IN; 0: not connected."""
