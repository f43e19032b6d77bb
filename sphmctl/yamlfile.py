"""YAML files with the place of every key and value, and models loaded from them.

Everything wrong with a file, from "cannot be read" to "number out of range", becomes one
`InvalidError` that names file, line, column, field and value. Numbers follow YAML 1.2 (`1e3` is a
number, `no` and `1:30` are texts).
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, TypeVar, get_args

import yaml
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from sphmctl.errors import InvalidError

Loc: TypeAlias = tuple[str | int, ...]
Numbers: TypeAlias = tuple[float, ...]
Model = TypeVar("Model", bound=BaseModel)

SIZE_LIMIT_BYTES = 4_000_000
"""A path of 40,000 points; a larger file is a mistake, and reading it would block for seconds."""

DEPTH_LIMIT = 16
"""Nesting; our deepest file needs 5."""

SHOWN_CHARACTERS = 60
"""A value in a message is cut after this many characters, so that the sentence stays readable."""

INTEGER_LIMIT = 2**63
"""No field is larger, and conversions of endless digits are slow."""

POSITION_LIMIT_MM = 10_000.0
"""Far outside any reach; keeps arithmetic far from overflow."""

ANGLE_LIMIT_DEG = 720.0
"""Two turns; a larger number is not an angle that somebody meant."""

STRICT = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
"""For all models of files: unknown keys are errors, and a text is never taken for a number."""

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INTEGER = re.compile(r"[-+]?[0-9]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_WORDS: Mapping[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


@dataclass(frozen=True)
class Document:
    """A YAML file's content with places.

    Attributes:
        file: the name to show.
        data: the content; sequences are tuples.
        keys: line and column (from 1) of each entry's key, by its location.
        values: line and column (from 1) of each value, by its location.
    """

    file: str
    data: dict[str, Any]
    keys: dict[Loc, tuple[int, int]]
    values: dict[Loc, tuple[int, int]]

    def line(self, loc: Loc) -> int:
        """Line of the key or value at `loc`, or of what it stands in."""
        return self._mark(loc, False)[0]

    def error(self, loc: Loc, message: str, *, at_key: bool = False) -> InvalidError:
        """An error that points at `loc`, or at the nearest thing around it that exists."""
        line, column = self._mark(loc, at_key)
        name = field_name(loc)
        return InvalidError(
            f"{name}: {message}" if name else message,
            f"{self.file}, line {line}, column {column}",
        )

    def _mark(self, loc: Loc, at_key: bool) -> tuple[int, int]:
        tables = (self.keys, self.values) if at_key else (self.values, self.keys)
        for end in range(len(loc), -1, -1):
            for table in tables:
                if loc[:end] in table:
                    return table[loc[:end]]
        return (1, 1)


def field_name(loc: Loc) -> str:
    """`moves[2].lin.pose` for a location; list items count from 1, as people do."""
    text = ""
    for step in loc:
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}"
    return text.lstrip(".")


def shown(value: object) -> str:
    """A value as the file would write it, cut to a readable length."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= SHOWN_CHARACTERS else text[:SHOWN_CHARACTERS] + " ..."


def wrong(message: str, *at: str | int) -> PydanticCustomError:
    """For validators: one sentence, about the item `at` inside the value that is validated."""
    return PydanticCustomError("wrong", "{message}", {"message": message, "at": at})


def nearest(word: str, known: tuple[str, ...]) -> str:
    """ " (did you mean 'x'?)" for a word close to a known one, else nothing."""
    close = get_close_matches(word, known, 1, 0.5)
    return f" (did you mean '{close[0]}'?)" if close else ""


def check_numbers(values: Numbers, count: int, what: str, limit: float) -> Numbers:
    """For validators: `values` if they are `count` numbers within +-`limit`."""
    if len(values) != count:
        raise wrong(f"{shown(values)} has {len(values)} numbers; give {count}: {what}")
    for index, value in enumerate(values):
        if abs(value) > limit:
            raise wrong(f"{value:g} is out of range; at most {limit:g} is allowed", index)
    return values


def check_pose(values: Numbers) -> Numbers:
    """For validators: `values` if they are a pose x, y, z mm, A, B, C deg."""
    check_numbers(values, 6, "x, y, z in mm, a, b, c in degrees", POSITION_LIMIT_MM)
    for index, value in enumerate(values[3:], 3):
        if abs(value) > ANGLE_LIMIT_DEG:
            raise wrong(f"{value:g} is no angle; at most {ANGLE_LIMIT_DEG:g} is allowed", index)
    return values


Pose: TypeAlias = Annotated[Numbers, AfterValidator(check_pose)]


def _no_truth(value: Any) -> Any:
    """Python takes True for 1."""
    if isinstance(value, bool):
        raise wrong(f"{shown(value)} should be 1")
    return value


Version: TypeAlias = Annotated[Literal[1], BeforeValidator(_no_truth)]


def load(path: str | Path, model: type[Model]) -> tuple[Model, Document]:
    """Read a file into a model.

    Raises:
        InvalidError: the file cannot be read, is not YAML, or is not what the model asks for.
    """
    document = read(path)
    try:
        return model.model_validate(document.data), document
    except ValidationError as problem:
        raise _explain(document, model, problem.errors()) from None


def read(path: str | Path) -> Document:
    """Read a YAML file whose top is a mapping. Raises InvalidError."""
    file = str(path)
    text = read_text(file)
    bad = _UNPRINTABLE.search(text)
    if bad:
        line, column = _place(text, bad.start())
        raise InvalidError(
            f"the character U+{ord(bad.group()):04X} is not allowed in YAML",
            f"{file}, line {line}, column {column}",
        )
    builder = _Builder(file)
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            builder.take(event)
    except yaml.MarkedYAMLError as problem:
        mark = problem.problem_mark or problem.context_mark
        where = f"{file}, line {mark.line + 1}, column {mark.column + 1}" if mark else file
        about = " ".join(part for part in (problem.context, problem.problem) if part)
        raise InvalidError(f"not valid YAML: {about}", where) from None
    except yaml.YAMLError as problem:
        raise InvalidError(f"not valid YAML: {' '.join(str(problem).split())}", file) from None
    if not builder.documents or builder.data is None:
        raise InvalidError("the file is empty; it should hold keys such as 'version: 1'", file)
    if not isinstance(builder.data, dict):
        raise InvalidError(
            f"the file holds {shown(builder.data)}; it should hold keys such as 'version: 1'", file
        )
    return Document(file, builder.data, builder.keys, builder.values)


def read_text(file: str, limit_bytes: int = SIZE_LIMIT_BYTES) -> str:
    """A whole file of UTF-8. Raises InvalidError, with the line that is not."""
    try:
        with open(file, "rb") as stream:
            content = stream.read(limit_bytes + 1)
    except FileNotFoundError:
        raise InvalidError("there is no such file", file) from None
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or str(problem)
        raise InvalidError(f"the file cannot be read: {reason}", file) from None
    if len(content) > limit_bytes:
        raise InvalidError(f"the file is larger than {limit_bytes // 1_000_000} MB", file)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        line = content.count(b"\n", 0, problem.start) + 1
        raise InvalidError(
            "the text is not UTF-8; save it as UTF-8", f"{file}, line {line}"
        ) from None


def _place(text: str, index: int) -> tuple[int, int]:
    return text.count("\n", 0, index) + 1, index - text.rfind("\n", 0, index)


@dataclass
class _Open:
    """A mapping or sequence that has begun and not ended."""

    loc: Loc
    items: dict[str, Any] | list[Any]
    key: str | None = None


@dataclass
class _Builder:
    """Turns parser events into data and places; keeps its own stack, so depth cannot hurt."""

    file: str
    data: Any = None
    documents: int = 0
    keys: dict[Loc, tuple[int, int]] = field(default_factory=dict)
    values: dict[Loc, tuple[int, int]] = field(default_factory=dict)
    stack: list[_Open] = field(default_factory=list)

    def take(self, event: yaml.Event) -> None:
        """Go on by one event of the parser."""
        begin = event.start_mark
        mark = (begin.line + 1, begin.column + 1) if begin else (1, 1)
        if isinstance(event, yaml.DocumentStartEvent):
            self.documents += 1
            if self.documents > 1:
                raise self._error(mark, "a second document ('---') begins here; give one only")
        elif isinstance(event, yaml.AliasEvent):
            raise self._error(mark, f"write the value in place of '*{event.anchor}': no aliases")
        elif isinstance(event, yaml.NodeEvent):
            self._node(event, mark)
        elif isinstance(event, yaml.CollectionEndEvent):
            done = self.stack.pop()
            items = done.items
            self._put(done.loc, tuple(items) if isinstance(items, list) else items)

    def _node(self, event: yaml.NodeEvent, mark: tuple[int, int]) -> None:
        if event.anchor is not None:
            raise self._error(mark, f"leave out '&{event.anchor}': no anchors here")
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise self._error(mark, f"leave out the tag '{tag}': plain values only")
        top = self.stack[-1] if self.stack else None
        if top is not None and isinstance(top.items, dict) and top.key is None:
            self._key(top, event, mark)
            return
        loc = self._next_loc()
        self.values[loc] = mark
        if isinstance(event, yaml.ScalarEvent):
            self._put(loc, self._scalar(event, loc, mark))
            return
        if len(self.stack) >= DEPTH_LIMIT:
            raise self._error(mark, f"nested deeper than {DEPTH_LIMIT} levels")
        self.stack.append(_Open(loc, [] if isinstance(event, yaml.SequenceStartEvent) else {}))

    def _key(self, top: _Open, event: yaml.NodeEvent, mark: tuple[int, int]) -> None:
        if not isinstance(event, yaml.ScalarEvent):
            raise self._error(mark, "a key must be one word")
        loc = (*top.loc, event.value)
        if event.value in top.items:
            first = self.keys[loc][0]
            raise self._error(mark, f"the key '{event.value}' was given before, in line {first}")
        self.keys[loc] = mark
        top.key = event.value

    def _next_loc(self) -> Loc:
        if not self.stack:
            return ()
        top = self.stack[-1]
        return (*top.loc, len(top.items) if top.key is None else top.key)

    def _put(self, loc: Loc, value: object) -> None:
        if not self.stack:
            self.data = value
            return
        top = self.stack[-1]
        if isinstance(top.items, list):
            top.items.append(value)
        elif top.key is not None:
            top.items[top.key] = value
            top.key = None

    def _scalar(self, event: yaml.ScalarEvent, loc: Loc, mark: tuple[int, int]) -> object:
        text: str = event.value
        if not event.implicit[0]:
            return text
        if text in _WORDS:
            return _WORDS[text]
        if _NOT_FINITE.fullmatch(text):
            about = f"{field_name(loc)}: {text} cannot be used"
            raise self._error(mark, f"{about}; give a finite number")
        number: float | None = None
        if _INTEGER.fullmatch(text):
            number = int(text, 0 if "x" in text else 10) if len(text) < 40 else INTEGER_LIMIT
        elif _FLOAT.fullmatch(text):
            number = float(text)
        if number is None:
            return text
        if abs(number) >= (INTEGER_LIMIT if isinstance(number, int) else float("inf")):
            raise self._error(mark, f"{field_name(loc)}: the number {shown(text)} is too large")
        return number

    def _error(self, mark: tuple[int, int], message: str) -> InvalidError:
        return InvalidError(message, f"{self.file}, line {mark[0]}, column {mark[1]}")


_KINDS = {
    "int": "a whole number",
    "float": "a number",
    "string": "a text",
    "bool": "true or false",
    "tuple": "a list [..., ...]",
    "dict": "keys with values {key: value}",
    "model": "keys with values {key: value}",
}


def _explain(
    document: Document, model: type[BaseModel], details: list[ErrorDetails]
) -> InvalidError:
    # A misspelt key is missing too: what stands in the file is told before what does not.
    first = min(details, key=lambda item: (item["type"] == "missing", document.line(item["loc"])))
    loc, kind, context = first["loc"], first["type"], first.get("ctx", {})
    if kind == "extra_forbidden":
        known = _known_keys(model, loc[:-1])
        hint = nearest(str(loc[-1]), known) or f"; known here: {', '.join(known)}"
        return document.error(loc, f"this key is not known{hint}", at_key=True)
    if kind == "missing":
        return document.error(loc, "this key is missing; add it")
    if kind == "wrong":
        at = context.get("at", ())
        return document.error((*loc, *at), str(context["message"]))
    value = shown(first["input"])
    if kind == "literal_error":
        expected = str(context["expected"])
        known = tuple(re.findall(r"'([^']*)'", expected))
        return document.error(
            loc, f"{value} is not {expected}{nearest(str(first['input']), known)}"
        )
    if kind.endswith("_type") and kind[: -len("_type")] in _KINDS:
        return document.error(loc, f"{value} should be {_KINDS[kind[: -len('_type')]]}")
    if kind == "too_short" and context["actual_length"] == 0:
        return document.error(loc, "the list is empty; give at least one item")
    told = first["msg"].replace("Input should be", "should be").replace("String should", "should")
    return document.error(loc, f"{value} {told}")


def _known_keys(model: type[BaseModel], loc: Loc) -> tuple[str, ...]:
    """The keys that the model reads in the mapping at `loc`."""
    here: Any = model
    for step in loc:
        if isinstance(here, type) and issubclass(here, BaseModel):
            fields = here.model_fields
            here = _plain(fields[str(step)].annotation) if step in fields else None
        else:
            arguments = get_args(here)
            here = _plain(arguments[-1 if isinstance(step, str) else 0]) if arguments else None
    if not (isinstance(here, type) and issubclass(here, BaseModel)):
        return ()
    return tuple(name for name, info in here.model_fields.items() if not info.exclude)


def _plain(annotation: Any) -> Any:
    """The type itself, without `Annotated` and without "or None"."""
    if hasattr(annotation, "__metadata__"):
        return _plain(annotation.__origin__)
    choices = [choice for choice in get_args(annotation) if choice is not type(None)]
    return (
        _plain(choices[0])
        if len(choices) == 1 and type(None) in get_args(annotation)
        else annotation
    )
