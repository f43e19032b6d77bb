"""The commands `firmware build|flash|check|simulate`: the board's firmware."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sphmctl.cli.common import JsonOption, put, say, until_told
from sphmctl.errors import DeviceError, InvalidError

if TYPE_CHECKING:
    from sphmctl.emulators.board import Options

EXIT_DEVICE = 5

app = typer.Typer(
    name="firmware",
    no_args_is_help=True,
    help="The board's firmware: build it, flash it, check what runs, run it without a board.",
)

PortOption = Annotated[str, typer.Option(metavar="PORT", help="The board's serial port.")]
HexOption = Annotated[
    Path | None,
    typer.Option("--hex", metavar="FILE", help="Another firmware than the one shipped here."),
]
BaudOption = Annotated[
    int, typer.Option("--baud", metavar="BAUD", help="Rate of the board's bootloader.")
]
BOOTLOADER_BAUD = 115_200


@app.command("build")
def build(
    out: Annotated[
        Path,
        typer.Option(metavar="FILE.hex", help="Where to; its note FILE.toml stands beside it."),
    ] = Path("board.hex"),
    as_json: JsonOption = False,
) -> int:
    """Build the firmware from a checkout, with avr-gcc and without the Arduino core.

    A Raspberry Pi that only flashes needs none of this: the package ships the built firmware.

    Example: sphmctl firmware build --out board.hex
    """
    from sphmctl.board.build import build as build_image
    from sphmctl.board.image import SHIPPED, sha256_of

    image = build_image(out)
    document = {
        "hex": str(image.hex),
        "sha256": image.sha256,
        "flash_bytes": image.flash_bytes,
        "ram_bytes": image.ram_bytes,
        "version": image.version,
        "build_hash": f"{image.build_hash:08x}",
        "protocol_version": f"{image.protocol:04x}",
        "as_shipped": SHIPPED.exists() and sha256_of(SHIPPED) == image.sha256,
    }
    put(as_json, document, _show_build)
    return 0


def _show_build(document: dict[str, Any]) -> None:
    print(f"{document['hex']}: version {document['version']}, build {document['build_hash']}")
    print(f"flash {document['flash_bytes']} bytes, RAM {document['ram_bytes']} bytes")
    print("the same as shipped" if document["as_shipped"] else "not the same as shipped")


@app.command("flash")
def flash(
    port: PortOption,
    hex_file: HexOption = None,
    baud: BaudOption = BOOTLOADER_BAUD,
    as_json: JsonOption = False,
) -> int:
    """Write the firmware to the board, an Arduino Mega 2560, and verify it.

    Asks the bootloader first which board this is, then runs avrdude
    (apt install avrdude). Takes a few seconds; the board's outputs are off then.

    Example: sphmctl firmware flash --port /dev/ttyACM0
    """
    from sphmctl.board.flash import flash as flash_image
    from sphmctl.board.image import SHIPPED, load

    image = load(hex_file or SHIPPED)
    done = flash_image(port, image, baud, say)
    document = {
        "port": port,
        "hex": str(image.hex),
        "sha256": image.sha256,
        "flash_bytes": image.flash_bytes,
        "version": image.version,
        "build_hash": f"{image.build_hash:08x}",
        "verified": True,
        "seconds": round(done.seconds, 2),
    }
    put(as_json, document, _show_flash)
    return 0


def _show_flash(document: dict[str, Any]) -> None:
    print(
        f"{document['port']}: {document['flash_bytes']} bytes written and verified "
        f"in {document['seconds']} s"
    )


@app.command("check")
def check(
    port: PortOption,
    verify: Annotated[
        bool, typer.Option("--verify", help="Compare the flash too, through the bootloader.")
    ] = False,
    baud: BaudOption = BOOTLOADER_BAUD,
    as_json: JsonOption = False,
) -> int:
    """Tell what firmware the board runs: match, older, newer, foreign or silent.

    Writes nothing. Opening the port resets the board, so that this takes 2 s.
    Exit code 0 only for match.

    Example: sphmctl firmware check --port /dev/ttyACM0 --verify
    """
    from dataclasses import asdict

    from sphmctl import clock
    from sphmctl.board import check as checking
    from sphmctl.board.image import load
    from sphmctl.board.port import look_at

    look_at(port)
    shipped = load()
    report = clock.run(checking.check(checking.serial_opener(port), port, shipped))
    if verify:
        report = checking.compare_flash(report, port, shipped, baud)
    document = asdict(report) | {
        "port": port,
        "shipped": {"version": shipped.version, "build_hash": f"{shipped.build_hash:08x}"},
    }
    put(as_json, document, _show_check)
    return 0 if report.state == "match" else EXIT_DEVICE


def _show_check(document: dict[str, Any]) -> None:
    print(f"{document['state']}: {document['detail']}")
    if document["protocol_version"] is not None:
        print(f"protocol version {document['protocol_version']}")
    if document["verified"] is not None:
        print("flash as shipped" if document["verified"] else "flash differs from the shipped one")
    for name, value in document["counters"].items():
        print(f"{name:22} {value}")


@app.command("simulate")
def simulate(
    hex_file: HexOption = None,
    bootloader: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Start each reset in this bootloader, as a board does."),
    ] = None,
    link: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A symbolic link to set up for the host's port."),
    ] = None,
    bus_link: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A symbolic link to set up for the servo bus."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Run the compiled firmware in an AVR simulator: its host port and servo bus as serial ports.

    Prints one JSON line when ready, then serves until Ctrl-C or SIGTERM. Opening
    the host's port resets the board, as on an Arduino. The inputs are at rest:
    emergency stop released, no voltage from the controller. Takes a checkout of
    the repository, gcc and libsimavr-dev.

    Example: sphmctl firmware simulate --link /tmp/board --bus-link /tmp/bus
    """
    from sphmctl import clock
    from sphmctl.board.image import SHIPPED, hex_bytes
    from sphmctl.emulators.board import Options

    firmware = hex_file or SHIPPED
    for image in (firmware, *([bootloader] if bootloader else [])):
        hex_bytes(image)
    say("EMULATED: no robot will move")
    options = Options(
        firmware, bootloader=bootloader, host_link=link, bus_pty=True, bus_link=bus_link
    )
    clock.run(_simulate(options))
    return 0


async def _simulate(options: Options) -> None:
    from sphmctl.emulators.board import Board
    from sphmctl.emulators.board_process import BoardError
    from sphmctl.emulators.lines import Loose, Wiring

    done, lose = until_told()
    try:
        board = Board(options, "paced")
    except BoardError as error:
        raise InvalidError(str(error), "simulated board") from error
    board.on.lost = lambda error: lose(DeviceError(str(error), "simulated board"))
    # The controller's end of the lines, at rest; then a power-up that has never seen them float.
    Wiring(Loose(), board, lambda: None)
    board.reset()
    try:
        print(json.dumps({"port": board.port, "bus": board.bus_port}), flush=True)
        await done
    finally:
        board.close()
