"""What the pages cost a browser: bytes before they work, first view, slider moves, script per live point, memory."""

import gzip
import json
import re
import shutil
import time
import urllib.request
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import CDPSession, Locator, Page, sync_playwright
from websockets.sync.client import ClientConnection, connect

from benchmarks.data import ROOT, Data, noisy_scan
from benchmarks.measuring import Floats
from benchmarks.serving import serving
from benchmarks.table import Cell, Column, Table
from tracemesh.formats.rawnet import write_rawnet
from tracemesh.geometry.simulated.shapes import leaf
from tracemesh.geometry.simulated.simulation import exact_scan

BUILT = ROOT / "server" / "tracemesh" / "web"
FLAGS = [
    *("--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--js-flags=--expose-gc"),
    *("--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader"),
]
LIVE_POINTS, SAMPLE = 1000, 0.003
"""Points of one timed batch, and m between samples: as far apart as live points are drawn."""
BATCHES = 20
MOVES = 20
"""Timed moves of a slider."""
MINUTES, RATE, SPEED = 30, 60, 0.08
"""A long ride: min, samples a second, m/s."""
COLLECTIONS = 5

COLUMNS = (Column("what"), Column("budget"), Column("measured", ".1f"), Column("unit"))
NOTES = (
    """Built pages in headless Chromium on the same machine, WebGL in software. First load: every script and style that
    a page needs at once, compressed with gzip. First view: from the address to the surface on the screen, of a
    session with so many samples, as far apart drawn as an eye can tell, and triangles; the median of five. Slider:
    from its input event until the answer has come, and to the end of the first frame that shows the network so asked
    for, of the noisy built-in cone cut as finely as the slider allows; each move asks for something new, once the
    one before was seen; the first one is not counted. Script: what the browser reports as script time while messages
    with so many new live points come in one by one, per message. Heap: of the page after garbage collection, at the
    end of so many minutes of live data; its growth is that less what it was after a tenth of them. What the data
    need is the growth, over the same time, of the heap of a page that is only then opened on them. The ride is sent
    as fast as it is taken.""",
)


def browsing(data: Data, minutes: float = MINUTES) -> Table:
    """Table of the budgets of the pages. `data` is not needed."""
    rows: list[tuple[Cell, ...]] = [
        ("scan page, first load", "150", _kilobytes("scan.html"), "kB"),
        ("scan page with the 3D view", "350", _kilobytes("scan.html", "View-*.js"), "kB"),
        ("desk page, first load", None, _kilobytes("index.html"), "kB"),
        ("desk page with the 3D view", None, _kilobytes("index.html", "View-*.js"), "kB"),
    ]
    with serving() as server, sync_playwright() as playwright:
        address = f"127.0.0.1:{server.port}"
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 720}, reduced_motion="reduce")
        rows += [_first_view(page, address), *_sliders(page, address)]
        rows += [_script(page, address), *_memory(page, address, minutes)]
        browser.close()
    return Table("browsing", "The pages in a browser", COLUMNS, tuple(rows), NOTES)


def _kilobytes(page: str, *later: str) -> float:
    files = closure({BUILT / page, *(found for name in later for found in (BUILT / "assets").glob(name))})
    return sum(map(compressed, files)) / 1000


def closure(files: set[Path]) -> set[Path]:
    """These built files and every script and style that they need at once; not scripts that are imported on demand."""
    found, waiting = set(files), set(files)
    while waiting:
        text = waiting.pop().read_text()
        names = re.findall(r'(?:src|href)="\.?/?(assets/[^"]+)"', text)
        names += [f"assets/{name}" for name in re.findall(r'(?:from|import)\s*"\./([^"]+)"', text)]
        fresh = {BUILT / name for name in names} - found
        found |= fresh
        waiting |= fresh
    return found


def compressed(file: Path) -> int:
    """Bytes that go over the network."""
    return len(gzip.compress(file.read_bytes()))


def _first_view(page: Page, address: str) -> tuple[Cell, ...]:
    session = _call(address, "/sessions", b"{}")["id"]
    scan = exact_scan(leaf(), 3e-4)
    large = replace(scan, curves=tuple(replace(curve, distance=8 * curve.distance) for curve in scan.curves))
    _call(address, f"/sessions/{session}/recordings", write_rawnet(large).encode())
    job = _call(address, f"/sessions/{session}/reconstructions", b'{"step": "0.62%"}')["id"]
    while _call(address, f"/reconstructions/{job}")["state"] != "done":
        time.sleep(0.2)
    waits: list[float] = []
    snapshots: list[str] = []
    page.on("websocket", lambda socket: socket.on("framereceived", lambda text: _keep_snapshot(snapshots, str(text))))
    for _ in range(5):
        page.goto("about:blank")
        begin = time.perf_counter()
        page.goto(f"http://{address}/#/sessions/{session}")
        page.wait_for_selector("canvas[data-surface=shown]")
        page.evaluate("() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))")
        waits.append(time.perf_counter() - begin)
    samples = sum(len(curve.distance) for curve in large.curves)
    points = min(sum(len(c["positions"]) // 3 for c in json.loads(text)["curves"]) for text in snapshots)
    triangles = page.locator("canvas").get_attribute("data-triangles")
    what = f"first view, {samples} samples drawn as {points} points, {triangles} triangles"
    return (what, "1500", 1000 * float(np.median(waits)), "ms")


MOVE = """(slider, handle) => new Promise((seen) => {
  const isAnswer = (entry) => entry.name.includes("/preview");
  const answered = () => performance.getEntriesByType("resource").findLast(isAnswer).responseEnd;
  const drawn = () =>
    requestAnimationFrame(() => setTimeout(() => seen([answered() - begin, performance.now() - begin])));
  const watch = new MutationObserver(() => (watch.disconnect(), drawn()));
  watch.observe(document.querySelector("canvas[data-revision]"), { attributeFilter: ["data-revision"] });
  performance.clearResourceTimings();
  slider.step = "any";
  slider.value = handle;
  const begin = performance.now();
  slider.dispatchEvent(new Event("input", { bubbles: true }));
})"""
"""Moves the handle of a slider; ms until the network that this asks for has come, and until it is on the screen."""


def _sliders(page: Page, address: str) -> list[tuple[Cell, ...]]:
    """Moves of the step and of a smoothing length, near the finest step."""
    session = _call(address, "/sessions", b"{}")["id"]
    _call(address, f"/sessions/{session}/recordings", write_rawnet(noisy_scan("cone").scan).encode())
    page.goto(f"http://{address}/#/sessions/{session}")
    page.get_by_role("button", name="5 interior").wait_for()
    page.wait_for_load_state("networkidle")
    page.get_by_text("Parameters").click()
    step, stretch = (page.get_by_role("slider", name=name) for name in ("Step", "Stretch"))
    coarser = _moves(step, np.linspace(0.04, 0, MOVES + 1))
    page.get_by_title("Smooths over this length by resisting change of direction").get_by_role("checkbox").uncheck()
    with page.expect_response(re.compile("/preview")) as answer:
        smoother = _moves(stretch, np.linspace(0.1, 0.5, MOVES + 1))
    points = sum(len(curve["positions"]) // 3 for curve in answer.value.json()["curves"])
    return [
        (f"{name} slider, {points} samples, {what}, {words}", "100", float(np.quantile(waits, part)), "ms")
        for name, moves in (("step", coarser), ("stretch", smoother))
        for what, waits in zip(("answer", "on the screen"), moves.T, strict=True)
        for words, part in (("median", 0.5), ("95 %", 0.95))
    ]


def _moves(slider: Locator, handles: Floats) -> Floats:
    """ms (n, 2) until each move but the first is answered, and until the answer is on the screen."""
    return np.array([slider.evaluate(MOVE, float(handle)) for handle in handles][1:])


def _script(page: Page, address: str) -> tuple[Cell, ...]:
    session = _call(address, "/sessions", b"{}")["id"]
    page.goto(f"http://{address}/#/sessions/{session}")
    page.get_by_text("Nothing scanned yet.").wait_for()
    devtools = page.context.new_cdp_session(page)
    devtools.send("Performance.enable")
    with _Ride(address, session) as ride:
        ride.send(LIVE_POINTS)
        page.wait_for_timeout(1000)
        before = _script_time(devtools)
        for _ in range(BATCHES):
            ride.send(LIVE_POINTS)
            page.wait_for_timeout(300)
        spent = _script_time(devtools) - before
    return (f"script for {LIVE_POINTS} live points", "4", 1000 * spent / BATCHES, "ms")


def _memory(page: Page, address: str, minutes: float) -> list[tuple[Cell, ...]]:
    session = _call(address, "/sessions", b"{}")["id"]
    page.goto(f"http://{address}/#/sessions/{session}")
    page.get_by_text("Nothing scanned yet.").wait_for()
    samples = round(minutes * 60 * RATE)
    heaps = []
    with _Ride(address, session, SPEED / RATE) as ride:
        for tenth in range(10):
            ride.send(samples // 10, block=RATE)
            if tenth in (0, 9):
                page.wait_for_timeout(2000)
                heaps.append((_heap(page), _heap_anew(page, address, session)))
    live, anew = (np.diff(heaps, axis=0)[0] / 1e6).tolist()
    return [
        (f"heap after {minutes:g} min of live data", None, heaps[1][0] / 1e6, "MB"),
        ("its growth over the last nine tenths", None, live, "MB"),
        ("the same beyond what their data need", "0", live - anew, "MB"),
    ]


def _heap_anew(page: Page, address: str, session: str) -> float:
    """Bytes in use of a page that has just been opened on what the session amounts to by now."""
    browser = page.context.browser
    assert browser is not None
    other = browser.new_page(viewport=page.viewport_size, reduced_motion="reduce")
    other.goto(f"http://{address}/#/sessions/{session}")
    other.wait_for_selector("canvas")
    other.get_by_role("button", name="1 interior").wait_for()
    other.wait_for_timeout(2000)
    used = _heap(other)
    other.close()
    return used


class _Ride:
    """A device on the ingest socket that goes along a helix, as fast as the server takes it."""

    def __init__(self, address: str, session: str, apart: float = SAMPLE) -> None:
        self._socket: ClientConnection = connect(f"ws://{address}/api/v1/ingest")
        self._apart, self._seq, self._sample = apart, 0, 0
        self._tell(type="hello", recording="r", session=session, device={"id": "d", "kind": "helix"})
        self._socket.recv()
        self._message(type="curve.start", curve=0)

    def __enter__(self) -> "_Ride":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, samples: int, block: int = LIVE_POINTS) -> None:
        """So many more samples, committed when it returns."""
        for first in range(0, samples, block):
            self._block(min(block, samples - first))
        while json.loads(self._socket.recv())["seq"] < self._seq - 1:
            pass

    def _block(self, count: int) -> None:
        distance = self._apart * (self._sample + np.arange(count))
        turn = distance / 0.3
        tangent = np.column_stack([-np.sin(turn), np.cos(turn), np.full(count, 0.1)]) / np.hypot(1, 0.1)
        normal = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)])
        columns = {"distance": distance.tolist(), "tangent": tangent.tolist(), "normal": normal.tolist()}
        self._message(type="samples", curve=0, first_sample=self._sample, **columns)
        self._sample += count

    def _message(self, **fields: object) -> None:
        self._tell(seq=self._seq, **fields)
        self._seq += 1

    def _tell(self, **fields: object) -> None:
        self._socket.send(json.dumps(fields))


def _keep_snapshot(snapshots: list[str], text: str) -> None:
    """The first message of a view: all that it draws at first."""
    if '"live.snapshot"' in text[:100]:
        snapshots.append(text)


def _script_time(devtools: CDPSession) -> float:
    metrics = {m["name"]: m["value"] for m in devtools.send("Performance.getMetrics")["metrics"]}
    return float(metrics["ScriptDuration"])


def _heap(page: Page) -> float:
    """Bytes in use, what nobody needs collected first: it takes the browser a few collections to let all of it go."""
    devtools = page.context.new_cdp_session(page)
    for _ in range(COLLECTIONS):
        devtools.send("HeapProfiler.collectGarbage")
    used = devtools.send("Runtime.getHeapUsage")
    devtools.detach()
    return float(used["usedSize"]) + float(used.get("backingStorageSize", 0))


def _call(address: str, path: str, body: bytes | None = None) -> Any:
    request = urllib.request.Request(f"http://{address}/api/v1{path}", body)
    if body is not None and body.startswith(b"{"):
        request.add_header("content-type", "application/json")
    with urllib.request.urlopen(request, timeout=60) as answer:
        return json.load(answer)
