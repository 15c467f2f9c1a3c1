"""Surfaces that are known: the distance of any point to them."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from benchmarks.measuring import Floats, Ints
from tracemesh.geometry.network import CurveNetwork

_CANDIDATES = (
    24  # triangles, the nearest by their centres, among which the nearest is looked for; a third of it for edges
)


class Truth(Protocol):
    """A known surface; diagonal: of its bounding box, m."""

    @property
    def diagonal(self) -> float: ...

    def distance(self, points: Floats) -> Floats:
        """Distance (n,) of points (n, 3), m."""

    def samples(self) -> Floats:
        """Points (m, 3) spread evenly over the surface."""


@dataclass(frozen=True)
class MeshTruth:
    """A surface known as a triangle mesh: vertices (n, 3), faces (m, 3)."""

    vertices: Floats
    faces: Ints

    @classmethod
    def read(cls, path: Path) -> "MeshTruth":
        return cls(*_arrays(trimesh.load_mesh(path, process=True)))

    @property
    def diagonal(self) -> float:
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    @cached_property
    def _corners(self) -> Floats:
        return self.vertices[self.faces]

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._corners.mean(1))

    def closest(self, points: Floats) -> Floats:
        """Nearest points (n, 3) of the surface."""
        _, near = self._tree.query(points, _nearest(_CANDIDATES, len(self.faces)))
        count = near.shape[1]
        repeated = np.repeat(points, count, axis=0)
        found = np.asarray(trimesh.triangles.closest_point(self._corners[near.ravel()], repeated))
        best = np.linalg.norm(found - repeated, axis=1).reshape(-1, count).argmin(1)
        return np.asarray(found.reshape(-1, count, 3)[np.arange(len(points)), best])

    def distance(self, points: Floats) -> Floats:
        return np.asarray(np.linalg.norm(points - self.closest(points), axis=1))

    def samples(self) -> Floats:
        points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(self.vertices, self.faces), 4000, seed=1)
        return np.asarray(points)


@dataclass(frozen=True)
class CurveTruth:
    """The curves of an exact network, to which a reconstructed one is compared: starts, ends: (e, 3) of its edges."""

    starts: Floats
    ends: Floats

    @classmethod
    def of(cls, network: CurveNetwork) -> "CurveTruth":
        before = np.concatenate([s.points[:-1] for s in network.segments])
        after = np.concatenate([s.points[1:] for s in network.segments])
        return cls(network.points[before], network.points[after])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree((self.starts + self.ends) / 2)

    def closest(self, points: Floats) -> Floats:
        """Nearest points (n, 3) of the curves."""
        _, near = self._tree.query(points, _nearest(_CANDIDATES // 3, len(self.starts)))
        start, edge = self.starts[near], self.ends[near] - self.starts[near]
        share = ((points[:, None] - start) * edge).sum(2) / (edge**2).sum(2)
        found = start + np.clip(share, 0, 1)[..., None] * edge
        best = np.linalg.norm(found - points[:, None], axis=2).argmin(1)
        return np.asarray(found[np.arange(len(points)), best])

    def distance(self, points: Floats) -> Floats:
        """Distance (n,) of points (n, 3), m."""
        return np.asarray(np.linalg.norm(points - self.closest(points), axis=1))


@dataclass(frozen=True)
class Sphere:
    """Radius 1, centre 0."""

    diagonal: float = 2 * 3**0.5

    def distance(self, points: Floats) -> Floats:
        return np.asarray(np.abs(np.linalg.norm(points, axis=1) - 1))

    def samples(self) -> Floats:
        return MeshTruth(*_arrays(trimesh.creation.icosphere(5))).samples()


@dataclass(frozen=True)
class Torus:
    """Axis z, radii 4 and 2."""

    diagonal: float = (12**2 + 12**2 + 4**2) ** 0.5

    def distance(self, points: Floats) -> Floats:
        ring = np.hypot(points[:, 0], points[:, 1]) - 4
        return np.asarray(np.abs(np.hypot(ring, points[:, 2]) - 2))

    def samples(self) -> Floats:
        return MeshTruth(*_arrays(trimesh.creation.torus(4, 2, 256, 128))).samples()


@dataclass(frozen=True)
class Field:
    """The open height field z = .35 sin(1.7 x + .4) cos(1.5 y) - .15 x^2 + .1 y over the unit disk."""

    diagonal: float = 8.25**0.5

    def distance(self, points: Floats) -> Floats:
        foot = points.copy()
        for _ in range(8):  # Newton's steps along the normal of the foot's own tangent plane
            foot[:, 2] = self._height(foot)
            normal = self._normal(foot)
            foot = points - ((points - foot) * normal).sum(1, keepdims=True) * normal
        foot[:, 2] = self._height(foot)
        return np.asarray(np.linalg.norm(points - foot, axis=1))

    def samples(self) -> Floats:
        ball, faces = _arrays(trimesh.creation.icosphere(6))
        upper = faces[(ball[faces][:, :, 2] > 0).all(1)]  # its shadow is a mesh of the disk
        return MeshTruth(np.column_stack([ball[:, :2], self._height(ball)]), upper).samples()

    @staticmethod
    def _height(points: Floats) -> Floats:
        x, y = points[:, 0], points[:, 1]
        return np.asarray(0.35 * np.sin(1.7 * x + 0.4) * np.cos(1.5 * y) - 0.15 * x**2 + 0.1 * y)

    @staticmethod
    def _normal(points: Floats) -> Floats:
        x, y = points[:, 0], points[:, 1]
        along_x = 0.35 * 1.7 * np.cos(1.7 * x + 0.4) * np.cos(1.5 * y) - 0.3 * x
        along_y = -0.35 * 1.5 * np.sin(1.7 * x + 0.4) * np.sin(1.5 * y) + 0.1
        normal = np.column_stack([-along_x, -along_y, np.ones(len(points))])
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _nearest(wanted: int, there: int) -> list[int]:
    """Ranks of the neighbours to look for, as a list: a single one, too, comes back as a column."""
    return list(range(1, min(wanted, there) + 1))


def _arrays(mesh: trimesh.Trimesh) -> tuple[Floats, Ints]:
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
