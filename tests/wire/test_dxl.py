"""Protocol 2.0, receiving: golden bytes, every cut, garbage, damage, stuffing, fast reads."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from dynamixel_sdk.protocol2_packet_handler import Protocol2PacketHandler
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.errors import DeviceError
from sphmctl.wire import dxl
from tests.wire import dxl_reference
from tests.wire.chunks import cut, load

FRAMES = load("dxl_frames.toml")
ALL = [entry for table in FRAMES.values() for entry in table]
PIECES = st.lists(st.integers(1, 9), min_size=1, max_size=8)
IDS = st.integers(0, dxl.MAX_ID)
# Mostly the bytes that headers and stuffing are made of.
TRICKY = st.lists(st.sampled_from([0xFF, 0xFF, 0xFD, 0x00, 0x55, 0x01]), max_size=40).map(bytes)


def what(entry: dict[str, Any]) -> str:
    return str(entry["what"])


def frames_of(splitter: dxl.Splitter, pieces: Any) -> list[bytes]:
    found = []
    for piece in pieces:
        splitter.feed(piece)
        while (frame := splitter.next_frame()) is not None:
            found.append(frame)
    return found


def expected(entry: dict[str, Any]) -> dxl.Status:
    data = bytes.fromhex(entry["data"])
    return dxl.Status(entry["id"], entry.get("error", 0), entry.get("alert", False), data)


def lengths_of(entry: dict[str, Any]) -> list[tuple[int, int]]:
    return [(device_id, len(bytes.fromhex(data))) for device_id, data in entry["blocks"]]


def sdk_crc(data: bytes) -> int:
    return int(Protocol2PacketHandler().updateCRC(0, data, len(data)))


class SdkPort:
    """What dynamixel-sdk needs in order to receive bytes that are already there."""

    is_using = False

    def __init__(self, data: bytes) -> None:
        self._data = list(data)
        self.readPort = self._read
        self.isPacketTimeout = lambda: not self._data

    def _read(self, length: int) -> list[int]:
        taken, self._data = self._data[:length], self._data[length:]
        return taken


def test_the_check_value_of_the_crc() -> None:
    assert dxl.crc16(b"123456789") == 0xFEE8
    assert dxl.crc16(b"") == 0


@given(st.binary(max_size=80), st.binary(max_size=80))
def test_the_crc_is_that_of_dynamixel_sdk_and_can_go_on(first: bytes, second: bytes) -> None:
    assert dxl.crc16(first) == sdk_crc(first) == dxl_reference.crc(first)
    assert dxl.crc16(second, dxl.crc16(first)) == sdk_crc(first + second)


@pytest.mark.parametrize("entry", ALL, ids=what)
def test_a_frame_is_found_whole_and_byte_by_byte(entry: dict[str, Any]) -> None:
    for sizes in ([1], [1000]):
        splitter = dxl.Splitter()
        assert frames_of(splitter, cut(entry["hex"], sizes)) == [entry["hex"]]
        assert (splitter.pending_bytes, splitter.garbage_bytes, splitter.crc_errors) == (0, 0, 0)


@given(PIECES)
def test_a_stream_of_frames_is_read_however_it_is_cut(sizes: list[int]) -> None:
    stream = b"".join(entry["hex"] for entry in ALL)
    assert frames_of(dxl.Splitter(), cut(stream, sizes)) == [entry["hex"] for entry in ALL]


@pytest.mark.parametrize("entry", ALL, ids=what)
def test_a_cut_frame_is_waited_for(entry: dict[str, Any]) -> None:
    for size in range(len(entry["hex"])):
        splitter = dxl.Splitter()
        assert frames_of(splitter, [entry["hex"][:size]]) == []
        assert splitter.pending_bytes == size


@pytest.mark.parametrize("entry", FRAMES["status"], ids=what)
def test_a_status_is_read(entry: dict[str, Any]) -> None:
    assert dxl.parse_status(entry["hex"]) == expected(entry)


@given(IDS, st.integers(0, 255), TRICKY | st.binary(max_size=60), PIECES)
def test_any_status_comes_through(
    device_id: int, error: int, data: bytes, sizes: list[int]
) -> None:
    packet = dxl_reference.status(device_id, data, error)
    frames = frames_of(dxl.Splitter(), cut(packet, sizes))
    assert frames == [packet]
    status = dxl.parse_status(frames[0])
    assert status == dxl.Status(device_id, error & 0x7F, error >= 0x80, data)


def test_every_short_string_of_the_stuffed_bytes_comes_through() -> None:
    for size in range(8):
        for body in itertools.product(b"\xff\xfd\x00", repeat=size):
            data = bytes(body)
            assert dxl.parse_status(dxl_reference.status(1, data)).data == data


@given(IDS, st.integers(0, 7), st.binary(min_size=4, max_size=4))
def test_dynamixel_sdk_reads_the_same_from_the_same_bytes(
    device_id: int, error: int, data: bytes
) -> None:
    packet = dxl_reference.status(device_id, data, error)
    received, result, sdk_error = Protocol2PacketHandler().readRx(SdkPort(packet), device_id, 4)
    status = dxl.parse_status(packet)
    assert (result, sdk_error, bytes(received)) == (0, status.error, status.data)


@pytest.mark.parametrize(
    "frame",
    [
        FRAMES["instruction"][0]["hex"],
        FRAMES["instruction"][3]["hex"],
        dxl_reference.frame(1, b"\x55"),
    ],
)
def test_an_echo_or_a_status_without_error_byte_is_no_status(frame: bytes) -> None:
    (whole,) = frames_of(dxl.Splitter(), [frame])
    with pytest.raises(dxl.DxlProtocolError, match=r"a status \(0x55\) of 11 bytes"):
        dxl.parse_status(whole)


@given(TRICKY | st.binary(max_size=60), PIECES)
def test_a_frame_is_found_behind_garbage(garbage: bytes, sizes: list[int]) -> None:
    packet = FRAMES["status"][3]["hex"]
    splitter = dxl.Splitter()
    frames = frames_of(splitter, cut(garbage + packet, sizes))
    while packet not in frames and splitter.pending_bytes:
        splitter.skip_stalled()
        frames += frames_of(splitter, [b""])
    assert frames[-1] == packet


@pytest.mark.parametrize("garbage", [b"\x00", b"\xff", b"\xff\xff", b"\xff\xff\xfd\xfd", b"noise"])
def test_garbage_is_counted(garbage: bytes) -> None:
    packet = FRAMES["status"][3]["hex"]
    splitter = dxl.Splitter()
    assert frames_of(splitter, cut(garbage + packet + garbage, [1])) == [packet]
    assert splitter.garbage_bytes + splitter.pending_bytes == 2 * len(garbage)
    assert splitter.discard() == splitter.pending_bytes or splitter.pending_bytes == 0
    assert splitter.garbage_bytes == 2 * len(garbage)


def test_every_damaged_byte_loses_only_its_own_frame() -> None:
    packet = FRAMES["status"][3]["hex"]
    good = FRAMES["status"][4]["hex"]
    for at in range(len(packet)):
        damaged = bytearray(packet)
        damaged[at] ^= 0x40
        splitter = dxl.Splitter()
        frames = frames_of(splitter, [bytes(damaged) + good])
        if not frames:
            # The damaged length asks for bytes that will not come.
            splitter.skip_stalled()
            frames = frames_of(splitter, [b""])
        assert frames == [good]
        assert splitter.garbage_bytes == len(packet)


def test_a_damaged_frame_counts_as_a_crc_error() -> None:
    splitter = dxl.Splitter()
    assert frames_of(splitter, [FRAMES["status"][3]["hex"][:-1] + b"\x00"]) == []
    assert (splitter.crc_errors, splitter.header_errors) == (1, 0)


@pytest.mark.parametrize(
    "head",
    [
        "FF FF FD 00 01 02 00",  # length below instruction and CRC
        "FF FF FD 00 01 FA 03",  # one byte more than the longest frame
        "FF FF FD 00 FD 08 00",  # id 253
        "FF FF FD 00 FF 08 00",  # id 255
    ],
)
def test_a_header_that_no_frame_has_does_not_keep_us_waiting(head: str) -> None:
    packet = FRAMES["status"][3]["hex"]
    splitter = dxl.Splitter()
    assert frames_of(splitter, [bytes.fromhex(head) + packet]) == [packet]
    assert (splitter.header_errors, splitter.garbage_bytes) == (1, 7)


def test_the_longest_frame_is_taken() -> None:
    packet = dxl_reference.status(1, bytes(dxl.MAX_FRAME_BYTES - 11))
    assert len(packet) == 1024
    assert frames_of(dxl.Splitter(), [packet]) == [packet]


def test_a_crc_that_looks_like_a_header_does_not_cut_the_frame() -> None:
    # FF FF at the end of the data and a CRC that begins with FD, found by trying.
    packets = (dxl_reference.status(1, n.to_bytes(2, "big") + b"\xff\xff") for n in range(65536))
    packet = next(p for p in packets if p[-2:] == b"\xfd\x00")
    second = FRAMES["status"][3]["hex"]
    assert frames_of(dxl.Splitter(), cut(packet + second, [1])) == [packet, second]


def test_the_buffer_has_a_limit_and_keeps_the_newest_bytes() -> None:
    packet = FRAMES["status"][3]["hex"]
    splitter = dxl.Splitter()
    splitter.feed(bytes(3 * dxl.BUFFER_LIMIT_BYTES) + packet)
    assert splitter.pending_bytes == dxl.BUFFER_LIMIT_BYTES
    assert splitter.next_frame() == packet
    assert splitter.garbage_bytes == 3 * dxl.BUFFER_LIMIT_BYTES


def test_what_is_left_of_an_earlier_transaction_can_be_dropped() -> None:
    splitter = dxl.Splitter()
    splitter.feed(FRAMES["status"][3]["hex"][:9])
    assert splitter.discard() == 9
    splitter.skip_stalled()
    assert (splitter.pending_bytes, splitter.garbage_bytes) == (0, 9)
    assert frames_of(splitter, [FRAMES["status"][4]["hex"]]) == [FRAMES["status"][4]["hex"]]


@given(st.lists(TRICKY | st.binary(max_size=30), max_size=15))
def test_random_bytes_never_give_a_frame_with_a_wrong_crc(pieces: list[bytes]) -> None:
    splitter = dxl.Splitter()
    frames = frames_of(splitter, pieces)
    assert all(sdk_crc(f[:-2]) == int.from_bytes(f[-2:], "little") for f in frames)
    used = sum(map(len, frames)) + splitter.garbage_bytes + splitter.pending_bytes
    assert used == sum(map(len, pieces))


@pytest.mark.parametrize("entry", FRAMES["fast"], ids=what)
def test_a_fast_status_is_split(entry: dict[str, Any]) -> None:
    statuses = dxl.parse_fast_status(entry["hex"], lengths_of(entry))
    assert statuses == tuple(
        dxl.Status(device_id, 0, False, bytes.fromhex(data)) for device_id, data in entry["blocks"]
    )


@given(st.dictionaries(IDS, st.tuples(st.integers(0, 255), TRICKY), min_size=1, max_size=4), PIECES)
def test_any_fast_status_is_split_and_never_unstuffed(
    blocks: dict[int, tuple[int, bytes]], sizes: list[int]
) -> None:
    packet = dxl_reference.fast_status([(i, e, d) for i, (e, d) in blocks.items()])
    (frame,) = frames_of(dxl.Splitter(), cut(packet, sizes))
    lengths = [(i, len(d)) for i, (_, d) in blocks.items()]
    assert dxl.parse_fast_status(frame, lengths) == tuple(
        dxl.Status(i, e & 0x7F, e >= 0x80, d) for i, (e, d) in blocks.items()
    )


def test_dynamixel_sdk_reads_the_same_fast_status() -> None:
    blocks = [(1, 0, b"\xff\xff\xfd\xfd"), (2, 0x80, b"abcd")]
    packet = dxl_reference.fast_status(blocks)
    received, result, _ = Protocol2PacketHandler().fastSyncReadRx(SdkPort(packet), 0xFE, 16)
    assert result == 0
    statuses = dxl.parse_fast_status(packet, [(1, 4), (2, 4)])
    assert [s.data for s in statuses] == [bytes(received[2:6]), bytes(received[10:14])]


FAST = FRAMES["fast"][0]["hex"]


@pytest.mark.parametrize(
    ("frame", "lengths", "message"),
    [
        (FAST, [(3, 4), (4, 4), (7, 4)], "data of servo 7; 4 would be right"),
        (FAST, [(3, 4), (7, 4)], "fast status of 32 bytes; 24 would be right"),
        (FAST, [(3, 4), (7, 4), (4, 5)], "32 bytes; 33 would be right"),
        (FRAMES["status"][0]["hex"], [(1, 2)], "id 1; id 254 would be right"),
        (FRAMES["instruction"][1]["hex"], [(1, 2)], "instruction 0x01"),
    ],
)
def test_a_fast_status_that_was_not_asked_for_is_refused(
    frame: bytes, lengths: list[tuple[int, int]], message: str
) -> None:
    with pytest.raises(dxl.DxlProtocolError, match=message):
        dxl.parse_fast_status(frame, lengths)


def test_a_device_that_heard_the_others_wrong_is_named() -> None:
    blocks = [(3, 0, b"abcd"), (7, 0, b"efgh"), (4, 0, b"ijkl")]
    packet = bytearray(dxl_reference.fast_status(blocks))
    packet[22] ^= 1  # the CRC of servo 7, with a last CRC that covers it
    packet[-2:] = dxl_reference.crc(bytes(packet[:-2])).to_bytes(2, "little")
    (frame,) = frames_of(dxl.Splitter(), [bytes(packet)])
    with pytest.raises(dxl.DxlProtocolError, match="servo 7: wrong CRC"):
        dxl.parse_fast_status(frame, [(3, 4), (7, 4), (4, 4)])


def test_an_alert_keeps_its_data() -> None:
    status = dxl.parse_status(dxl_reference.status(2, b"\x20", 0x80))
    assert status.alert
    assert dxl.expect_data(status, 1) == b"\x20"


@pytest.mark.parametrize("length", [0, 3, 5])
def test_data_of_another_length_than_asked_for_are_refused(length: int) -> None:
    status = dxl.Status(2, 0, False, b"abcd")
    with pytest.raises(dxl.DxlProtocolError, match=f"servo 2: 4 data bytes; {length} would be"):
        dxl.expect_data(status, length)


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (1, "result fail"),
        (2, "unknown instruction"),
        (3, "CRC error"),
        (4, "data range error"),
        (5, "data length error"),
        (6, "data limit error"),
        (7, "EEPROM write with torque on"),
        (9, "error number 9, which the e-manual does not define"),
    ],
)
def test_an_error_number_becomes_a_sentence_with_the_servo(error: int, text: str) -> None:
    status = dxl.parse_status(dxl_reference.status(3, b"", 0x80 | error))
    with pytest.raises(dxl.ServoRefusedError, match=f"servo 3: .*{text}") as caught:
        dxl.expect_data(status, 4)
    assert (caught.value.device_id, caught.value.error) == (3, error)
    assert isinstance(caught.value, DeviceError)
