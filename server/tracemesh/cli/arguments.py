"""Types of the command line's arguments: each says what was wanted when something else comes."""

import argparse
import math
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import TypeAlias, TypeVar

from tracemesh.wire.resources import ReconstructionParameters

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
T = TypeVar("T")
Number = TypeVar("Number", int, float)
MESH_FORMATS = ("glb", "obj", "ply", "stl")


def mesh_path(text: str) -> Path:
    """A file name whose extension is a mesh format."""
    path = Path(text)
    if path.suffix.lower().lstrip(".") not in MESH_FORMATS:
        wanted = ", ".join(f".{e}" for e in MESH_FORMATS)
        raise argparse.ArgumentTypeError(f"wanted a file name that ends in {wanted}, got {text!r}")
    return path


def checked(check: Callable[[str], T], wanted: str) -> Callable[[str], T]:
    """A type for argparse that says what was wanted when `check` raises ValueError."""

    def convert(text: str) -> T:
        try:
            return check(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"wanted {wanted}, got {text!r}") from None

    return convert


def _two_numbers(text: str) -> tuple[float, float]:
    latitude, longitude = text.split(",")
    return float(latitude), float(longitude)


def _measured_length(text: str) -> tuple[tuple[int, int], float]:
    segment, metres = text.split("=")
    curve, place = segment.split(":")
    return (_between(int(curve), 1) - 1, _between(int(place), 1) - 1), float(metres)


def _between(number: Number, least: float, most: float = math.inf) -> Number:
    if not least <= number <= most:
        raise ValueError(number)
    return number


step = checked(
    lambda text: ReconstructionParameters(step=text).step, "a percentage such as 1.6% or metres such as 0.01"
)
mesh_size = checked(
    lambda text: ReconstructionParameters(mesh_size=text).mesh_size,
    "a percentage such as 0.8% or metres such as 0.005",
)
place = checked(_two_numbers, "latitude and longitude in degrees, such as 45.2,5.7")
length = checked(_measured_length, "CURVE:SEGMENT=METRES, both counted from 1, such as 1:2=0.35")
iso_date = checked(date.fromisoformat, "a date such as 2026-11-22")
noise = checked(lambda text: _between(float(text), 0.0, 1.0), "a number from 0 to 1")
seed = checked(lambda text: _between(int(text), 0), "a whole number from 0 up")
port = checked(lambda text: _between(int(text), 0, 65535), "a port from 0 to 65535")
days = checked(lambda text: _between(float(text), 1e-4, 3660.0), "a number of days up to 3660")
