"""What is found wrong or doubtful in KRL files, and the error that carries it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning"]


@dataclass(frozen=True, order=True)
class Finding:
    """One thing found.

    Attributes:
        line: counted from 1.
        code: the kind of finding as one word, for filters.
        message: one sentence that says what is wrong and what would be right.
    """

    file: str
    line: int
    severity: Severity
    code: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.severity}: {self.message} [{self.code}]"


class KrlError(Exception):
    """A text is no KRL that this package knows; `findings` says why, one for each place."""

    def __init__(self, findings: tuple[Finding, ...]) -> None:
        super().__init__("; ".join(str(finding) for finding in findings))
        self.findings = findings
