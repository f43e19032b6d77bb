"""The firmware's parser: golden frames, every split point, stuffing, random and mutated bytes."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from sphmctl.wire import dxl
from tests.firmware.rig import Rig
from tests.wire import dxl_reference
from tests.wire.chunks import load

NOTHING, HEAD, FRAME, BAD_CRC, IMPOSSIBLE = range(5)
VECTORS = [entry for table in load("dxl_frames.toml").values() for entry in table]
ALL = [entry["hex"] for entry in VECTORS]

# Twelve million in all.
RANDOM_BYTES = 10_000_000
BOARD_BYTES = 2_000_000


def events(rig: Rig, data: bytes) -> list[tuple[int, ...]]:
    """What a new parser says to each byte: event, id, instruction, length, first parameter."""
    return [tuple(map(int, words[1:])) for words in rig.tell(f"parse {data.hex()}")]


@pytest.mark.parametrize("entry", VECTORS, ids=lambda entry: str(entry["what"]))
def test_a_golden_frame_is_found_and_the_python_codec_finds_the_same(
    bare: Rig, entry: dict[str, Any]
) -> None:
    frame = entry["hex"]
    said = events(bare, frame)
    assert [event for event, *_ in said] == [*[NOTHING] * 6, HEAD, *[NOTHING] * (len(frame) - 8), 2]
    length = frame[5] + (frame[6] << 8)
    first = frame[8] if length > 3 else 0
    assert said[-1] == (FRAME, frame[4], frame[7], length, first)
    splitter = dxl.Splitter()
    splitter.feed(frame)
    assert splitter.next_frame() == frame


@pytest.mark.parametrize("frame", ALL)
def test_a_frame_cut_anywhere_is_no_frame_and_damaged_anywhere_is_none(
    bare: Rig, frame: bytes
) -> None:
    for cut in range(len(frame)):
        assert FRAME not in [event for event, *_ in events(bare, frame[:cut])]
    for at in range(4, len(frame)):
        damaged = bytearray(frame)
        damaged[at] ^= 0x10
        assert FRAME not in [event for event, *_ in events(bare, bytes(damaged))]


@pytest.mark.parametrize("noise", ["ff", "ffff", "fffffd", "fffffdfd", "00", "fffffffd", "fffd00"])
def test_a_frame_is_found_behind_noise_that_looks_like_a_header(bare: Rig, noise: str) -> None:
    assert events(bare, bytes.fromhex(noise) + ALL[0])[-1][0] == FRAME


@pytest.mark.parametrize(
    "head",
    [
        "fffffd00fd",  # id 253
        "fffffd00ff",  # id 255
        "fffffd00010200",  # shorter than instruction and CRC
        "fffffd0001fa03",  # longer than 1024 bytes in all
    ],
)
def test_an_impossible_header_is_said_at_once_and_the_next_frame_found(
    bare: Rig, head: str
) -> None:
    start = bytes.fromhex(head)
    said = [event for event, *_ in events(bare, start + ALL[0])]
    assert said[len(start) - 1] == IMPOSSIBLE
    assert said[-1] == FRAME


@pytest.mark.parametrize("size", [1, 247, 248, 249, 250, 251, 252, 253, 254, 505, 506, 507, 1013])
def test_lengths_around_each_multiple_of_256_are_counted_right(bare: Rig, size: int) -> None:
    frame = dxl_reference.frame(7, bytes([3]) + bytes(i % 251 for i in range(size)))
    said = [event for event, *_ in events(bare, frame + ALL[0])]
    assert [at for at, event in enumerate(said) if event == FRAME] == [
        len(frame) - 1,
        len(frame) + len(ALL[0]) - 1,
    ]


def test_every_short_string_of_the_stuffed_bytes_is_stuffed_and_comes_back(bare: Rig) -> None:
    for size in range(1, 6):
        for body in itertools.product(b"\xff\xfd\x00", repeat=size):
            plain = bytes(body)
            ((_, stuffed),) = bare.tell(f"stuff {plain.hex()}")
            assert bytes.fromhex(stuffed) == dxl_reference.stuff(plain)
            ((_, back),) = bare.tell(f"unstuff {stuffed}")
            assert bytes.fromhex(back) == plain


def test_ten_million_random_and_mutated_bytes_never_pass_a_wrong_crc(bare: Rig) -> None:
    for frame in ALL:
        bare.tell(f"example {frame.hex()}")
    bare.tell("seed 1")
    ((_, count, found),) = bare.tell(f"fuzz_parser {RANDOM_BYTES}")
    assert int(count) == RANDOM_BYTES
    assert int(found) > RANDOM_BYTES // 100


def test_a_board_in_random_and_mutated_traffic_sends_whole_frames_and_nothing_unsafe(
    rig: Rig,
) -> None:
    for frame in ALL:
        rig.tell(f"example {frame.hex()}")
    for code in (1, 2, 3, 4, 5, 0x82, 0x83):
        rig.tell(f"example {dxl_reference.frame(200, bytes([code, 98, 0, 0])).hex()}")
        for size in range(4):
            rig.tell(f"example {dxl_reference.frame(1, bytes([code, *range(size)])).hex()}")
    rig.tell(f"example {dxl_reference.status(2, b'', error=0x80).hex()}")
    for value in (0, 1):
        rig.tell(f"example {dxl_reference.frame(1, bytes([3, 64, 0, value])).hex()}")
    # Safe state, faults, arm, watchdog, wrist ok: at once, for it is seldom drawn in this order.
    steps = ((98, 0), (70, 0), (64, 1), (98, 5), (116, 1))
    arming = [dxl_reference.frame(200, bytes([3, item, 0, value])).hex() for item, value in steps]
    rig.tell(f"example {''.join(arming)}")
    rig.tell("low 4")
    rig.tell("seed 2")
    ((_, count, sent, rises),) = rig.tell(f"fuzz {BOARD_BYTES}")
    assert int(count) >= BOARD_BYTES
    assert int(sent) > BOARD_BYTES // 500
    assert int(rises) > 20
