"""Flashing: the real avrdude on the simulated Mega, and a sentence for all that is in the way."""

from __future__ import annotations

import fcntl
import os
import termios
import time
from pathlib import Path

import pytest

from sphmctl.board import avrdude, bootloader, flash, port
from sphmctl.board.image import SHIPPED, load
from sphmctl.errors import DeviceError
from tests.avrsim.rig import compile_sketch
from tests.board.rig import answering, mega, mega_1280, uno
from tests.cli.conftest import sphmctl as sphmctl
from tests.cli.conftest import terminal as terminal
from tests.cli.rig import Sphmctl

pytestmark = pytest.mark.realtime

LONGEST_REFUSAL_S = 10.0


def refusal(device: str, baud: int = bootloader.BAUD) -> str:
    """The sentence with which flashing ends, in time."""
    began_s = time.monotonic()
    with pytest.raises(DeviceError) as caught:
        flash.flash(device, load(), baud)
    assert time.monotonic() - began_s < LONGEST_REFUSAL_S
    assert device in caught.value.where
    return caught.value.message


def fake_avrdude(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a script in avrdude's place."""
    program = folder / "avrdude"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")


def test_a_blank_mega_is_flashed_through_its_bootloader_and_matches(sphmctl: Sphmctl) -> None:
    with mega(None) as device:
        done = sphmctl("firmware", "flash", "--port", device, "--json")
        assert done.code == 0, done.err
        assert done.document["verified"] is True
        assert "looking for the board's bootloader" in done.err
        told = sphmctl("firmware", "check", "--port", device, "--verify", "--json")
        assert told.code == 0, told.out
        assert told.document["state"] == "match"
        assert told.document["verified"] is True
        assert told.document["build_hash"] == done.document["build_hash"]
        assert told.document["counters"]["host_crc_errors"] == 0


def test_another_sketch_in_the_flash_is_noticed(tmp_path: Path) -> None:
    with mega(compile_sketch("echo", tmp_path)) as device:
        assert flash.verify(device, load()) is False


def test_a_wrong_rate_is_told_with_the_right_one() -> None:
    with mega(SHIPPED) as device:
        told = refusal(device, 57_600)
    assert told == (
        "wrong rate: the bootloader answers at 115200 baud, not at 57600; give --baud 115200"
    )


def test_an_uno_is_named() -> None:
    with answering(uno) as device:
        assert refusal(device) == (
            "wrong board: an ATmega328P (Arduino Uno or Nano) answers; "
            "the firmware needs an Arduino Mega 2560"
        )


def test_another_part_is_named() -> None:
    with answering(mega_1280) as device:
        assert "an ATmega1280 (the first Arduino Mega) answers" in refusal(device)


def test_silence_is_told_with_what_to_look_at(terminal: str) -> None:
    told = refusal(terminal)
    assert told.startswith("no bootloader answers at any rate")
    assert "Arduino Mega 2560" in told
    assert "Press reset" in told


def test_a_missing_port_is_told() -> None:
    assert refusal("/dev/no-such-port").startswith("no board: there is no such port")


def test_a_file_is_no_port(tmp_path: Path) -> None:
    assert "no serial port" in refusal(str(SHIPPED))
    assert "folder" in refusal(str(tmp_path))


@pytest.mark.parametrize("claim", ["flock", "TIOCEXCL"])
def test_a_port_in_use_is_told(terminal: str, claim: str) -> None:
    file = os.open(terminal, os.O_RDWR | os.O_NOCTTY)
    if claim == "flock":
        fcntl.flock(file, fcntl.LOCK_EX)
    else:
        fcntl.ioctl(file, termios.TIOCEXCL)
    try:
        assert refusal(terminal).startswith("it is in use by")
    finally:
        fcntl.ioctl(file, termios.TIOCNXCL)
        os.close(file)


def test_a_missing_permission_is_told_with_the_group_to_join(terminal: str) -> None:
    dialout = 20
    if is_root := os.geteuid() == 0:
        os.chown(terminal, 0, dialout)
        os.chmod(terminal, 0o660)
        os.setegid(65_534)
        os.seteuid(65_534)
    else:
        os.chmod(terminal, 0)
    try:
        told = refusal(terminal)
    finally:
        if is_root:
            os.seteuid(0)
            os.setegid(0)
    assert told == (
        "no permission to open it; join the group dialout: "
        "sudo usermod -aG dialout $USER, then log in again"
    )


def test_a_missing_avrdude_is_told_with_its_package(
    terminal: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(DeviceError, match="sudo apt install avrdude"):
        flash.flash(terminal, load())


def test_an_avrdude_that_falls_silent_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_avrdude(tmp_path, "exec sleep 60", monkeypatch)
    monkeypatch.setattr(avrdude, "SILENCE_TIMEOUT_S", 0.2)
    with pytest.raises(DeviceError, match="unplug it"):
        avrdude.run("write", "/dev/x", 115_200, SHIPPED, 1)


def test_an_avrdude_that_talks_for_ever_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_avrdude(tmp_path, "while true; do echo timeout >&2; done", monkeypatch)
    monkeypatch.setattr(avrdude, "START_TIMEOUT_S", 0.2)
    with pytest.raises(DeviceError, match="unplug it"):
        avrdude.run("write", "/dev/x", 115_200, SHIPPED, 1)


def test_avrdude_s_words_are_kept_and_a_difference_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_avrdude(tmp_path, "echo 'avrdude error: cannot sync' >&2; exit 1", monkeypatch)
    outcome = avrdude.run("write", "/dev/x", 115_200, SHIPPED, 1)
    assert outcome == avrdude.Outcome(False, False, "avrdude error: cannot sync")


def test_a_sign_on_is_framed_as_avrdude_sends_it() -> None:
    # avrdude 7.1 -vvvv -c wiring prints: Send: [1b] [01] [00] [01] [0e] [01] [14]
    assert bootloader.frame_v2(1, b"\x01") == bytes.fromhex("1b0100010e0114")


def test_an_answer_is_found_behind_noise_and_not_when_damaged() -> None:
    answer = mega_1280(bootloader.frame_v2(7, b"\x01"))
    assert bootloader.body_v2(b"\x1b\x00" + answer, 7) == b"\x01\x00\x08AVRISP_2"
    assert bootloader.body_v2(answer, 8) is None
    assert bootloader.body_v2(answer[:-1], 7) is None
    assert bootloader.body_v2(answer[:-1] + b"\x00", 7) is None


def test_another_program_at_the_port_is_named(terminal: str) -> None:
    assert port.user_of(terminal) == ""
    assert port.user_of("/dev/null") != ""
