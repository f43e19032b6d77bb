"""Collects what the checks find, each thing once."""

from __future__ import annotations

from sphmctl.emulators.krl.findings import Finding, Severity
from sphmctl.emulators.krl.nodes import Place


class Report:
    """The findings so far."""

    def __init__(self) -> None:
        self._findings: dict[Finding, None] = {}

    def error(self, at: Place, code: str, message: str) -> None:
        """The controller would refuse it, or stop there."""
        self._add(at, "error", code, message)

    def warn(self, at: Place, code: str, message: str) -> None:
        """It runs, but hardly as it was meant."""
        self._add(at, "warning", code, message)

    def _add(self, at: Place, severity: Severity, code: str, message: str) -> None:
        self._findings[Finding(at.file, at.line, severity, code, message)] = None

    def sorted(self) -> tuple[Finding, ...]:
        """All findings by file and line."""
        return tuple(sorted(self._findings))
