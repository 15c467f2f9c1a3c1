"""Screened Poisson reconstruction by Open3D (MIT): a peer that takes the network's points and normals alone."""

import numpy as np

from benchmarks.truths import MeshTruth
from tracemesh.geometry.network import CurveNetwork

DEPTH = 8


def screened_poisson(network: CurveNetwork) -> MeshTruth | None:
    """The surface through a network's points, or None where Open3D is not installed."""
    try:
        import open3d
    except ImportError:
        return None
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(network.points))
    cloud.normals = open3d.utility.Vector3dVector(network.normals)
    mesh, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=DEPTH, n_threads=1)
    return MeshTruth(np.asarray(mesh.vertices), np.asarray(mesh.triangles, np.int64))
