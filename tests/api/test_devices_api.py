"""Devices and their calibrations over HTTP: stored with a version, chosen for a recording, applied to nothing else."""

import io
import json
import time
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracemesh.formats.calibrations import calibration_from_readings, read_calibration
from tracemesh.formats.recordings import recording_from_simulation, write_recording
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import Imperfections, plan_scan, simulate_scan
from tracemesh.wire.calibration import CalibrationReadings

HARD = [0.3, -0.2, 0.1]


def wheel(device: str, circumference: float = 0.2, made: str = "2026-05-03T10:00:00Z") -> dict[str, Any]:
    return {"calibration": {"device": device, "made": made, "circumference": circumference}}


def readings(shown: float = 1.0) -> dict[str, Any]:
    """A device with hard iron, turned so that up was as low as 1 - 2 `shown` along z."""
    poses = Rotation.random(600, rng=np.random.default_rng(3)).inv()
    up, field = poses.apply([0.0, 0.0, 1.0]), poses.apply([0.5, 0.0, -(0.75**0.5)])
    kept = up[:, 2] > 1 - 2 * shown
    return {"acceleration": up[kept].tolist(), "magnetic": (field[kept] + HARD).tolist()}


@pytest.fixture(scope="module")
def leaf_recording() -> str:
    curves = simulate_scan(plan_scan(leaf(), imperfections=Imperfections().scaled(0)))
    return write_recording(recording_from_simulation(curves, "leaf"))


def as_device(recording: str, device: str, **more: Any) -> str:
    hello, rest = recording.split("\n", 1)
    changed = json.loads(hello)
    changed["device"] |= {"id": device, **more}
    return json.dumps(changed) + "\n" + rest


def lengths(server: Any, session: str) -> float:
    """Diagonal of the network as it is previewed now."""
    report = server.http.post(f"/sessions/{session}/preview", json={"step": "5%"}).json()["report"]
    return float(report["sizes"]["diagonal_m"])


def test_calibrations_are_numbered_listed_and_forgotten(server: Any) -> None:
    first = server.http.post("/devices/a/calibrations", json=wheel("a") | {"kind": "morphorider"})
    assert (first.status_code, first.json()["version"]) == (201, 1)
    assert server.http.get(first.headers["location"].removeprefix("/api/v1")).json() == first.json()
    assert server.http.post("/devices/a/calibrations", json=wheel("a")).json() == first.json()
    second = server.http.post("/devices/a/calibrations", json=wheel("a", 0.1)).json()
    assert [c["version"] for c in server.http.get("/devices/a/calibrations").json()] == [2, 1]
    assert server.http.delete("/devices/a/calibrations/2").status_code == 204
    assert server.http.get("/devices/a/calibrations/2").status_code == 404
    assert server.http.post("/devices/a/calibrations", json=wheel("a", 0.3)).json()["version"] == 3
    assert second["version"] == 2
    (known,) = (d for d in server.http.get("/devices").json() if d["id"] == "a")
    assert (known["kind"], known["calibrations"]) == ("morphorider", 2)
    assert server.http.get("/devices/a").json() == known


def test_a_calibration_is_made_of_readings(server: Any) -> None:
    made = server.http.post("/devices/b/calibrations", json={"readings": readings()})
    assert made.status_code == 201, made.text
    np.testing.assert_allclose(made.json()["magnetometer"]["offset"], HARD, atol=1e-6)
    assert made.json()["dip"] == pytest.approx(np.pi / 3, abs=1e-6)
    assert read_calibration(made.text).version == 1


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (wheel("another"), "wanted a calibration of the device c, got one of another"),
        ({}, "either calibration or readings"),
        ({"readings": {}}, "got neither"),
        ({"readings": readings(0.5)}, "turn it so that these are measured, too: -z"),
        ({"readings": {"acceleration": [[0, 0, 1]], "magnetic": []}}, "as many magnetic vectors"),
        ({"readings": {"run": {"ticks": [[0, 0], [1, 0]], "length": 0.1}}}, "at least 3 turns"),
    ],
)
def test_what_is_no_calibration_is_refused(server: Any, body: dict[str, Any], words: str) -> None:
    answer = server.http.post("/devices/c/calibrations", json=body)
    assert (answer.status_code, words in answer.text) == (422, True), answer.text
    assert server.http.get("/devices/c").status_code == 404


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/devices/none"),
        ("GET", "/devices/none/calibrations"),
        ("GET", "/devices/none/calibrations/1"),
        ("DELETE", "/devices/none/calibrations/1"),
    ],
)
def test_what_is_not_there(server: Any, method: str, path: str) -> None:
    assert server.http.request(method, path).status_code == 404


def test_a_device_is_known_once_it_has_sent_something(server: Any, ride: Any) -> None:
    session = server.new_session()
    rider = ride("r-1", session, id="rider-7", name="Red one")
    assert rider.welcome.get("calibration") is None
    known = server.http.get("/devices/rider-7").json()
    assert (known["kind"], known["name"], known["calibrations"]) == ("test", "Red one", 0)
    server.http.post("/devices/rider-7/calibrations", json=wheel("rider-7"))
    again = ride("r-2", session, id="rider-7", name="Red one")
    assert again.welcome["calibration"] == "calibration 1 of rider-7, 2026-05-03"
    recordings = server.http.get(f"/sessions/{session}/recordings").json()
    assert [r["calibration"] for r in recordings] == [None, None]


def test_an_old_recording_is_corrected_once_somebody_chooses_so(server: Any, leaf_recording: str) -> None:
    session = server.new_session()
    path = f"/sessions/{session}/recordings"
    uploaded = server.http.post(path, content=as_device(leaf_recording, "old")).json()
    before = lengths(server, session)
    server.http.post("/devices/old/calibrations", json=wheel("old"))
    assert lengths(server, session) == pytest.approx(before, rel=1e-9)
    chosen = server.http.patch(f"{path}/{uploaded['id']}", json={"calibration": 1})
    assert chosen.json()["calibration"] == 1
    assert lengths(server, session) == pytest.approx(2 * before, rel=1e-6)
    assert server.http.patch(f"{path}/{uploaded['id']}", json={}).json() == chosen.json()
    refused = server.http.delete("/devices/old/calibrations/1")
    assert (refused.status_code, "used by recording leaf" in refused.json()["detail"]) == (409, True)
    assert server.http.patch(f"{path}/{uploaded['id']}", json={"calibration": 9}).status_code == 404
    assert server.http.get(f"{path}/{uploaded['id']}").text == as_device(leaf_recording, "old")
    assert server.http.patch(f"{path}/{uploaded['id']}", json={"calibration": None}).json()["calibration"] is None
    assert lengths(server, session) == pytest.approx(before, rel=1e-9)
    assert server.http.delete("/devices/old/calibrations/1").status_code == 204


def test_a_recording_brings_the_calibration_that_was_chosen_for_it(server: Any, leaf_recording: str) -> None:
    session = server.new_session()
    path = f"/sessions/{session}/recordings"
    calibration = wheel("own")["calibration"]
    content = as_device(leaf_recording, "own", calibration=calibration)
    assert server.http.post(path, content=content).json()["calibration"] == 1
    (stored,) = server.http.get("/devices/own/calibrations").json()
    assert {k: stored[k] for k in calibration} == calibration
    other = as_device(leaf_recording, "not-own", calibration=calibration)
    refused = server.http.post(path, content=other)
    assert (refused.status_code, "got one of own" in refused.text) == (422, True)


def test_the_report_names_the_calibration_of_every_curve(server: Any, leaf_recording: str) -> None:
    session = server.new_session()
    content = as_device(leaf_recording, "reported", calibration=wheel("reported")["calibration"])
    server.http.post(f"/sessions/{session}/recordings", content=content)
    job = server.http.post(f"/sessions/{session}/reconstructions", json={"surface": False, "step": "5%"}).json()
    while server.http.get(f"/reconstructions/{job['id']}").json()["state"] in ("queued", "running"):
        time.sleep(0.1)
    report = server.http.get(f"/reconstructions/{job['id']}/report.json").json()
    curves = list(range(len(server.http.get(f"/sessions/{session}/curves").json())))
    assert report["calibrations"] == [{"calibration": "calibration 1 of reported, 2026-05-03", "curves": curves}]


def test_an_archive_keeps_the_choice(server: Any, leaf_recording: str) -> None:
    session = server.new_session()
    path = f"/sessions/{session}/recordings"
    server.http.post(path, content=as_device(leaf_recording, "kept", calibration=wheel("kept")["calibration"]))
    newer = server.http.post("/devices/kept/calibrations", json=wheel("kept", 0.15)).json()["version"]
    server.http.patch(f"{path}/leaf", json={"calibration": newer})
    archive = server.http.get(f"/sessions/{session}/archive").content
    server.http.delete(f"/sessions/{session}")
    for version in (1, newer):
        assert server.http.delete(f"/devices/kept/calibrations/{version}").status_code == 204
    restored = server.http.post("/sessions/archive", content=io.BytesIO(archive).read()).json()["id"]
    (recording,) = server.http.get(f"/sessions/{restored}/recordings").json()
    chosen = server.http.get(f"/devices/kept/calibrations/{recording['calibration']}").json()
    assert chosen["circumference"] == 0.15


def test_readings_give_the_same_here_and_there(server: Any) -> None:
    local = calibration_from_readings("d", CalibrationReadings.model_validate(readings()))
    remote = read_calibration(server.http.post("/devices/d/calibrations", json={"readings": readings()}).text)
    assert remote.model_copy(update={"version": None, "made": local.made}) == local
