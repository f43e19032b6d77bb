"""What an examination of a device finds; shown by `doctor`, and refused before motion."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One property of a device that was looked at."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""
