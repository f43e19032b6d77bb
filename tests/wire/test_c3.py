"""C3 Bridge's frames: the specification's samples, every cut of the stream, and what is refused."""

from __future__ import annotations

import contextlib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.errors import DeviceError, InvalidError
from sphmctl.wire import c3, kvp
from tests.wire.chunks import cut, load

FRAMES = load("c3_frames.toml")
PIECES = st.lists(st.integers(1, 9), min_size=1, max_size=8)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=60)


def what(entry: dict[str, Any]) -> str:
    return str(entry["what"])


def replies_of(pieces: Any) -> list[kvp.Reply]:
    decoder = c3.Decoder()
    found = []
    for piece in pieces:
        decoder.feed(piece)
        while (reply := decoder.next_reply()) is not None:
            found.append(reply)
    assert decoder.pending_bytes == 0
    return found


def expected(entry: dict[str, Any]) -> kvp.Reply:
    items = tuple(zip(entry["codes"], entry["values"], strict=True))
    return kvp.Reply(entry["id"], entry["function"], "", entry["ok"], entry["code"], items)


def text(value: str) -> bytes:
    """A text as the specification's section 1.5 has it, independently of the codec."""
    data = value.encode("utf-16-le")
    return (len(data) // 2).to_bytes(2, "big") + data


def many(request_id: int, items: list[tuple[int, str]]) -> bytes:
    """A reply to function 6, put down from the layout."""
    good = all(code == 1 for code, _ in items)
    body = bytes((6, len(items))) + b"".join(bytes((code,)) + text(v) for code, v in items)
    body += bytes((0, good, good))
    return request_id.to_bytes(2, "big") + len(body).to_bytes(2, "big") + body


@pytest.mark.parametrize("entry", FRAMES["request"], ids=what)
def test_a_request_has_the_bytes_of_the_specification(entry: dict[str, Any]) -> None:
    number, names = entry["id"], entry["names"]
    pairs = list(zip(names, entry.get("values", []), strict=False))
    frames = {
        c3.READ: lambda: c3.encode_read(number, names[0]),
        c3.WRITE: lambda: c3.encode_write(number, *pairs[0]),
        c3.READ_MANY: lambda: c3.encode_read_many(number, names),
        c3.WRITE_MANY: lambda: c3.encode_write_many(number, pairs),
    }
    assert frames[entry["function"]]() == entry["hex"]


@pytest.mark.parametrize("entry", FRAMES["reply"], ids=what)
def test_a_reply_is_read_at_every_split_and_waited_for_when_it_is_cut(
    entry: dict[str, Any],
) -> None:
    frame = entry["hex"]
    assert replies_of([frame]) == replies_of(cut(frame, [1])) == [expected(entry)]
    for at in range(len(frame)):
        decoder = c3.Decoder()
        decoder.feed(frame[:at])
        assert decoder.next_reply() is None
        assert decoder.pending_bytes == at
        decoder.feed(frame[at:])
        assert decoder.next_reply() == expected(entry)


@given(PIECES)
def test_a_stream_of_replies_is_read_however_it_is_cut(sizes: list[int]) -> None:
    stream = b"".join(entry["hex"] for entry in FRAMES["reply"])
    assert replies_of(cut(stream, sizes)) == [expected(entry) for entry in FRAMES["reply"]]


@given(st.lists(st.tuples(st.integers(0, 10), TEXTS), max_size=8), PIECES)
def test_any_values_with_any_codes_come_through(
    items: list[tuple[int, str]], sizes: list[int]
) -> None:
    (reply,) = replies_of(cut(many(3, items), sizes))
    assert reply.items == tuple(items)


@pytest.mark.parametrize("entry", FRAMES["foreign"], ids=what)
def test_a_frame_that_is_not_ours_kills_the_decoder(entry: dict[str, Any]) -> None:
    decoder = c3.Decoder()
    decoder.feed(entry["hex"])
    for _ in range(2):
        with pytest.raises(kvp.KvpProtocolError, match=entry["message"]):
            decoder.next_reply()
    with pytest.raises(kvp.KvpProtocolError, match=entry["message"]):
        decoder.feed(FRAMES["reply"][0]["hex"])


def test_a_foreign_function_is_seen_before_the_rest_has_come() -> None:
    decoder = c3.Decoder()
    decoder.feed(bytes.fromhex("00 2a ff ff 0b"))
    with pytest.raises(kvp.KvpProtocolError, match="function 11; 4 to 7 would be right"):
        decoder.next_reply()


def test_a_peer_that_floods_is_refused() -> None:
    decoder = c3.Decoder()
    decoder.feed(bytes.fromhex("00 2a ff ff 06") + bytes(kvp.BUFFER_LIMIT_BYTES - 5))
    with pytest.raises(kvp.KvpProtocolError, match="one reply to each request"):
        decoder.feed(b"x")


@given(st.lists(st.binary(max_size=40), max_size=20))
def test_random_bytes_give_replies_or_one_clear_error(pieces: list[bytes]) -> None:
    decoder = c3.Decoder()
    with contextlib.suppress(kvp.KvpProtocolError):
        for piece in pieces:
            decoder.feed(piece)
            while (reply := decoder.next_reply()) is not None:
                assert 4 <= reply.function <= 7


@given(st.sampled_from([4, 5, 6, 7]), st.binary(max_size=30))
def test_any_payload_under_a_good_head_gives_a_reply_or_one_clear_error(
    function: int, payload: bytes
) -> None:
    body = bytes((function,)) + payload + b"\x00\x01\x01"
    decoder = c3.Decoder()
    decoder.feed(b"\x00\x01" + len(body).to_bytes(2, "big") + body)
    with contextlib.suppress(kvp.KvpProtocolError):
        assert decoder.next_reply() is not None


def judged(items: list[tuple[int, str]], *names: str, code: int = 1, ok: bool = True) -> list[str]:
    reply = kvp.Reply(5, c3.READ_MANY, "", ok, code, tuple(items))
    return c3.reply_to_values(reply, 5, c3.READ_MANY, names)


def test_values_come_in_order_and_without_blanks() -> None:
    assert judged([(1, " 35 "), (1, "#T1")], "A", "B") == ["35", "#T1"]


def test_the_variable_that_was_refused_is_named_with_its_error() -> None:
    with pytest.raises(kvp.VariableRefusedError, match=r"^B: .*error 2, access denied"):
        judged([(1, "35"), (2, "")], "A", "B", code=0, ok=False)


def test_done_but_empty_is_an_error_of_its_own() -> None:
    with pytest.raises(kvp.VariableEmptyError, match=r"^B: "):
        judged([(1, "35"), (1, "")], "A", "B")


def test_values_that_are_too_long_keep_the_connection() -> None:
    with pytest.raises(DeviceError, match="A, B: the values are too long") as caught:
        judged([], "A", "B", code=10, ok=False)
    assert not isinstance(caught.value, kvp.KvpProtocolError)


@pytest.mark.parametrize(
    ("items", "code", "ok", "sentence"),
    [
        ([], 9, False, "error 9, request not understood"),
        ([(1, "1")], 1, True, "with 1 variables .*; 2 would be right"),
        ([(1, "1"), (1, "2")], 0, False, "without a failed variable"),
    ],
)
def test_a_reply_that_does_not_fit_its_request_is_a_protocol_error(
    items: list[tuple[int, str]], code: int, ok: bool, sentence: str
) -> None:
    with pytest.raises(kvp.KvpProtocolError, match=sentence):
        judged(items, "A", "B", code=code, ok=ok)


@pytest.mark.parametrize(("number", "function"), [(6, c3.READ_MANY), (5, c3.READ)])
def test_a_reply_to_another_request_is_a_protocol_error(number: int, function: int) -> None:
    reply = kvp.Reply(number, function, "", True, 1, ((1, "1"),))
    with pytest.raises(kvp.KvpProtocolError, match="would be right"):
        c3.reply_to_values(reply, 5, c3.READ_MANY, ("A",))


def test_what_cannot_be_asked_is_refused() -> None:
    with pytest.raises(InvalidError, match="0 variables; 1 to 255"):
        c3.encode_read_many(1, ())
    with pytest.raises(InvalidError, match="256 variables"):
        c3.encode_read_many(1, ("A",) * 256)
    with pytest.raises(InvalidError, match="at most 65535 would be right"):
        c3.encode_read_many(1, ("A" * 200,) * 200)
    with pytest.raises(InvalidError, match="one line"):
        c3.encode_write(1, "A", "1\n2")
    with pytest.raises(InvalidError, match="0 to 65535"):
        c3.encode_read(-1, "A")
    with pytest.raises(InvalidError, match="printable ASCII"):
        c3.encode_read(1, "Größe")


def test_a_text_outside_latin_1_is_written_in_units_of_two_bytes() -> None:
    assert c3.encode_write(1, "T[]", '"Ω😀"').endswith(text('"Ω😀"'))


@pytest.mark.parametrize(
    ("said", "numbers"),
    [("1.4 (OPEN SOURCE)", (1, 4)), ("1.10 (FREEWARE)", (1, 10)), ("", (0, 0)), ("new", (0, 0))],
)
def test_the_version_is_taken_from_what_the_server_says(
    said: str, numbers: tuple[int, int]
) -> None:
    assert c3.version(said) == numbers
