import struct

import pytest

from tracemesh_bridge.cli import main
from tracemesh_bridge.framing import FrameField, FrameLayout
from tracemesh_bridge.inspection import changes, describe, header

DATA = struct.pack(">11h", 3, 266, 77, 16390, -210, 8130, -4599, -9158, 7, 0, 0)


def test_bytes_stand_over_their_values():
    layout = FrameLayout()
    raw, values = describe(layout, DATA)
    assert header(layout).split()[:4] == ["big", "small", "acc", "x"]
    assert raw.split()[:8] == ["00", "03", "01", "0a", "00", "4d", "40", "06"]
    assert values.split() == [
        "3",
        "266",
        "+0.0023",
        "+0.5002",
        "-0.0064",
        "+0.2481",
        "-0.1404",
        "-0.2795",
        "7",
        "0",
        "0",
    ]
    assert len(header(layout)) == len(raw) == len(values)


def test_a_frame_that_makes_no_sense_is_shown_all_the_same():
    wrong_order = FrameLayout(fields=tuple(f.model_copy(update={"order": "little"}) for f in FrameLayout().fields))
    lines = list(describe(wrong_order, DATA))
    assert lines[1].split()[:2] == ["768", "2561"]
    assert "implausible: wanted fewer than 500 small ticks, got 2561" in lines[2]


@pytest.mark.parametrize(
    ("data", "words"), [(b"", "nothing   (0 bytes; wanted 22)"), (b"\x01\xff", "01 ff   (2 bytes")]
)
def test_what_is_no_frame_is_shown_raw(data, words):
    (line,) = describe(FrameLayout(), data)
    assert words in line


def test_bytes_that_change_are_told_from_those_that_do_not():
    assert changes([b"abc", b"adc", b"aec", b"short"], 3).splitlines()[1].split() == ["values", ".", "3", "."]
    assert "is it the right port" in changes([b""], 3)


def test_fields_are_shown_in_the_order_of_their_bytes():
    swapped = tuple(reversed(FrameLayout().fields))
    assert header(FrameLayout(fields=swapped)) == header(FrameLayout())
    assert isinstance(swapped[0], FrameField)


def test_the_command_shows_a_devices_frames(bench, capsys):
    bench.virtual("--noise", "0")
    assert main(["inspect", "--port", str(bench.folder / "rider"), "--count", "3", "--interval", "0.01"]) == 0
    shown = capsys.readouterr().out.splitlines()
    sent = [" ".join(frame[i : i + 2] for i in range(0, 44, 2)) for frame in bench.sent()]
    assert [" ".join(line.split()) for line in shown[1:7:2]] == sent


def test_a_port_that_is_not_there_is_said(tmp_path, capsys):
    assert main(["inspect", "--port", str(tmp_path / "none")]) == 1
    assert "tracemesh-bridge: no port" in capsys.readouterr().err
