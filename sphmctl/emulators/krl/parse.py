"""A KRL file or text to its tree."""

from __future__ import annotations

from pathlib import Path

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.blocks import read_data_list, read_program
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl.source import read_text, split

SUFFIXES = (".src", ".dat", ".sub")


def parse(text: str, file: str) -> n.Module:
    """The tree of a module's text; the suffix of `file` says which kind it is.

    Raises:
        KrlError: with everything that is wrong in it.
    """
    suffix = Path(file).suffix.lower()
    if suffix not in SUFFIXES:
        raise fail(n.Place(file, 1), "file", "a KRL file is a .src, .dat or .sub")
    source = split(text, file)
    if suffix == ".dat":
        return read_data_list(source)
    return read_program(source, suffix[1:])


def read(path: Path) -> n.Module:
    """The tree of a file.

    Raises:
        KrlError: with everything that is wrong in it.
        OSError: it cannot be read.
    """
    return parse(read_text(path), str(path))
