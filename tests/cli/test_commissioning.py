"""The command `commission` on a real serial port: a pseudo-terminal with emulated servos."""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from sphmctl.daemon import servo_scan
from sphmctl.emulators.servo_bus import ServoBus
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo
from tests.cli.rig import Sphmctl

LIMIT_S = 20.0
"""A commissioning at one rate takes 2 s."""

pytestmark = pytest.mark.realtime


@contextmanager
def served(servos: list[Servo]) -> Iterator[str]:
    """The port of servos that live in a thread of their own."""
    ready = threading.Event()
    end: list[Callable[[], object]] = []
    path = ""

    async def serve() -> None:
        nonlocal path
        loop = asyncio.get_running_loop()
        bus = ServoBus(World(loop.time), servos, random.Random(1), usb="none")
        path = bus.open_pty()
        done = asyncio.Event()
        end.append(lambda: loop.call_soon_threadsafe(done.set))
        ready.set()
        await done.wait()
        await bus.close()

    thread = threading.Thread(target=asyncio.run, args=(serve(),))
    thread.start()
    ready.wait()
    try:
        yield path
    finally:
        end[0]()
        thread.join()


def factory() -> Servo:
    """A servo as it comes out of its box."""
    return Servo(random.Random(2), baud_code=1, return_delay=250)


@pytest.fixture(autouse=True)
def short_slots(monkeypatch: pytest.MonkeyPatch) -> None:
    """One servo answers at once: nobody has to be waited for."""
    monkeypatch.setattr(servo_scan, "SLOT_S", 0.0)


def at_a_terminal(*arguments: str, answer: bytes | None) -> tuple[int, str]:
    """Exit code of a process, and all it printed; when it asks it is answered, None: by Ctrl-C."""
    terminal, theirs = os.openpty()
    command = [sys.executable, "-m", "sphmctl", *arguments]
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs) as process:
        os.close(theirs)
        told = b""
        # One that hears neither answer nor Ctrl-C must not keep the test.
        watch = threading.Timer(LIMIT_S, process.kill)
        watch.start()
        # Reading fails when the process has closed the terminal.
        with contextlib.suppress(OSError):
            while piece := os.read(terminal, 4096):
                told += piece
                if b"[y/N]" in piece and answer is None:
                    process.send_signal(signal.SIGINT)
                elif b"[y/N]" in piece and answer is not None:
                    os.write(terminal, answer)
        process.wait()
        watch.cancel()
    os.close(terminal)
    return process.returncode, told.decode()


@pytest.mark.parametrize(("answer", "code"), [(b"\n", 2), (None, 130)])
def test_an_empty_answer_and_ctrl_c_change_nothing(answer: bytes | None, code: int) -> None:
    servo = factory()
    with served([servo]) as port:
        arguments = ("commission", "--port", port, "--baud", "57600")
        assert at_a_terminal(*arguments, answer=answer)[0] == code
    assert (servo.baud, servo.table["return_delay_time"]) == (57_600, 250)


def test_yes_at_the_terminal_changes_what_was_explained() -> None:
    servo = factory()
    with served([servo]) as port:
        code, told = at_a_terminal("commission", "--port", port, "--baud", "57600", answer=b"y\n")
    assert code == 0, told
    assert servo.baud == 1_000_000
    first = told.splitlines()[0]
    assert first.startswith("no cell file: servos with the ids 1, 2, 3 at 1000000 baud")
    assert "mark it 1, for leg 1" in told


def test_a_new_servo_is_set_up_over_a_serial_port(sphmctl: Sphmctl) -> None:
    servo = factory()
    with served([servo]) as port:
        told = sphmctl("commission", "--port", port, "--baud", 57600, "--id", 2, "--yes", "--json")
        assert told.code == 0, told.err
        again = sphmctl("commission", "--port", port, "--baud", 1_000_000)
    assert (servo.id, servo.baud, servo.return_delay_s) == (2, 1_000_000, 0.0)
    (done,) = told.document["servos"]
    assert (done["id"], done["leg"], done["found"]["baud"]) == (2, 2, 57_600)
    assert told.document["missing_ids"] == [1, 3]
    assert "Return Delay Time (9): 250 -> 0" in told.err
    assert again.code == 0
    assert "servo 2 (leg 2): was ready" in again.out
    assert "still missing: 1, 3" in again.out


def test_without_a_terminal_and_without_yes_nothing_changes(
    sphmctl: Sphmctl, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stdin, "isatty", lambda: False)
    servo = factory()
    with served([servo]) as port:
        told = sphmctl("commission", "--port", port, "--baud", 57600, "--json")
    assert told.code == 2
    assert "add --yes" in told.error["message"]
    assert servo.baud == 57_600


def test_all_rates_are_looked_at_when_none_is_named(
    sphmctl: Sphmctl, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(servo_scan, "PING_REPLY_BYTES", 1)
    with served([]) as port:
        told = sphmctl("commission", "--port", port, "--yes")
    assert told.code == 5
    assert told.err.count("looking for servos at") == 8
    assert told.err.count("cannot have") <= 1
    assert "no servo answers at any of" in told.err


def test_a_rate_at_which_nobody_answers_is_named(sphmctl: Sphmctl) -> None:
    with served([]) as port:
        told = sphmctl("commission", "--port", port, "--baud", 1_000_000, "--yes", "--json")
    assert told.code == 5
    assert "no servo answers at 1000000 baud" in told.error["message"]
    assert "leave --baud away" in told.error["message"]


def test_a_wrong_rate_or_port_is_refused(sphmctl: Sphmctl) -> None:
    told = sphmctl("commission", "--port", "/dev/x", "--baud", 12)
    assert told.code == 3
    assert "12 is no rate of an XL430; give one of 9600, 57600" in told.err
    told = sphmctl("commission", "--port", "/dev/no-such-port", "--yes", "--json")
    assert told.code == 5
    assert told.error["message"].startswith("no USB adapter: there is no such port")
    told = sphmctl("commission", "--port", "/tmp", "--yes")
    assert "this is a folder; give the USB adapter's serial port" in told.err
