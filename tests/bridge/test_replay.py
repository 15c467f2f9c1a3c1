import json
from concurrent.futures import ThreadPoolExecutor

import pytest
from websockets.sync.server import serve

from tracemesh.wire.device import CurveEnd, CurveStart, Device, ErrorMessage, Hello, NodeMark, Samples, from_device
from tracemesh_bridge.cli import main
from tracemesh_bridge.errors import BridgeError
from tracemesh_bridge.replay import RecordedFile

HELLO = Hello(recording="r", session="s", device=Device(id="d", kind="k"))


def samples(seq, first, times):
    return Samples(seq=seq, curve=0, first_sample=first, received=times, quaternion=[(1, 0, 0, 0)] * len(times))


MESSAGES = [
    CurveStart(seq=0, curve=0, boundary=True),
    samples(1, 0, [1000.0, 1001.0]),
    NodeMark(seq=2, curve=0, sample=1, node=4),
    samples(3, 2, [1003.0]),
    CurveEnd(seq=4, curve=0),
]


@pytest.fixture
def recording(tmp_path):
    file = tmp_path / "scan.ndjson"
    file.write_text("".join(m.model_dump_json(exclude_none=True) + "\n" for m in (HELLO, *MESSAGES)))
    return file


def test_the_server_has_what_the_file_has(recording, server, capsys):
    assert main(["replay", str(recording), "--server", server.address]) == 0
    assert server.hellos == [HELLO]
    assert server.stored["r"] == MESSAGES
    assert capsys.readouterr().out == "s\n"


def test_into_another_session_as_another_recording(recording, server):
    options = ["--server", server.address, "--session", "t", "--recording", "again"]
    assert main(["replay", str(recording), *options]) == 0
    assert main(["replay", str(recording), *options]) == 0, "what the server has already is not sent again"
    assert [(h.session, h.recording) for h in server.hellos] == [("t", "again")] * 2
    assert server.stored["again"] == MESSAGES


@pytest.mark.parametrize("code", ["unknown", "version", "malformed", "forbidden"])
def test_what_the_server_will_never_take_ends_with_its_words_and_the_file_stays(recording, server, code, capsys):
    server.refusal = ErrorMessage(code=code, message="so it is")
    before = recording.read_bytes()
    assert main(["replay", str(recording), "--server", server.address]) == 1
    assert f"tracemesh-bridge: the server says {code}: so it is\n" in capsys.readouterr().err
    assert recording.read_bytes() == before


@pytest.mark.parametrize("code", ["storage", "limit", "gap"])
def test_what_the_server_cannot_take_now_is_sent_once_it_can(recording, server, code, eventually):
    server.refusal = ErrorMessage(code=code, message="not now")
    with ThreadPoolExecutor(1) as background:
        sending = background.submit(main, ["replay", str(recording), "--server", server.address])
        eventually(lambda: len(server.hellos) >= 2)
        server.refusal = None
        assert sending.result() == 0
    assert server.stored["r"] == MESSAGES


def test_a_token_that_is_missing_ends_it_too(recording, capsys):
    closed = serve(lambda _: None, "127.0.0.1", 0, process_request=lambda socket, _: socket.respond(403, ""))
    with closed as listening, ThreadPoolExecutor(1) as background:
        background.submit(listening.serve_forever)
        port = listening.socket.getsockname()[1]
        assert main(["replay", str(recording), "--server", f"http://127.0.0.1:{port}"]) == 1
        listening.shutdown()
    assert "the server wants a token, or another one: set TRACEMESH_TOKEN" in capsys.readouterr().err


def test_what_a_bridge_spooled_can_be_replayed(bench, server):
    server.silent = True  # what is acknowledged leaves the spool
    bench.virtual()
    bridge = bench.bridge()
    bridge.says("device: live")
    bridge.type("+")
    bench.samples(60)
    bridge.type(".")
    bridge.says("ended")
    bridge.stop(15)
    (segment,) = (bench.folder / "spool").glob("*/0*.ndjson")
    (recording,) = server.stored
    server.silent = False
    assert main(["replay", str(segment), "--server", server.address, "--recording", "copy"]) == 0
    sent, copy = server.stored[recording], server.stored["copy"]
    assert copy[: len(sent)] == sent, "what was sent when the bridge was stopped"
    assert isinstance(copy[-1], CurveEnd), "and what was not"


def test_messages_are_released_in_the_time_they_took(recording, monkeypatch):
    times = iter((50.0, 50.0, 50.4, 50.6, 51.4, 51.6, 60.0))
    monkeypatch.setattr("time.monotonic", lambda: next(times, 60.0))
    file = RecordedFile(recording, speed=2.0)
    assert [file.released for _ in range(5)] == [1, 1, 3, 3, 5]
    lines = file.lines(0)
    assert [from_device.validate_json(line) for line in iter(lines.next, None)] == MESSAGES


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], "wanted a recording that begins with hello, got nothing"),
        ([MESSAGES[0]], "line 1: wanted hello, got curve.start 0"),
        ([HELLO, MESSAGES[1]], "line 2: wanted message 0, got samples 1"),
        ([HELLO, MESSAGES[0], "{"], "line 3: Invalid JSON"),
        ([HELLO, {"type": "samples"}], "line 2: "),
    ],
)
def test_a_file_that_is_no_recording_says_where(tmp_path, lines, words):
    file = tmp_path / "wrong.ndjson"
    texts = [x if isinstance(x, str) else json.dumps(x) if isinstance(x, dict) else x.model_dump_json() for x in lines]
    file.write_text("\n".join(texts))
    with pytest.raises(BridgeError, match=words):
        RecordedFile(file)


def test_a_missing_file_is_said(capsys):
    assert main(["replay", "nowhere.ndjson"]) == 1
    assert "cannot read the recording nowhere.ndjson" in capsys.readouterr().err
