import json
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracemesh_bridge.errors import BridgeError, FrameError
from tracemesh_bridge.framing import MEANINGS, Frame, FrameField, FrameLayout, decode, encode, read_layout

LAYOUT = FrameLayout()


def test_the_default_layout_is_eleven_big_endian_integers():
    data = struct.pack(">11h", 12, 345, 100, -200, 16384, 1, -32768, 32767, 7, 8, 9)
    frame = decode(LAYOUT, data)
    assert frame.ticks == (12, 345)
    assert frame.acceleration == (100 / 32768, -200 / 32768, 0.5)
    assert frame.magnetic == (1 / 32768, -1.0, 32767 / 32768)
    assert LAYOUT.unknown == (16, 17, 18, 19, 20, 21)


@given(st.binary(min_size=22, max_size=22))
def test_any_bytes_are_a_frame_or_a_frame_error(data):
    try:
        frame = decode(LAYOUT, data)
    except FrameError:
        return
    assert decode(LAYOUT, encode(LAYOUT, frame)) == frame
    assert encode(LAYOUT, frame)[:16] == data[:16]
    assert all(-1 <= v <= 1 for v in frame.acceleration + frame.magnetic)


@given(st.binary(max_size=60).filter(lambda data: len(data) != 22))
def test_a_frame_of_another_length_is_refused(data):
    with pytest.raises(FrameError, match=f"wanted 22 bytes, got {len(data)}"):
        decode(LAYOUT, data)


@st.composite
def layouts(draw):
    sizes = [draw(st.sampled_from([1, 2, 4])) for _ in MEANINGS]
    gaps = [draw(st.integers(0, 2)) for _ in MEANINGS]
    fields, end = [], 0
    for name, size, gap in zip(draw(st.permutations(MEANINGS)), sizes, gaps, strict=True):
        order, sign = (
            draw(st.sampled_from(["big", "little"])),
            draw(st.sampled_from(["twos-complement", "sign-magnitude"])),
        )
        fields.append(FrameField(name=name, offset=end + gap, size=size, order=order, sign=sign))
        end += gap + size
    return FrameLayout(length=end + draw(st.integers(0, 3)), fields=tuple(fields))


@settings(max_examples=50)
@given(layouts(), st.lists(st.integers(-127, 127), min_size=8, max_size=8))
def test_what_is_encoded_is_decoded_in_any_layout(layout, numbers):
    big, small, *vectors = map(float, numbers)
    frame = Frame((int(big), int(small)), tuple(vectors[:3]), tuple(vectors[3:]))
    if not any(frame.acceleration) or not any(frame.magnetic):
        with pytest.raises(FrameError, match="zeros"):
            decode(layout, encode(layout, frame))
    else:
        assert decode(layout, encode(layout, frame)) == frame


@pytest.mark.parametrize(
    ("sign", "data", "integer"),
    [
        ("twos-complement", b"\xff\xff", -1),
        ("sign-magnitude", b"\x80\x01", -1),
        ("sign-magnitude", b"\x80\x00", 0),
        ("unsigned", b"\xff\xff", 65535),
    ],
)
def test_what_the_first_bit_means_is_a_setting(sign, data, integer):
    assert FrameField(name="big", offset=0, sign=sign).integer(data) == integer


@pytest.mark.parametrize(
    ("sign", "integer"), [("twos-complement", 32768), ("sign-magnitude", -32768), ("unsigned", -1)]
)
def test_an_integer_that_does_not_fit_is_refused(sign, integer):
    with pytest.raises(FrameError, match=f"got {integer}"):
        FrameField(name="big", offset=0, sign=sign).raw(integer)


@pytest.mark.parametrize("small", [500, -500, 32767])
def test_more_ticks_than_a_turn_has_are_refused(small):
    with pytest.raises(FrameError, match=f"got {small}"):
        decode(LAYOUT, struct.pack(">11h", 0, small, 1, 1, 1, 1, 1, 1, 0, 0, 0))


def test_a_layout_comes_from_a_file(tmp_path):
    file = tmp_path / "layout.json"
    file.write_text(LAYOUT.model_dump_json())
    assert read_layout(file) == LAYOUT


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fields": []}, "wanted each of big, small"),
        ({"length": 10}, "reserved ends at byte 22 of 10"),
        ({"length": "long"}, "length: Input should be a valid integer"),
        ({"colour": 1}, "colour: Extra inputs"),
        ({"fields": [{"name": n, "offset": 0} for n in MEANINGS]}, "overlap at byte 0"),
    ],
)
def test_a_wrong_layout_says_what_is_wrong(tmp_path, change, words):
    file = tmp_path / "layout.json"
    file.write_text(json.dumps({**LAYOUT.model_dump(), **change}))
    with pytest.raises(BridgeError, match=words):
        read_layout(file)


def test_a_missing_layout_is_said(tmp_path):
    with pytest.raises(BridgeError, match="cannot read the frame layout"):
        read_layout(tmp_path / "none.json")
