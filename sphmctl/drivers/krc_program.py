"""The robot program's files, and where a cell's lines to its board go in them.

Text in, text out; what the program does is firmware/krc/INTERFACE.md's.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sphmctl.drivers import krc_interface as krc
from sphmctl.errors import InvalidError

FILES = ("sph_run.src", "sph_run.dat", "sph_sps.src")

ALWAYS_TRUE = 1025
"""Number of the input that is TRUE on a KRC4 whatever is wired (machine data of a KSS 8.3 archive,
Naqiu06/KUKA-Robotics, KRC/R1/Mada/$machine.dat)."""

_PACKAGE = Path(__file__).parents[1]

FOLDERS = (_PACKAGE / "krc", _PACKAGE.parent / "firmware" / "krc")
"""Where the files are in a wheel, and in the source tree."""


@dataclass(frozen=True)
class LineNumbers:
    """Where the lines are wired: $IN of "wrist ok", $OUT of "knot" and of "arm moving"."""

    wrist_ok: int
    knot: int
    arm_moving: int


def program_folder() -> Path:
    """Where the shipped files are.

    Raises:
        InvalidError: this installation has none.
    """
    for folder in FOLDERS:
        if all((folder / name).is_file() for name in FILES):
            return folder
    raise InvalidError(f"{', '.join(FILES)} are not there; install sphmctl anew", str(FOLDERS[0]))


def program_texts(lines: LineNumbers | None) -> dict[str, str]:
    """The files by name, with the lines where `lines` says, or off.

    Raises:
        InvalidError: the shipped files are missing, or do not name a line exactly once.
    """
    folder = program_folder()
    texts = {name: (folder / name).read_text(encoding="ascii") for name in FILES}
    numbers = line_numbers(lines)
    data = texts["sph_run.dat"]
    for variable, number in numbers.items():
        data = _put(data, rf"(?m)^(DECL GLOBAL INT {variable}=)\d+$", rf"\g<1>{number}", variable)
    wired = numbers[krc.INPUT_OK] or ALWAYS_TRUE
    data = _put(data, r"(?m)^(GLOBAL SIGNAL SPH_OK \$IN)\[\d+\]$", rf"\g<1>[{wired}]", "SPH_OK")
    return texts | {"sph_run.dat": data}


def line_numbers(lines: LineNumbers | None) -> Mapping[str, int]:
    """What the controller's variables say of the lines; 0: not connected."""
    if lines is None:
        return {krc.INPUT_OK: 0, krc.OUTPUT_KNOT: 0, krc.OUTPUT_MOVING: 0}
    return {
        krc.INPUT_OK: lines.wrist_ok,
        krc.OUTPUT_KNOT: lines.knot,
        krc.OUTPUT_MOVING: lines.arm_moving,
    }


def _put(text: str, pattern: str, new: str, name: str) -> str:
    changed, count = re.subn(pattern, new, text)
    if count != 1:
        raise InvalidError(f"sph_run.dat declares {name} {count} times; install sphmctl anew", name)
    return changed
