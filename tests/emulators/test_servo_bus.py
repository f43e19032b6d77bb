"""Who answers on the bus, in which order and when; what broken bytes do."""

import random

import pytest

from sphmctl.emulators.xl430 import Servo
from tests.emulators.servo_rig import Rig, crc, frame, read, sync_read, write

PING_1 = bytes.fromhex("FF FF FD 00 01 03 00 01 19 4E")
PING_ALL = bytes.fromhex("FF FF FD 00 FE 03 00 01 31 42")
BLOCK_ALL = sync_read((1, 2, 3), 126, 10)
FAST_ALL = sync_read((1, 2, 3), 126, 10, 0x8A)
GOAL_1000 = write(1, 116, (1000).to_bytes(4, "little"))


def ids(stream: bytes) -> list[int]:
    """IDs of the statuses in a stream without stuffing."""
    found = []
    while stream:
        assert stream[:4] == b"\xff\xff\xfd\x00"
        end = 7 + int.from_bytes(stream[5:7], "little")
        assert stream[end - 2 : end] == crc(stream[: end - 2])
        found.append(stream[4])
        stream = stream[end:]
    return found


@pytest.mark.parametrize(("dead", "answers"), [(1, []), (2, [1]), (3, [1, 2]), (0, [1, 2, 3])])
def test_a_silent_servo_hides_all_after_it_in_a_sync_read(dead: int, answers: list[int]) -> None:
    with Rig() as rig:
        if dead:
            rig.servos[dead - 1].unplug()
        assert ids(rig.ask(BLOCK_ALL)) == answers


@pytest.mark.parametrize(("dead", "size"), [(1, 0), (2, 8 + 14), (3, 8 + 28), (0, 50)])
def test_a_silent_servo_cuts_a_fast_sync_read_short(dead: int, size: int) -> None:
    with Rig() as rig:
        whole = rig.ask(FAST_ALL)
        if dead:
            rig.servos[dead - 1].unplug()
        answer = rig.ask(FAST_ALL)
        assert len(answer) == size
        assert answer[:8] == whole[: min(8, size)]


def test_a_servo_too_old_for_fast_reads_is_silent_in_them_and_refuses_a_backup() -> None:
    with Rig([Servo(random.Random(1), 1, firmware=44)]) as rig:
        assert rig.ask(FAST_ALL) == b""
        assert rig.error(frame(1, 0x20, b"\x01CTRL")) == 2


def test_sync_read_answers_in_the_order_of_the_list_and_ping_in_the_order_of_ids() -> None:
    rng = random.Random(1)
    with Rig([Servo(rng, servo_id) for servo_id in (9, 2, 5)]) as rig:
        assert ids(rig.ask(sync_read((5, 9, 2), 132, 4))) == [5, 9, 2]
        assert ids(rig.ask(PING_ALL)) == [2, 5, 9]


def test_a_bulk_read_that_names_an_id_twice_is_ignored() -> None:
    with Rig() as rig:
        once, twice = bytes.fromhex("0184000400"), bytes.fromhex("01840004000192000100")
        assert ids(rig.ask(frame(0xFE, 0x92, once))) == [1]
        assert rig.ask(frame(0xFE, 0x92, twice)) == b""


def test_two_servos_with_one_id_talk_at_once_and_the_frame_breaks() -> None:
    rng = random.Random(1)
    with Rig([Servo(rng, 1, 100), Servo(rng, 1, 3000)]) as rig:
        answer = rig.ask(read(1, 132, 4))
        assert len(answer) == 15
        assert answer[-2:] != crc(answer[:-2])


@pytest.mark.parametrize(
    ("level", "answers"), [(0, (True, False, False)), (1, (True, True, False)), (2, (True,) * 3)]
)
def test_the_status_return_level_decides_who_is_answered(
    level: int, answers: tuple[bool, ...]
) -> None:
    with Rig() as rig:
        rig.ask(write(1, 68, bytes((level,))))
        for packet, wanted in zip((PING_1, read(1, 7, 1), GOAL_1000), answers, strict=True):
            assert bool(rig.ask(packet)) == wanted
        assert rig.servos[0].read(116, 4) == (0, (1000).to_bytes(4, "little"))


def test_reads_and_pings_of_everybody_differ() -> None:
    with Rig() as rig:
        assert rig.ask(read(0xFE, 132, 4)) == b""
        assert ids(rig.ask(PING_ALL)) == [1, 2, 3]


def test_an_unknown_instruction_is_answered_with_error_2_by_the_addressed_servo_alone() -> None:
    with Rig() as rig:
        assert rig.error(frame(2, 0x44)) == 2
        assert rig.ask(frame(0xFE, 0x44)) == b""


def test_a_group_obeys_its_secondary_id_in_silence_but_keeps_its_eeprom() -> None:
    with Rig() as rig:
        for servo_id in (1, 2):
            rig.ask(write(servo_id, 12, b"\x32"))
        assert rig.ask(write(0x32, 65, b"\x01")) == b""
        assert [rig.value(i, 65, 1) for i in (1, 2, 3)] == [1, 1, 0]
        assert rig.ask(write(0x32, 31, b"\x30")) == b""
        assert rig.value(1, 31, 1) == 72


def test_a_frame_paused_for_more_than_one_and_a_half_milliseconds_is_dropped() -> None:
    with Rig() as rig:
        assert rig.ask(PING_1[:5], wait_s=0.0014) == b""
        assert ids(rig.ask(PING_1[5:])) == [1]
        assert rig.ask(PING_1[:5], wait_s=0.0017) == b""
        assert rig.ask(PING_1[5:]) == b""
        assert ids(rig.ask(PING_1)) == [1]


def test_the_frame_after_a_cut_one_is_found() -> None:
    with Rig() as rig:
        assert ids(rig.ask(BLOCK_ALL[:9] + PING_1)) == [1]
        assert ids(rig.ask(BLOCK_ALL[:6] + PING_1 + PING_1)) == [1, 1]
        # Two cut frames in a row, the first of nothing but a header.
        assert ids(rig.ask(GOAL_1000[:4] + PING_1[:7] + GOAL_1000)) == [1]


def test_a_servo_at_another_baud_rate_hears_nothing() -> None:
    rng = random.Random(1)
    servos = [Servo(rng, 1, baud_code=1, return_delay=250), Servo(rng, 2)]
    with Rig(servos) as rig:
        assert ids(rig.ask(PING_ALL)) == [2]
    with Rig(servos, baud=57_600) as rig:
        assert ids(rig.ask(PING_ALL)) == [1]


def test_a_new_baud_rate_counts_after_the_answer() -> None:
    with Rig() as rig:
        assert ids(rig.ask(write(1, 8, b"\x01"))) == [1]
        assert rig.ask(PING_1) == b""


def test_a_new_id_counts_after_the_answer() -> None:
    with Rig() as rig:
        assert ids(rig.ask(write(1, 7, b"\x0b"))) == [1]
        assert rig.ask(PING_1) == b""
        assert ids(rig.ask(frame(11, 0x01))) == [11]


def test_a_goal_counts_from_the_last_byte_of_its_frame_on_the_wire() -> None:
    with Rig(baud=9600, servos=[Servo(random.Random(1), baud_code=0)]) as rig:
        rig.ask(GOAL_1000, wait_s=len(GOAL_1000) * 10 / 9600 - 1e-4)
        assert rig.servos[0].table["goal_position"] == 2048
        rig.wait(2e-4)
        assert rig.servos[0].table["goal_position"] == 1000


@pytest.mark.parametrize(
    ("packet", "return_delay", "table_s", "turnarounds"),
    [
        (BLOCK_ALL, 0, 800e-6, 3),
        (BLOCK_ALL, 250, 2300e-6, 3),
        (FAST_ALL, 0, 670e-6, 1),
        (FAST_ALL, 250, 1170e-6, 1),
    ],
)
def test_a_read_of_three_servos_takes_the_computed_wire_time(
    packet: bytes, return_delay: int, table_s: float, turnarounds: int
) -> None:
    # 17 bytes out, 63 or 50 back at 10 us a byte, the return delays, and 50 us per reply.
    rng = random.Random(1)
    with Rig([Servo(rng, i, return_delay=return_delay) for i in (1, 2, 3)]) as rig:
        begin_s = rig.loop.time()
        rig.ask(packet)
        assert rig.pipe.pieces[-1][0] - begin_s == pytest.approx(table_s + turnarounds * 50e-6)


def test_an_instruction_waits_until_the_answers_before_it_are_off_the_wire() -> None:
    with Rig() as rig:
        begin_s = rig.loop.time()
        assert ids(rig.ask(PING_1 + PING_1)) == [1, 1]
        times = [at - begin_s for at, _ in rig.pipe.pieces]
        assert times == pytest.approx([290e-6, 580e-6])


def test_the_adapter_delays_answers_by_up_to_its_flush_period_and_keeps_one_phase() -> None:
    with Rig(usb="16u2") as rig:
        phases, delays = set(), []
        for _ in range(200):
            begin_s = rig.loop.time()
            rig.ask(PING_1, wait_s=0.0073)
            for at, _ in rig.pipe.pieces:
                phases.add(round(at / 4.096e-3 % 1, 6) % 1)
            delays.append(rig.pipe.pieces[-1][0] - begin_s - 290e-6)
        assert len(phases) == 1
        assert -1e-9 <= min(delays) < 0.2e-3
        assert 3.9e-3 < max(delays) <= 4.096e-3 + 1e-9


def test_the_adapter_sends_at_once_what_exceeds_96_bytes() -> None:
    with Rig(usb="16u2") as rig:
        begin_s = rig.loop.time()
        answer = rig.ask(read(1, 0, 147), read(2, 0, 147))
        assert len(answer) == 2 * 158
        sizes = [len(piece) for _, piece in rig.pipe.pieces]
        assert max(sizes) >= 97
        full = [at - begin_s for at, piece in rig.pipe.pieces if len(piece) == 97]
        assert full[0] <= 140e-6 + 50e-6 + 97 * 10e-6 + 1e-9


def test_an_unpaced_bus_answers_within_the_call() -> None:
    with Rig(pacing=False, usb="16u2") as rig:
        begin_s = rig.loop.time()
        assert ids(rig.ask(BLOCK_ALL, wait_s=0.0)) == [1, 2, 3]
        assert rig.loop.time() == begin_s


def test_random_and_mutated_frames_never_break_the_bus() -> None:
    rng = random.Random(7)
    good = [PING_1, BLOCK_ALL, FAST_ALL, GOAL_1000, PING_ALL, write(1, 168, b"\x84\x00")]
    with Rig(pacing=False) as rig:
        packets = []
        for _ in range(3000):
            packet = bytearray(rng.choice(good))
            for _ in range(rng.randrange(1, 4)):
                packet[rng.randrange(len(packet))] = rng.choice((0, 0xFD, 0xFF, rng.randrange(256)))
            packets.append(bytes(packet[: rng.randrange(len(packet) + 1)]))
        rig.ask(*packets)
        assert 1 in ids(rig.ask(PING_1))


def test_any_instruction_with_a_right_crc_is_survived() -> None:
    rng = random.Random(8)
    codes = [1, 2, 3, 4, 5, 0x10, 0x20, 0x82, 0x83, 0x8A, 0x92, 0x93, 0x9A, 0x55, 0x77]
    with Rig(pacing=False) as rig:
        for _ in range(3000):
            params = rng.randbytes(rng.randrange(24))
            if rng.random() < 0.5:  # addresses and lengths that make sense
                params = (
                    bytes((rng.randrange(256), rng.randrange(3), rng.randrange(12), 0)) + params
                )
            # IDs stay as they are: EEPROM is locked.
            for servo in rig.servos:
                servo.table["torque_enable"] = 1
            servo_id, code = rng.choice((1, 2, 3, 0xFE, 0x32)), rng.choice(codes)
            rig.ask(frame(servo_id, code, params), wait_s=0.001)
        rig.wait(0.5)
        assert rig.ask(PING_1)[4] == 1


def test_how_often_somebody_looks_changes_nothing() -> None:
    ends = []
    for looks in (1, 40):
        with Rig() as rig:
            for servo_id in (1, 2, 3):
                rig.ask(write(servo_id, 64, b"\x01"), wait_s=0.002)
            rig.ask(write(1, 108, bytes.fromhex("14000000 64000000 E8030000")), wait_s=0.0)
            for _ in range(looks):
                rig.ask(BLOCK_ALL, wait_s=0.4 / looks)
            rig.ask(wait_s=1.0 - (rig.loop.time() - rig.world.start_s))
            answer = rig.ask(BLOCK_ALL)
            ends.append(([servo.true_ticks for servo in rig.servos], answer))
    assert ends[0] == ends[1]


def test_a_link_that_is_lost_may_be_followed_by_another() -> None:
    with Rig() as rig:
        rig.ask(BLOCK_ALL[:9], wait_s=0.0)
        first = rig.pipe
        first.on_lost()
        rig.bus.attach(first)
        assert ids(rig.ask(PING_1)) == [1]
        rig.loop.run_until_complete(rig.bus.close())
        assert first.closed


def test_the_same_seed_gives_the_same_bytes_at_the_same_instants() -> None:
    runs = []
    for _ in range(2):
        with Rig(usb="16u2", seed=11) as rig:
            rig.ask(write(1, 64, b"\x01") + write(2, 64, b"\x01"))
            rig.ask(GOAL_1000)
            rig.ask(BLOCK_ALL * 5, wait_s=0.1)
            runs.append(list(rig.pipe.pieces))
    assert runs[0] == runs[1]
    assert runs[0]
