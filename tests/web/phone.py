"""A hand that leads a phone by the browser's own sensor override, and what became of the curve."""

import time

import numpy as np
from playwright.sync_api import CDPSession, Page

from tests.web.support import PATIENCE, Server
from tracemesh.geometry.rotations import matrix_to_quaternion

TURN = 12.0
"""s that the phone takes around the circle: slow, for it has to wait a little while the server is killed."""


class Hand:
    """Leads the phone around a circle of latitude on a sphere: top edge first, screen outwards."""

    def __init__(self, page: Page) -> None:
        self._devtools: CDPSession = page.context.new_cdp_session(page)
        metadata = {"available": True, "maximumFrequency": 60, "minimumFrequency": 1}
        self._devtools.send(
            "Emulation.setSensorOverrideEnabled",
            {"enabled": True, "type": "absolute-orientation", "metadata": metadata},
        )

    def hold(self, angle: float) -> None:
        """Bring the phone to a place of the circle, rad from East."""
        tangent = np.array([-np.sin(angle), np.cos(angle), 0.0])
        normal = np.array([0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.6])
        axes = np.column_stack([np.cross(tangent, normal), tangent, normal])
        w, x, y, z = map(float, matrix_to_quaternion(axes[None])[0])
        reading = {"quaternion": {"x": x, "y": y, "z": z, "w": w}}
        self._devtools.send("Emulation.setSensorOverrideReadings", {"type": "absolute-orientation", "reading": reading})

    def lead(self, start: float, end: float) -> None:
        """Lead it steadily over a part of the circle: a phone has no odometer, so it must not stand still."""
        begin = time.monotonic()
        duration = TURN * (end - start) / (2 * np.pi)
        while (passed := time.monotonic() - begin) < duration:
            self.hold(start + (end - start) * passed / duration)
            time.sleep(0.008)
        self.hold(end)


def reconstructed(server: Server, session: str) -> np.ndarray:
    """Points (n, 3) of the reconstructed curve, in its order."""
    job = server.call("POST", f"/sessions/{session}/reconstructions", {"surface": False, "step": "2%"})
    give_up = time.monotonic() + PATIENCE
    while job["state"] in ("queued", "running") and time.monotonic() < give_up:
        time.sleep(0.1)
        job = server.call("GET", f"/reconstructions/{job['id']}")
    assert job["state"] == "done", job["error"]
    network = server.call("GET", f"/reconstructions/{job['id']}/network.json")
    return np.array(network["points"])[[point for segment in network["segments"] for point in segment["points"]]]


def roundness(points: np.ndarray) -> float:
    """Worst distance to the best circle through points (n, 3), relative to its radius."""
    from_centre = points - points.mean(axis=0)
    axis = np.linalg.svd(from_centre)[2][2]
    height = from_centre @ axis
    radius = np.linalg.norm(from_centre - np.outer(height, axis), axis=1)
    return float(np.hypot(height, radius - radius.mean()).max() / radius.mean())
