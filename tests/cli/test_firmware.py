"""The commands of the board's firmware; `simulate` as a process that any client can use."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import serial

from sphmctl.board import bootloader
from sphmctl.board.image import load
from sphmctl.cli import firmware
from tests.cli.rig import Sphmctl

PING_200 = bytes.fromhex("FFFFFD00C80300013BFA")
"""ROBOTIS e-manual, Protocol 2.0, "Ping", for id 200; CRC by dynamixel-sdk."""

START_TIMEOUT_S = 30.0


def test_build_tells_hex_digest_and_sizes(sphmctl: Sphmctl) -> None:
    told = sphmctl("firmware", "build", "--json")
    assert told.code == 0, told.err
    document = told.document
    assert document["hex"] == "board.hex"
    assert Path("board.hex").exists()
    assert re.fullmatch("[0-9a-f]{64}", document["sha256"])
    assert 4_000 < document["flash_bytes"] < 253_952
    assert 1_000 < document["ram_bytes"] < 8_192 - 1_024
    people = sphmctl("firmware", "build", "--out", "b.hex")
    assert f"flash {document['flash_bytes']} bytes" in people.out


def test_build_without_a_compiler_names_the_packages(
    sphmctl: Sphmctl, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    told = sphmctl("firmware", "build", "--json")
    assert told.code == 3
    assert "gcc-avr" in told.error["message"]
    assert told.err.count("\n") == 1


@pytest.mark.realtime
def test_a_silent_board_is_a_verdict_and_no_error(
    sphmctl: Sphmctl, terminal: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bootloader, "ASK_S", 0.02)
    told = sphmctl("firmware", "check", "--port", terminal, "--verify", "--json")
    assert told.code == 5
    assert told.document["state"] == "silent"
    assert "no bootloader answers at any rate" in told.document["detail"]
    assert told.document["verified"] is None
    assert told.document["version"] is None
    assert told.document["build_hash"] is None


def test_a_missing_port_is_an_error(sphmctl: Sphmctl) -> None:
    for command in ("check", "flash"):
        told = sphmctl("firmware", command, "--port", "/dev/no-such-port", "--json")
        assert told.code == 5
        assert told.error["message"].startswith("no board: there is no such port")
        assert told.error["where"] == "serial port /dev/no-such-port"


def test_a_hex_file_without_its_note_is_refused(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "my.hex").write_text(":00000001FF\n")
    told = sphmctl("firmware", "flash", "--port", "/dev/x", "--hex", "my.hex")
    assert told.code == 3
    assert "note beside my.hex" in told.err


def test_simulate_refuses_what_is_no_hex_file(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "my.hex").write_text("hello\n")
    told = sphmctl("firmware", "simulate", "--hex", "my.hex")
    assert told.code == 3
    assert "my.hex:1: no Intel hex record" in told.err
    (tmp_path / "link").write_text("precious")
    told = sphmctl("firmware", "simulate", "--link", "link")
    assert told.code == 3
    assert "no symbolic link" in told.err
    assert (tmp_path / "link").read_text() == "precious"


@pytest.mark.realtime
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_simulate_serves_the_shipped_firmware_until_it_is_told_to_end(
    tmp_path: Path, number: signal.Signals
) -> None:
    link, bus = tmp_path / "board", tmp_path / "bus"
    command = [sys.executable, "-m", "sphmctl", "firmware", "simulate", "--json"]
    process = subprocess.Popen(
        [*command, "--link", str(link), "--bus-link", str(bus)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with process:
        assert process.stdout is not None
        ready = json.loads(process.stdout.readline())
        assert os.readlink(link) == ready["port"]
        assert os.readlink(bus) == ready["bus"]
        with serial.Serial(ready["port"], 1_000_000, timeout=0.2) as line:
            answer = ping_until_answered(line)
        process.send_signal(number)
        out, err = process.communicate(timeout=START_TIMEOUT_S)
    assert process.returncode == 0, err
    assert out == ""
    assert err == "EMULATED: no robot will move\n"
    assert not link.is_symlink()
    # Status of id 200: no alert, as the stop is not pressed; model 60200 (EB28), shipped version.
    assert answer[4:9] == bytes.fromhex("C807005500")
    assert answer[9:12] == bytes.fromhex("28EB") + bytes((load().version,))


def ping_until_answered(line: serial.Serial) -> bytes:
    """The answer to a ping; the first ones may reach the board while it still starts."""
    end_s = time.monotonic() + START_TIMEOUT_S
    while time.monotonic() < end_s:
        line.write(PING_200)
        answer: bytes = line.read(14)
        if len(answer) == 14:
            return answer
    raise AssertionError("the simulated board does not answer")


def test_each_command_of_the_group_teaches_by_example(sphmctl: Sphmctl) -> None:
    for command in firmware.app.registered_commands:
        told = sphmctl("firmware", str(command.name), "--help")
        assert told.code == 0
        assert f"Example: sphmctl firmware {command.name}" in " ".join(told.out.split())
