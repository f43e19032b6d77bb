"""A firmware image: the Intel hex file, and beside it a note of what it was built from.

The note (`NAME.toml` beside `NAME.hex`) is written by `build`; the package ships both.
"""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass
from pathlib import Path

from sphmctl.errors import InvalidError

SHIPPED = Path(__file__).parent / "board.hex"
"""The image that comes with this version of the package."""

DATA, END = 0, 1
"""Record types of Intel's "Hexadecimal Object File Format Specification" (1988) that are read; the
addresses do not matter here."""


@dataclass(frozen=True)
class Image:
    """A built firmware.

    Attributes:
        hex: the file.
        sha256: of the file.
        flash_bytes: bytes that it puts into the flash.
        ram_bytes: memory that its variables take; the stack comes on top.
        build_hash: what the firmware tells as BUILD_HASH.
        version: what it tells as FIRMWARE_VERSION.
        protocol: what it tells as PROTOCOL_VERSION.
    """

    hex: Path
    sha256: str
    flash_bytes: int
    ram_bytes: int
    build_hash: int
    version: int
    protocol: int


def note_of(hex_file: Path) -> Path:
    """Where the note of an image stands."""
    return hex_file.with_suffix(".toml")


def load(hex_file: Path = SHIPPED) -> Image:
    """An image and its note.

    Raises:
        InvalidError: a file is missing, or the two do not belong together.
    """
    note = note_of(hex_file)
    digest = sha256_of(hex_file)
    try:
        fields = tomllib.loads(note.read_text(encoding="utf-8"))
        image = Image(hex=hex_file, flash_bytes=hex_bytes(hex_file), **fields)
    except (OSError, ValueError, TypeError) as error:
        raise InvalidError(
            f"the note beside {hex_file.name} is missing or wrong ({error}); "
            "build the firmware anew: sphmctl firmware build",
            str(note),
        ) from error
    if image.sha256 != digest:
        raise InvalidError(
            f"sha256 is {digest}, its note says {image.sha256}; "
            "build the firmware anew: sphmctl firmware build",
            str(hex_file),
        )
    return image


def write_note(image: Image) -> None:
    """Write the note beside the image."""
    note_of(image.hex).write_text(
        "# What board.hex was built from; written by `sphmctl firmware build`.\n"
        f'sha256 = "{image.sha256}"\n'
        f"ram_bytes = {image.ram_bytes}\n"
        f"build_hash = 0x{image.build_hash:08x}\n"
        f"version = {image.version}\n"
        f"protocol = 0x{image.protocol:04x}\n",
        encoding="utf-8",
    )


def sha256_of(hex_file: Path) -> str:
    """Digest of a file.

    Raises:
        InvalidError: it cannot be read.
    """
    try:
        return hashlib.sha256(hex_file.read_bytes()).hexdigest()
    except OSError as error:
        raise InvalidError(f"the file cannot be read: {error.strerror}", str(hex_file)) from error


def hex_bytes(hex_file: Path) -> int:
    """How many bytes of flash an Intel hex file fills.

    Raises:
        InvalidError: it is no Intel hex file, or cut.
    """
    count, ended = 0, False
    try:
        lines = hex_file.read_text(encoding="ascii").splitlines()
    except (OSError, ValueError) as error:
        raise InvalidError(f"no readable Intel hex file: {error}", str(hex_file)) from error
    for number, line in enumerate(lines, 1):
        try:
            record = bytes.fromhex(line.removeprefix(":")) if line.startswith(":") else b""
        except ValueError:
            record = b""
        if len(record) < 5 or len(record) != record[0] + 5 or sum(record) & 0xFF:
            raise InvalidError("no Intel hex record", f"{hex_file}:{number}")
        count += record[0] if record[3] == DATA else 0
        ended = ended or record[3] == END
    if not ended:
        raise InvalidError("the end record is missing: the file is cut", str(hex_file))
    return count
