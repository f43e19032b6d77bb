"""The files on the emulated controller: ours as they are shipped, and the submit interpreter's."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from sphmctl.emulators.interpreter import submit_program
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.parse import parse, read
from sphmctl.emulators.krl.source import read_text

_IN_WHEEL = Path(__file__).parents[1] / "krc"

SHIPPED = _IN_WHEEL if _IN_WHEEL.is_dir() else Path(__file__).parents[2] / "firmware" / "krc"
"""The very files that are copied onto a controller; a wheel carries them inside the package."""

OURS = "SPH_RUN"

IDLE = """DEF {name}()
LOOP
  WAIT SEC 0.1
ENDLOOP
END
"""
"""A program of somebody else's, which never moves."""


@dataclass(frozen=True)
class Numbers:
    """I/O numbers of the lines to a board: $IN of "wrist ok", $OUT of "knot" and "arm moving"."""

    ok: int
    knot: int
    moving: int


@lru_cache(maxsize=16)
def controller_files(
    program: str, version: int | None = None, installed: bool = True, lines: Numbers | None = None
) -> tuple[n.Module, ...]:
    """The modules of a controller.

    Args:
        program: the one to be selected; where it is not ours, an idle one of that name.
        version: what our program is made to say of itself; None leaves the files as they are.
        installed: whether our files are there.
        lines: where the operator has connected the lines to a board; None leaves them off.

    Raises:
        KrlError: a file is no KRL.
        OSError: a file cannot be read.
    """
    found: list[n.Module] = []
    if installed:
        paths = sorted([*SHIPPED.glob("*.src"), *SHIPPED.glob("*.dat")])
        found += [parse(_changed(read_text(path), version, lines), str(path)) for path in paths]
        found.append(submit_program(["SPH_SPS_INIT()"], ["SPH_SPS()"]))
    else:
        found.append(submit_program([], []))
    if program != OURS or not installed:
        found.append(parse(IDLE.format(name=program), f"{program.lower()}.src"))
    return tuple(found)


def with_files(modules: Iterable[n.Module], paths: Iterable[Path]) -> tuple[n.Module, ...]:
    """Modules beside which files were copied: a file takes the place of a module of its name.

    Raises:
        KrlError: a file is no KRL.
        OSError: a file cannot be read.
    """
    copied = [read(path) for path in paths]
    places = {(type(module), module.name) for module in copied}
    kept = (module for module in modules if (type(module), module.name) not in places)
    return (*kept, *copied)


def _changed(text: str, version: int | None, lines: Numbers | None) -> str:
    if version is not None:
        text = re.sub(r"(INT SPH_VERSION=)\d+", rf"\g<1>{version}", text)
    if lines is not None:
        text = re.sub(r"(SIGNAL SPH_OK \$IN)\[\d+\]", rf"\g<1>[{lines.ok}]", text)
        numbers = {"IN_OK": lines.ok, "OUT_KNOT": lines.knot, "OUT_MOVING": lines.moving}
        for name, number in numbers.items():
            text = re.sub(rf"(INT SPH_{name}=)\d+", rf"\g<1>{number}", text)
    return text
