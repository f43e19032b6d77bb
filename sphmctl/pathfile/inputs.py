"""What a path was read from, as files that a run's folder keeps."""

from __future__ import annotations

import os
from pathlib import Path as FilePath
from pathlib import PurePath

from sphmctl.errors import InvalidError
from sphmctl.pathfile.model import Path, Polyline

PATH_FILE = "path.yaml"


def inputs(path: Path) -> dict[str, bytes]:
    """The path file as `path.yaml`, and the tables of its polylines under the names it gives them.

    A table from elsewhere than below the path file's folder goes by its last name.

    Raises:
        InvalidError: a file cannot be read any more.
    """
    return {name: _read(file) for name, file in sources(path).items()}


def sources(path: Path) -> dict[str, FilePath]:
    """The same files, by the same names."""
    home = FilePath(path.file).parent
    files = {PATH_FILE: FilePath(path.file)}
    for move in path.moves:
        if isinstance(move.course, Polyline):
            name = os.path.relpath(move.course.file, home)
            files[PurePath(name).name if name.startswith("..") else name] = FilePath(
                move.course.file
            )
    return files


def _read(file: FilePath) -> bytes:
    try:
        return file.read_bytes()
    except OSError as problem:
        raise InvalidError(f"the file cannot be read: {problem.strerror}", str(file)) from None
