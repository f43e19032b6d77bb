"""Protocol 2.0, sending: golden bytes for every instruction, stuffing, and what must be refused."""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest
from dynamixel_sdk.protocol2_packet_handler import Protocol2PacketHandler
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.errors import InvalidError
from sphmctl.wire import dxl
from sphmctl.wire import dxl_instructions as instructions
from tests.wire import dxl_reference
from tests.wire.chunks import load

FRAMES = {entry["what"]: entry["hex"] for entry in load("dxl_frames.toml")["instruction"]}


def u32(number: int) -> bytes:
    return number.to_bytes(4, "little")


GOALS = {1: u32(2048), 2: u32(2048), 3: u32(2048)}
CALLS: dict[str, Callable[[], bytes]] = {
    "ping 1": lambda: instructions.ping(1),
    "ping all": instructions.ping,
    "ping 200": lambda: instructions.ping(200),
    "read 132, 4 bytes": lambda: instructions.read(1, 132, 4),
    "read 70, 1 byte": lambda: instructions.read(1, 70, 1),
    "write 116 = 512": lambda: instructions.write(1, 116, u32(512)),
    "write 64 = 1": lambda: instructions.write(1, 64, b"\x01"),
    "write 64 = 0 to all": lambda: instructions.write(dxl.BROADCAST_ID, 64, b"\x00"),
    "write 98 = 5": lambda: instructions.write(1, 98, b"\x05"),
    "write 98 = 0": lambda: instructions.write(1, 98, b"\x00"),
    "write 116, stuffed": lambda: instructions.write(1, 116, b"\xff\xff\xfd\x00"),
    "write 104, stuffed at the end": lambda: instructions.write(1, 104, b"\x00\xff\xff\xfd"),
    "write 224, stuffed twice": lambda: instructions.write(1, 224, b"\xff\xff\xfd" * 2),
    "write 224, data that look stuffed": lambda: instructions.write(1, 224, b"\xff\xff\xfd\xfd"),
    "reg write 104 = 200": lambda: instructions.reg_write(1, 104, u32(200)),
    "action 1": lambda: instructions.action(1),
    "action all": instructions.action,
    "factory reset 1, keep id": lambda: instructions.factory_reset(
        1, instructions.RESET_ALL_BUT_ID
    ),
    "reboot 1": lambda: instructions.reboot(1),
    "reboot all": lambda: instructions.reboot(dxl.BROADCAST_ID),
    "clear multi-turn 1": lambda: instructions.clear_multi_turn(1),
    "backup 1": lambda: instructions.backup(1),
    "restore 1": lambda: instructions.restore(1),
    "sync read 132, 4 bytes of 1, 2": lambda: instructions.sync_read(132, 4, (1, 2)),
    "sync read 126, 10 bytes of 1, 2, 3": lambda: instructions.sync_read(126, 10, (1, 2, 3)),
    "sync write 116: 1 = 150, 2 = 170": lambda: instructions.sync_write(
        116, {1: u32(150), 2: u32(170)}
    ),
    "sync write 116 = 2048 to 1, 2, 3": lambda: instructions.sync_write(116, GOALS),
    "fast sync read 126, 10 bytes of 1, 2, 3": lambda: instructions.fast_sync_read(
        126, 10, (1, 2, 3)
    ),
    "fast sync read 132, 4 bytes of 3, 7, 4": lambda: instructions.fast_sync_read(
        132, 4, (3, 7, 4)
    ),
    "bulk read 1: 144, 2 bytes; 2: 146, 1 byte": lambda: instructions.bulk_read(
        {1: (144, 2), 2: (146, 1)}
    ),
    "bulk write 1: 32 = 160; 2: 31 = 80": lambda: instructions.bulk_write(
        {1: (32, b"\xa0\x00"), 2: (31, b"\x50")}
    ),
    "fast bulk read 3: 132, 4; 7: 124, 2; 4: 146, 1": lambda: instructions.fast_bulk_read(
        {3: (132, 4), 7: (124, 2), 4: (146, 1)}
    ),
}


def test_every_golden_instruction_is_built_here() -> None:
    assert CALLS.keys() == FRAMES.keys()


@pytest.mark.parametrize("what", FRAMES)
def test_an_instruction_has_the_golden_bytes(what: str) -> None:
    assert CALLS[what]() == FRAMES[what]


@pytest.mark.parametrize("what", FRAMES)
def test_an_instruction_is_built_again_after_any_other(what: str) -> None:
    assert [CALLS[what](), instructions.ping(1), CALLS[what]()] == [
        FRAMES[what],
        FRAMES["ping 1"],
        FRAMES[what],
    ]


@given(st.integers(0, dxl.MAX_ID), st.integers(0, 0xFFFF), st.binary(min_size=1, max_size=60))
def test_any_write_is_the_reference_frame(device_id: int, address: int, data: bytes) -> None:
    body = address.to_bytes(2, "little") + data
    assert instructions.write(device_id, address, data) == dxl_reference.frame(
        device_id, b"\x03" + body
    )
    assert instructions.reg_write(device_id, address, data) == dxl_reference.frame(
        device_id, b"\x04" + body
    )


def test_every_short_string_of_the_stuffed_bytes_is_stuffed_as_the_sdk_would() -> None:
    sdk = Protocol2PacketHandler()
    for size in range(1, 7):
        for body in itertools.product(b"\xff\xfd\x00", repeat=size):
            data = bytes(body)
            frame = instructions.write(1, 116, data)
            plain = [0xFF, 0xFF, 0xFD, 0, 1, size + 5, 0, 3, 116, 0, *data, 0, 0]
            assert frame[:-2] == bytes(sdk.addStuffing(plain))[:-2]
            assert sdk.updateCRC(0, frame, len(frame) - 2) == frame[-2] + (frame[-1] << 8)


@given(
    st.dictionaries(
        st.integers(0, dxl.MAX_ID), st.binary(min_size=4, max_size=4), min_size=1, max_size=20
    )
)
def test_any_sync_write_is_the_reference_frame(data_of: dict[int, bytes]) -> None:
    block = b"".join(bytes([i]) + data for i, data in data_of.items())
    assert instructions.sync_write(116, data_of) == dxl_reference.frame(
        0xFE, b"\x83\x74\x00\x04\x00" + block
    )


def test_the_longest_write_with_the_most_stuffing_fits() -> None:
    data = b"\xff\xff\xfd" * (instructions.MAX_PARAMETER_BYTES // 3)
    assert instructions.write(1, 0, data) == dxl_reference.frame(1, b"\x03\x00\x00" + data)


TOO_MUCH = bytes(instructions.MAX_PARAMETER_BYTES + 1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: instructions.ping(253), r"servo id 253; 0 to 252 or 254 \(all\)"),
        (lambda: instructions.ping(-1), "servo id -1"),
        (lambda: instructions.read(254, 132, 4), "servo id 254; 0 to 252 would be right"),
        (lambda: instructions.read(1, 65536, 4), "address 65536; 0 to 65535"),
        (lambda: instructions.read(1, -1, 4), "address -1"),
        (lambda: instructions.read(1, 132, 0), "length 0 bytes; 1 to 65535"),
        (lambda: instructions.read(1, 132, 65536), "length 65536 bytes"),
        (lambda: instructions.write(255, 64, b"\x01"), "servo id 255"),
        (lambda: instructions.write(1, 64, b""), "length 0 bytes"),
        (lambda: instructions.write(1, 64, TOO_MUCH), "701 parameter bytes; at most 700"),
        (lambda: instructions.reg_write(1, 64, b""), "length 0 bytes"),
        (lambda: instructions.factory_reset(1, 3), "reset option 3; 255, 1 or 2"),
        (lambda: instructions.factory_reset(254, 255), "servo id 254"),
        (lambda: instructions.clear_multi_turn(254), "servo id 254"),
        (lambda: instructions.backup(254), "servo id 254"),
        (lambda: instructions.sync_read(132, 4, ()), "no servo ids"),
        (lambda: instructions.sync_read(132, 4, (1, 2, 1)), r"\[1, 2, 1\]; each id once"),
        (lambda: instructions.sync_read(132, 4, (1, 254)), "servo id 254"),
        (lambda: instructions.fast_sync_read(132, 0, (1,)), "length 0 bytes"),
        (lambda: instructions.sync_write(116, {}), "no servo ids"),
        (lambda: instructions.sync_write(116, {1: u32(0), 2: b"\0"}), "1 bytes for servo 2; 4"),
        (lambda: instructions.sync_write(116, {1: TOO_MUCH}), "702 parameter bytes"),
        (lambda: instructions.bulk_read({}), "no servo ids"),
        (lambda: instructions.bulk_read(dict.fromkeys(range(150), (0, 1))), "750 parameter bytes"),
        (lambda: instructions.bulk_write({1: (0, TOO_MUCH[:-1])}), "705 parameter bytes"),
        (lambda: instructions.bulk_write({1: (0, b"")}), "length 0 bytes"),
        (lambda: instructions.fast_bulk_read({300: (0, 1)}), "servo id 300"),
    ],
)
def test_an_instruction_without_meaning_is_refused(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(InvalidError, match=message):
        call()


def test_the_sdk_is_not_imported_before_the_first_frame() -> None:
    code = (
        "import sys, sphmctl.wire.dxl_instructions as i\n"
        "assert not {'dynamixel_sdk', 'serial'} & set(sys.modules)\n"
        "i.ping(1)\n"
        "assert 'dynamixel_sdk' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=30)
