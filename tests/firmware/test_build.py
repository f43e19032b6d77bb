"""The firmware compiles for the ATmega2560 without a warning, twice the same, and fits."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.firmware.rig import FIRMWARE, build_hash, build_settings

# Half of the RAM stays for the stack, which needs less than 100 bytes.
MAX_RAM_BYTES = 4096
MAX_FLASH_BYTES = 16384


def build(folder: Path, *defines: str) -> Path:
    settings = build_settings()
    assert shutil.which("avr-g++"), (
        f"avr-g++ is missing: apt-get install {' '.join(settings['packages'])}"
    )
    program = folder / "board.elf"
    command = ["avr-g++", f"-mmcu={settings['mcu']}", *settings["flags"]]
    command += [f"-DBOARD_BUILD_HASH=0x{build_hash():08X}UL", *defines]
    command += ["-x", "c++", *settings["sources"], "-o", str(program)]
    subprocess.run(command, check=True, cwd=FIRMWARE, timeout=100)
    image = folder / "board.hex"
    copy = ["avr-objcopy", "-O", "ihex", "-R", ".eeprom", str(program), str(image)]
    subprocess.run(copy, check=True, timeout=20)
    return image


def test_the_firmware_builds_the_same_twice_and_fits(tmp_path: Path) -> None:
    images = []
    for name in ("first", "second"):
        folder = tmp_path / name
        folder.mkdir()
        images.append(build(folder).read_bytes())
    assert images[0] == images[1]
    size = subprocess.run(
        ["avr-size", str(tmp_path / "first/board.elf")],
        check=True,
        capture_output=True,
        text=True,
        timeout=20,
    )
    text, data, bss = map(int, size.stdout.splitlines()[1].split()[:3])
    assert text + data <= MAX_FLASH_BYTES
    assert data + bss <= MAX_RAM_BYTES


@pytest.mark.parametrize("baud", [57_600, 115_200, 500_000])
def test_the_rate_to_the_host_is_a_build_setting(tmp_path: Path, baud: int) -> None:
    assert build(tmp_path, f"-DBOARD_HOST_BAUD={baud}UL").stat().st_size > 0


def test_a_rate_that_the_chip_cannot_give_does_not_build(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(subprocess.CalledProcessError):
        build(tmp_path, "-DBOARD_HOST_BAUD=3000000UL")
    assert "BOARD_HOST_BAUD is more than 2.5 % off" in capfd.readouterr().err


def test_each_file_of_the_firmware_is_in_the_build_and_in_its_hash() -> None:
    settings = build_settings()
    listed = set(settings["sources"] + settings["headers"])
    there = {
        str(path.relative_to(FIRMWARE))
        for path in [*FIRMWARE.glob("board/*"), FIRMWARE / "main.cpp"]
        if path.suffix in (".cpp", ".h", ".ino")
    }
    assert listed == there
