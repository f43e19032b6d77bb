"""Builds the firmware from a checkout with avr-gcc, without the Arduino core."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

from sphmctl.board.image import Image, hex_bytes, sha256_of, write_note
from sphmctl.errors import InvalidError
from sphmctl.wire.board_table import BOARD_FIRMWARE, BOARD_PROTOCOL

FIRMWARE = Path(__file__).parents[2] / "firmware"
"""Where a checkout has the sources; an installed package has none."""

RECIPE = "board/build.toml"
"""Flags, defines and files; the build hash covers it as it covers the files."""

TOOLS = ("avr-g++", "avr-objcopy", "avr-size")

TOOL_TIMEOUT_S = 120.0
"""Time limit of one tool: the compiler takes 1 s on a PC, 6 s on a Raspberry Pi 4."""

FLASH_SECTIONS = (".text", ".data")
RAM_SECTIONS = (".data", ".bss", ".noinit")
"""Sections of avr-gcc's ELF file (avr-libc manual, "Memory Sections"): .data stands in both."""


@dataclass(frozen=True)
class Recipe:
    """How the firmware is built, as `RECIPE` says."""

    mcu: str
    flags: tuple[str, ...]
    sources: tuple[str, ...]
    headers: tuple[str, ...]
    packages: tuple[str, ...]
    defines: dict[str, str]

    def build_hash(self, folder: Path) -> int:
        """First 4 bytes of the SHA-256 over each file's path, 0, bytes, 0, in sorted order."""
        digest = hashlib.sha256()
        for name in sorted((RECIPE, *self.sources, *self.headers)):
            digest.update(name.encode() + b"\0" + (folder / name).read_bytes() + b"\0")
        return int.from_bytes(digest.digest()[:4])


def build(out: Path, folder: Path = FIRMWARE) -> Image:
    """Compile the firmware to `out`, and its note beside it.

    Args:
        out: the hex file to write.
        folder: the checkout's firmware folder.

    Raises:
        InvalidError: no checkout, no compiler (naming the packages), or it does not compile.
    """
    recipe = recipe_of(folder)
    _require_tools(recipe)
    try:
        build_hash = recipe.build_hash(folder)
    except OSError as error:
        raise InvalidError(f"a source is missing: {error}", str(folder)) from error
    sizes = _compile(recipe, build_hash, folder, out)
    image = Image(
        hex=out,
        sha256=sha256_of(out),
        flash_bytes=hex_bytes(out),
        ram_bytes=sum(sizes.get(name, 0) for name in RAM_SECTIONS),
        build_hash=build_hash,
        version=BOARD_FIRMWARE,
        protocol=BOARD_PROTOCOL,
    )
    if image.flash_bytes != sum(sizes.get(name, 0) for name in FLASH_SECTIONS):
        raise InvalidError(
            f"{image.flash_bytes} bytes in the hex file, but sections {sizes}", str(out)
        )
    write_note(image)
    return image


def _require_tools(recipe: Recipe) -> None:
    missing = [tool for tool in TOOLS if shutil.which(tool) is None]
    if missing:
        packages = " ".join(recipe.packages)
        raise InvalidError(
            f"{', '.join(missing)} not found; install it: sudo apt install {packages}",
            "firmware build",
        )


def _compile(recipe: Recipe, build_hash: int, folder: Path, out: Path) -> dict[str, int]:
    """Compile to `out`; sizes by section."""
    defines = [f"-D{name}={value}" for name, value in recipe.defines.items()]
    stamp = f"-DBOARD_BUILD_HASH=0x{build_hash:08x}UL"
    options = [f"-mmcu={recipe.mcu}", *recipe.flags, *defines, stamp]
    with tempfile.TemporaryDirectory() as scratch:
        elf, fresh = Path(scratch) / "board.elf", Path(scratch) / "board.hex"
        _run(["avr-g++", *options, "-x", "c++", *recipe.sources, "-o", str(elf)], folder)
        _run(["avr-objcopy", "-O", "ihex", "-R", ".eeprom", str(elf), str(fresh)], folder)
        sizes = _sections(_run(["avr-size", "-A", str(elf)], folder))
        _put(fresh, out)
    return sizes


def recipe_of(folder: Path) -> Recipe:
    """How a checkout's firmware is built.

    Raises:
        InvalidError: no checkout, or the recipe is wrong.
    """
    path = folder / RECIPE
    try:
        fields = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InvalidError(
            "the firmware's sources are not there: building takes a checkout of the repository. "
            "The package ships the built firmware: sphmctl firmware flash --port PORT",
            str(folder),
        ) from error
    except (OSError, ValueError) as error:
        raise InvalidError(str(error), str(path)) from error
    try:
        return Recipe(
            mcu=fields["mcu"],
            flags=tuple(fields["flags"]),
            sources=tuple(fields["sources"]),
            headers=tuple(fields["headers"]),
            packages=tuple(fields["packages"]),
            defines=dict(fields["defines"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidError(f"{error} is missing or of another kind", str(path)) from error


def _run(command: list[str], folder: Path) -> str:
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TOOL_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise InvalidError(
            f"{command[0]} took longer than {TOOL_TIMEOUT_S:g} s", str(folder)
        ) from error
    if done.returncode != 0:
        lines = done.stderr.splitlines() or [f"it ended with code {done.returncode}"]
        first = next((line for line in lines if "error" in line), lines[-1])
        raise InvalidError(f"{command[0]} refuses: {first}", str(folder))
    return done.stdout


def _sections(listing: str) -> dict[str, int]:
    """Sizes by section out of `avr-size -A`: a row is name, size, address."""
    rows = (line.split() for line in listing.splitlines() if line.startswith("."))
    return {row[0]: int(row[1]) for row in rows}


def _put(fresh: Path, out: Path) -> None:
    """Copy the finished file to its place."""
    try:
        part = out.with_name(f".{out.name}.part")
        shutil.copyfile(fresh, part)
        part.replace(out)
    except OSError as error:
        raise InvalidError(f"the file cannot be written: {error.strerror}", str(out)) from error
