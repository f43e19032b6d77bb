"""One definition of the control table: all that follows from it is up to date and agrees."""

from __future__ import annotations

from pathlib import Path

import pytest

from sphmctl.wire import board_table
from tests.firmware.rig import Rig
from tools import draw_board, make_board_table


@pytest.mark.parametrize("path", make_board_table.outputs(), ids=lambda path: Path(path).name)
def test_what_is_written_from_the_table_is_up_to_date(path: Path) -> None:
    assert path.read_text() == make_board_table.outputs()[path], (
        f"{path.name} is not what tools/make_board_table.py writes; run it"
    )


def test_the_protocol_version_follows_the_table_and_not_its_prose(tmp_path: Path) -> None:
    text = make_board_table.DEFINITION.read_text()
    file = tmp_path / "table.toml"

    def version_of(changed: str) -> int:
        assert changed != text
        file.write_text(changed)
        return make_board_table.read_table(file).protocol

    version = board_table.BOARD_PROTOCOL
    assert version_of(text.replace("of the servo bus", "of the bus")) == version
    assert version_of(text.replace("revision = 1", "revision = 2")) != version
    assert version_of(text.replace('name = "UPTIME"', 'name = "AGE"')) != version
    assert version_of(text.replace("max = 127", "max = 126")) != version


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("address = 6\n", "address = 5\n", "FIRMWARE_VERSION: address 5; 6 or more"),
        ('access = "RW"', 'access = "W"', "access 'W'; R or RW would be right"),
        ("address = 162\nsize = 2", "address = 162\nsize = 4", "HOST_CRC_ERRORS: crosses"),
        ("address = 68\n", "address = 65\n", "STATUS_RETURN_LEVEL: touches a writable item"),
        ("default = 60200", "default = 60201", "MODEL_NUMBER: default 60201; 60200"),
    ],
)
def test_a_table_that_the_firmware_could_not_keep_is_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    file = tmp_path / "table.toml"
    file.write_text(make_board_table.DEFINITION.read_text().replace(old, new, 1))
    with pytest.raises(SystemExit, match=message):
        make_board_table.read_table(file)


def test_the_firmware_starts_with_the_defaults_of_the_python_table(rig: Rig) -> None:
    starts_otherwise = {"PROTOCOL_VERSION", "RESETS", "RESET_CAUSE", "HINDRANCES", "BUILD_HASH"}
    starts_otherwise |= {"BOARD_CLOCK", "LONGEST_PASS"}
    for item in board_table.ITEMS:
        if item.name not in starts_otherwise:
            assert rig.table(item.address, item.size) == item.default, item.name
    assert rig.table(board_table.PROTOCOL_VERSION.address, 2) == board_table.BOARD_PROTOCOL


def test_the_model_is_none_of_those_that_robotis_has_taken() -> None:
    taken = [range(1, 4171), range(35074, 54026), [0x5000, 0x5005, 10200]]
    assert all(board_table.BOARD_MODEL not in numbers for numbers in taken)


def test_the_wiring_drawing_is_the_one_that_its_script_draws() -> None:
    assert draw_board.DRAWING.read_text() == draw_board.drawing()
