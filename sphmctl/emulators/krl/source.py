"""A KRL file as lines: bounded, decoded, with comments and `&` headers taken off.

Not responsible for what the lines mean. One statement stands on a line and none goes over two
(SI, "Structure of a KRL program"), so a line is the unit of everything behind this module.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from sphmctl.emulators.krl.findings import Finding, KrlError
from sphmctl.emulators.krl.nodes import Comment, Header, Place

MAX_BYTES = 4 << 20
"""Of one file: several times the largest data list of a real controller, some 500 kB."""

MAX_LINE = 16_384
"""Characters of one line: ten times the longest in half a million lines of public programs."""

_COMMENT = re.compile(r'^((?:[^";]|"[^"]*")*);(.*)$', re.DOTALL)


@dataclass(frozen=True)
class Source:
    """A file's lines.

    Attributes:
        lines: what is left to parse, empty lines left out.
    """

    file: str
    lines: tuple[tuple[Place, str], ...]
    headers: tuple[Header, ...]
    comments: tuple[Comment, ...]


def read_text(path: Path) -> str:
    """The text of a KRL file; WorkVisual writes Windows-1252, editors UTF-8.

    Raises:
        KrlError: the file is too large, or no text.
        OSError: it cannot be read.
    """
    with path.open("rb") as stream:
        data = stream.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise _error(
            Place(str(path), 1), f"the file is over {MAX_BYTES} bytes, which no program is"
        )
    if b"\0" in data:
        line = data.count(b"\n", 0, data.index(b"\0")) + 1
        raise _error(Place(str(path), line), "there is a zero byte; a KRL file is plain text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def split(text: str, file: str) -> Source:
    """Cut a text into lines.

    Raises:
        KrlError: the text or a line is too long.
    """
    if len(text) > MAX_BYTES:
        raise _error(Place(file, 1), f"the text is over {MAX_BYTES} characters")
    lines: list[tuple[Place, str]] = []
    headers: list[Header] = []
    comments: list[Comment] = []
    for number, raw in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        at = Place(file, number)
        if len(raw) > MAX_LINE:
            raise _error(at, f"the line has {len(raw)} characters; {MAX_LINE} are the most")
        code = raw.strip(" \t\f\x1a")
        if code.startswith("&"):
            headers.append(Header(at, code))
            continue
        if ";" in code and (match := _COMMENT.match(code)):
            code = match[1].rstrip(" \t")
            comments.append(Comment(at, match[2].rstrip()))
        if code:
            lines.append((at, code))
    return Source(file, tuple(lines), tuple(headers), tuple(comments))


def _error(at: Place, message: str) -> KrlError:
    return KrlError((Finding(at.file, at.line, "error", "size", message),))
