"""Writes the firmware through the board's bootloader; what is in the way gets its sentence."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from sphmctl.board import avrdude, bootloader
from sphmctl.board.image import Image
from sphmctl.board.port import look_at, user_of, where
from sphmctl.errors import DeviceError


@dataclass(frozen=True)
class Flashed:
    """What was done.

    Attributes:
        port: where.
        image: what was written, and read back as written.
        seconds: how long it took.
    """

    port: str
    image: Image
    seconds: float


def flash(
    port: str,
    image: Image,
    baud: int = bootloader.BAUD,
    tell: Callable[[str], None] = lambda _: None,
) -> Flashed:
    """Write an image and verify it.

    Args:
        port: the board's serial port.
        image: what to write.
        baud: rate of the bootloader.
        tell: takes each step in words.

    Raises:
        DeviceError: no board, no permission, port in use, another part, another rate, no answer,
            avrdude missing: within 10 s. avrdude failing: within 5 s after it falls silent, and
            in all within 6 s and 1 s for each kilobyte (`avrdude.run`).
    """
    began_s = time.monotonic()
    tell("looking for the board's bootloader")
    require_mega(port, baud)
    tell(f"writing version {image.version}, build {image.build_hash:08x}")
    outcome = avrdude.run("write", port, baud, image.hex, image.flash_bytes)
    if outcome.mismatch:
        raise DeviceError(
            f"the flash does not hold what was written ({outcome.said}); try once more, and if it "
            "stays so the chip is worn out",
            where(port),
        )
    if not outcome.ok:
        raise DeviceError(
            f"avrdude could not write the firmware: {outcome.said or 'it does not say why'}; "
            "try once more",
            where(port),
        )
    return Flashed(port, image, time.monotonic() - began_s)


def verify(port: str, image: Image, baud: int = bootloader.BAUD) -> bool:
    """Whether the flash holds the image, byte for byte.

    Raises:
        DeviceError: it could not be read.
    """
    require_mega(port, baud)
    outcome = avrdude.run("verify", port, baud, image.hex, image.flash_bytes)
    if not outcome.ok and not outcome.mismatch:
        raise DeviceError(f"avrdude could not read the flash: {outcome.said}", where(port))
    return outcome.ok


def require_mega(port: str, baud: int) -> None:
    """Refuse a port behind which no Mega 2560's bootloader answers at that rate.

    Raises:
        DeviceError: saying what is there instead.
    """
    avrdude.require()
    look_at(port)
    answer = bootloader.find(port, baud)
    if answer is None:
        raise DeviceError(_silence(port), where(port))
    if answer.protocol != "stk500v2" or answer.signature != bootloader.MEGA_2560:
        raise DeviceError(
            f"wrong board: an {answer.part} answers; the firmware needs an Arduino Mega 2560",
            where(port),
        )
    if answer.baud != baud:
        raise DeviceError(
            f"wrong rate: the bootloader answers at {answer.baud} baud, not at {baud}; "
            f"give --baud {answer.baud}",
            where(port),
        )


def _silence(port: str) -> str:
    user = user_of(port)
    other = f"; {user} has the port open too, end that first" if user else ""
    return (
        f"no bootloader answers at any rate{other}; is this an Arduino Mega 2560, is its reset "
        "line connected (auto-reset), and is its bootloader there? Press reset and try again"
    )
