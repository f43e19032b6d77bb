"""KRL files and folders to the modules that belong together, and what is found in them.

Not responsible for any rule of KRL. The other KRL files of a folder are read as well, since a
controller knows their global names: what is wrong in them is not told, but for a data list beside
its program.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from sphmctl.emulators.krl.check import check
from sphmctl.emulators.krl.findings import Finding, KrlError
from sphmctl.emulators.krl.nodes import Module
from sphmctl.emulators.krl.parse import SUFFIXES, read

MAX_FILES = 2000
"""Of one check: several whole controllers."""


@dataclass(frozen=True)
class Checked:
    """What a check looked at, and what it found."""

    files: tuple[Path, ...]
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> int:
        """How many findings are errors."""
        return sum(finding.severity == "error" for finding in self.findings)


class NoKrlError(ValueError):
    """A path leads to no KRL file; `path` and the sentence say which."""

    def __init__(self, path: Path, message: str) -> None:
        super().__init__(message)
        self.path = path


def is_krl(path: Path) -> bool:
    """Whether a path has the name of a KRL file."""
    return path.suffix.lower() in SUFFIXES and path.is_file()


def find_files(paths: Iterable[Path]) -> tuple[Path, ...]:
    """The KRL files named, those in folders named, and the data lists beside programs.

    Raises:
        NoKrlError: a path is no KRL file and no folder with one, or there are too many.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            inside = sorted(entry for entry in path.rglob("*") if is_krl(entry))
            if not inside:
                raise NoKrlError(path, "the folder holds no .src, .dat or .sub file")
            found.update(dict.fromkeys(inside))
        elif not path.exists():
            raise NoKrlError(path, "there is no such file")
        elif not is_krl(path):
            raise NoKrlError(path, "a KRL file is a .src, .dat or .sub")
        else:
            found[path] = None
            if path.suffix.lower() != ".dat":
                found.update(dict.fromkeys(_data_lists(path)))
        if len(found) > MAX_FILES:
            raise NoKrlError(path, f"there are over {MAX_FILES} KRL files; name fewer")
    return tuple(found)


def _data_lists(path: Path) -> list[Path]:
    stem = path.stem.lower()
    beside = sorted(path.parent.iterdir())
    return [p for p in beside if p.stem.lower() == stem and p.suffix.lower() == ".dat"]


def check_files(paths: Iterable[Path]) -> Checked:
    """Check files and folders.

    A file that cannot be parsed keeps the rest from being looked at: its names would be missing.

    Raises:
        NoKrlError: there is nothing to check.
        OSError: a file cannot be read.
    """
    files = find_files(paths)
    findings: list[Finding] = []
    modules: list[Module] = []
    for path in files:
        try:
            modules.append(read(path))
        except KrlError as error:
            findings.extend(error.findings)
    if not findings:
        named = {str(path) for path in files}
        found = check([*modules, *_neighbours(files)])
        findings = [finding for finding in found if finding.file in named]
    return Checked(files, tuple(sorted(findings)))


def _neighbours(files: Sequence[Path]) -> list[Module]:
    """The modules in the same folders; one that cannot be parsed is none."""
    known = {path.resolve() for path in files}
    others: list[Module] = []
    for folder in sorted({path.parent for path in files}):
        for path in sorted(folder.iterdir())[:MAX_FILES]:
            if is_krl(path) and path.resolve() not in known:
                try:
                    others.append(read(path))
                except KrlError:
                    continue
    return others
