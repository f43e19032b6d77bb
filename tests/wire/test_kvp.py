"""KUKAVARPROXY frames: golden bytes, every cut of the stream, and what must be refused."""

from __future__ import annotations

import contextlib
import struct
from typing import Any

import py_openshowvar
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.errors import DeviceError, InvalidError
from sphmctl.wire import kvp
from tests.wire.chunks import cut, load

FRAMES = load("kvp_frames.toml")
NAMES = st.text(st.characters(min_codepoint=0x21, max_codepoint=0x7E), min_size=1, max_size=60)
TEXTS = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), min_size=1, max_size=300)
PIECES = st.lists(st.integers(1, 9), min_size=1, max_size=8)


def what(entry: dict[str, Any]) -> str:
    return str(entry.get("what", entry.get("name")))


def replies_of(pieces: Any) -> list[kvp.Reply]:
    decoder = kvp.Decoder()
    found = []
    for piece in pieces:
        decoder.feed(piece)
        while (reply := decoder.next_reply()) is not None:
            found.append(reply)
    assert decoder.pending_bytes == 0
    return found


def reply_frame(request_id: int, function: int, value: bytes, tail: bytes) -> bytes:
    """A reply written down from the layout, independently of the codec."""
    return struct.pack(">HHBH", request_id, len(value) + 6, function, len(value)) + value + tail


def expected(entry: dict[str, Any]) -> kvp.Reply:
    return kvp.Reply(entry["id"], entry["function"], entry["value"], entry["ok"])


@pytest.mark.parametrize("entry", FRAMES["request"], ids=what)
def test_a_request_has_the_bytes_that_other_clients_send(entry: dict[str, Any]) -> None:
    if "value" in entry:
        frame = kvp.encode_write(entry["id"], entry["name"], entry["value"])
    else:
        frame = kvp.encode_read(entry["id"], entry["name"])
    assert frame == entry["hex"]


@given(st.integers(0, 0xFFFF), NAMES, TEXTS)
def test_py_openshowvar_packs_the_same_requests(request_id: int, name: str, value: str) -> None:
    client = object.__new__(py_openshowvar.openshowvar)
    client.msg_id, client.varname, client.value = request_id, name.encode(), value.encode()
    assert kvp.encode_read(request_id, name) == client._pack_read_req()
    assert kvp.encode_write(request_id, name, value) == client._pack_write_req()


@pytest.mark.parametrize("entry", FRAMES["reply"], ids=what)
def test_a_reply_is_read_whole_and_byte_by_byte(entry: dict[str, Any]) -> None:
    assert replies_of([entry["hex"]]) == [expected(entry)]
    assert replies_of(cut(entry["hex"], [1])) == [expected(entry)]


@given(PIECES)
def test_a_stream_of_replies_is_read_however_it_is_cut(sizes: list[int]) -> None:
    stream = b"".join(entry["hex"] for entry in FRAMES["reply"])
    assert replies_of(cut(stream, sizes)) == [expected(entry) for entry in FRAMES["reply"]]


@given(
    st.integers(0, 0xFFFF),
    st.sampled_from([kvp.READ, kvp.WRITE]),
    st.binary(max_size=2000),
    st.sampled_from([b"\x00\x01\x01", b"\x00\x01\x00", b"\x00\x00\x00"]),
    PIECES,
)
def test_any_value_with_any_tail_comes_through(
    request_id: int, function: int, value: bytes, tail: bytes, sizes: list[int]
) -> None:
    frame = reply_frame(request_id, function, value, tail)
    answer = kvp.Reply(request_id, function, value.decode("latin-1"), tail[2] == 1)
    assert replies_of(cut(frame * 2, sizes)) == [answer, answer]


def test_the_longest_reply_is_read() -> None:
    frame = reply_frame(1, 0, b"x" * (0xFFFF - 6), b"\x00\x01\x01")
    assert replies_of([frame])[0].value == "x" * (0xFFFF - 6)


@pytest.mark.parametrize("entry", FRAMES["foreign"], ids=what)
def test_a_frame_that_is_not_ours_kills_the_decoder(entry: dict[str, Any]) -> None:
    decoder = kvp.Decoder()
    decoder.feed(entry["hex"])
    with pytest.raises(kvp.KvpProtocolError, match=entry["message"]):
        decoder.next_reply()
    with pytest.raises(kvp.KvpProtocolError, match=entry["message"]):
        decoder.next_reply()
    with pytest.raises(kvp.KvpProtocolError, match=entry["message"]):
        decoder.feed(FRAMES["reply"][0]["hex"])


def test_a_wrong_inner_length_is_seen_before_the_rest_has_come() -> None:
    decoder = kvp.Decoder()
    decoder.feed(bytes.fromhex("00 2a ff ff 00 00 03"))
    with pytest.raises(kvp.KvpProtocolError, match="65529 would be right"):
        decoder.next_reply()


@pytest.mark.parametrize("entry", FRAMES["reply"], ids=what)
def test_a_cut_reply_is_waited_for(entry: dict[str, Any]) -> None:
    for size in range(len(entry["hex"])):
        decoder = kvp.Decoder()
        decoder.feed(entry["hex"][:size])
        assert decoder.next_reply() is None
        assert decoder.pending_bytes == size


def test_a_peer_that_floods_is_refused() -> None:
    decoder = kvp.Decoder()
    decoder.feed(bytes(kvp.BUFFER_LIMIT_BYTES))
    with pytest.raises(kvp.KvpProtocolError, match="one reply to each request"):
        decoder.feed(b"x")
    assert decoder.pending_bytes == 0


@given(st.lists(st.binary(max_size=40), max_size=20))
def test_random_bytes_give_replies_or_one_clear_error(pieces: list[bytes]) -> None:
    decoder = kvp.Decoder()
    with contextlib.suppress(kvp.KvpProtocolError):
        for piece in pieces:
            decoder.feed(piece)
            while (reply := decoder.next_reply()) is not None:
                assert reply.function in (kvp.READ, kvp.WRITE)


def test_the_value_of_the_right_reply_is_returned_without_blanks() -> None:
    reply = kvp.Reply(7, kvp.READ, "  #T1 ", True)
    assert kvp.reply_to_value(reply, 7, kvp.READ, "$MODE_OP") == "#T1"


def test_a_late_reply_is_not_taken_for_the_next_one() -> None:
    late = kvp.Reply(6, kvp.READ, "1", True)
    with pytest.raises(kvp.KvpProtocolError, match=r"id 6; 7 would be right"):
        kvp.reply_to_value(late, 7, kvp.READ, "$OV_PRO")


def test_a_reply_to_another_function_is_a_protocol_error() -> None:
    reply = kvp.Reply(7, kvp.WRITE, "1", True)
    with pytest.raises(kvp.KvpProtocolError, match="function 1; 0 would be right"):
        kvp.reply_to_value(reply, 7, kvp.READ, "$OV_PRO")


@pytest.mark.parametrize(("function", "verb"), [(kvp.READ, "read"), (kvp.WRITE, "write")])
def test_a_refusal_names_the_variable(function: int, verb: str) -> None:
    with pytest.raises(kvp.VariableRefusedError, match=f"NOSUCH: .*refused to {verb}") as caught:
        kvp.reply_to_value(kvp.Reply(7, function, "1", False), 7, function, "NOSUCH")
    assert caught.value.exit_code == 5


@pytest.mark.parametrize("value", ["", "   "])
def test_done_but_empty_is_an_error_of_its_own(value: str) -> None:
    with pytest.raises(kvp.VariableEmptyError, match=r"\$POS_ACT: .*no value") as caught:
        kvp.reply_to_value(kvp.Reply(7, kvp.READ, value, True), 7, kvp.READ, "$POS_ACT")
    assert isinstance(caught.value, DeviceError)
    assert not isinstance(caught.value, kvp.VariableRefusedError)


def test_a_write_may_come_back_empty() -> None:
    assert kvp.reply_to_value(kvp.Reply(7, kvp.WRITE, "", True), 7, kvp.WRITE, "X") == ""


@pytest.mark.parametrize("request_id", [-1, 0x10000])
def test_an_id_of_more_than_16_bits_is_refused(request_id: int) -> None:
    with pytest.raises(InvalidError, match="0 to 65535 would be right"):
        kvp.encode_read(request_id, "X")
    with pytest.raises(InvalidError, match="0 to 65535 would be right"):
        kvp.encode_write(request_id, "X", "1")


@pytest.mark.parametrize("name", ["", "Größe", "A\nB", "A\x00"])
def test_a_name_that_krl_cannot_have_is_refused(name: str) -> None:
    with pytest.raises(InvalidError, match="printable ASCII text would be right"):
        kvp.encode_read(1, name)


@pytest.mark.parametrize("value", ["", "1\r\n2", "\x00"])
def test_a_value_that_is_not_one_line_of_text_is_refused(value: str) -> None:
    with pytest.raises(InvalidError, match="one line would be right"):
        kvp.encode_write(1, "X", value)


def test_a_value_outside_latin_1_is_refused_and_one_inside_is_one_byte_a_character() -> None:
    assert kvp.encode_write(1, "T[]", '"ü"').endswith(b'\x00\x03"\xfc"')
    with pytest.raises(InvalidError, match="Latin-1 only"):
        kvp.encode_write(1, "T[]", '"Ω"')


def test_a_request_stays_below_one_segment() -> None:
    longest = kvp.REQUEST_LIMIT_BYTES - 1
    assert len(kvp.encode_read(1, "A" * (longest - 7))) == longest
    assert len(kvp.encode_write(1, "A", "1" * (longest - 10))) == longest
    with pytest.raises(InvalidError, match=r"A\.\.\.: a request of 1400 bytes; fewer than 1400"):
        kvp.encode_read(1, "A" * (longest - 6))
    with pytest.raises(InvalidError, match="a request of 100007 bytes"):
        kvp.encode_read(1, "A" * 100_000)
    with pytest.raises(InvalidError, match=r"^A: a request of 1400 bytes.* in two parts"):
        kvp.encode_write(1, "A", "1" * (longest - 9))
