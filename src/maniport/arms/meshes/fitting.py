"""Simple solids fitted to meshes, as MuJoCo fits them."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import QhullError

from maniport.arms.chain import Mesh
from maniport.arms.meshes import hull_triangles
from maniport.util.validation import Array

MESH_INERTIAS = ("convex", "exact", "legacy", "shell")
"""Ways to compute the inertia of a mesh: of its hull, exactly, with all volumes positive, of its surface."""
LEAST_VOLUME = 1e-15  # below it MuJoCo takes a volume [m³] or an area [m²] as zero


class Fitted(NamedTuple):
    """A solid that fits a mesh.

    Attributes
    ----------
    pose : ndarray, shape (4, 4)
        Its frame in the frame of the mesh.
    sizes : list of float
        Radius, radius and half of the length, or semi-axes [m], as in an MJCF.
    """

    pose: Array
    sizes: list[float]


class _MassProperties(NamedTuple):
    size: float  # volume [m³] or area [m²]
    center: Array  # (3,) [m]
    moments: Array  # (3, 3) about the center, for a density of one


def fitted(kind: str, mesh: Mesh, inertia: str, to_bounds: bool) -> Fitted:
    """Fit a simple solid to a mesh along its principal axes of inertia.

    Parameters
    ----------
    kind : {"sphere", "capsule", "cylinder", "ellipsoid", "box"}
    mesh : Mesh
    inertia : str
        One of `MESH_INERTIAS`.
    to_bounds : bool
        Whether the solid fills the bounds of the mesh along its principal axes, rather than having about its inertia.

    Raises
    ------
    ValueError
        When the mesh has no volume, or no surface.
    """
    properties = _mass_properties(mesh, inertia)
    moments, axes = np.linalg.eigh(properties.moments)
    moments = moments[::-1]  # descending, so that the z axis is that of the largest extent
    axes = axes[:, ::-1]
    if np.linalg.det(axes) < 0:
        axes = axes * (1.0, 1.0, -1.0)

    pose = np.eye(4)
    pose[:3, :3] = axes
    if to_bounds:
        points = (mesh[0] - properties.center) @ axes
        low = points.min(axis=0)
        high = points.max(axis=0)
        pose[:3, 3] = properties.center + axes @ (0.5 * (low + high))
        return Fitted(pose, _sizes_of_bounds(kind, 0.5 * (high - low)))

    pose[:3, 3] = properties.center
    squares = 6.0 * (moments.sum() - 2.0 * moments) / properties.size
    half_edges = 0.5 * np.sqrt(np.maximum(squares, 0.0))  # of a box with the same inertia
    return Fitted(pose, _sizes_of_inertia(kind, half_edges))


def _sizes_of_inertia(kind: str, half_edges: Array) -> list[float]:
    """Sizes of a solid with about the inertia of a box."""
    if kind == "sphere":
        return [float(half_edges.mean())]
    radius = 0.5 * float(half_edges[0] + half_edges[1])
    if kind == "capsule":
        return [radius, max(0.0, float(half_edges[2]) - 0.5 * radius)]
    if kind == "cylinder":
        return [radius, float(half_edges[2])]
    return [float(edge) for edge in half_edges]


def _sizes_of_bounds(kind: str, half_edges: Array) -> list[float]:
    """Sizes of the smallest solid whose bounds contain a box."""
    if kind == "sphere":
        return [float(half_edges.max())]
    radius = float(half_edges[:2].max())
    if kind == "capsule":
        return [radius, max(0.0, float(half_edges[2]) - radius)]
    if kind == "cylinder":
        return [radius, float(half_edges[2])]
    return [float(edge) for edge in half_edges]


def _mass_properties(mesh: Mesh, inertia: str) -> _MassProperties:
    """Volume or area, center and moments of a mesh; the sums are those of MuJoCo's compiler."""
    points, triangles = mesh
    if inertia == "convex":
        try:
            triangles = hull_triangles(points)
        except QhullError:
            raise ValueError("it is flat") from None
    corners = points[triangles]
    normals = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    area = float(areas.sum())
    middles = corners.mean(axis=1)
    if not area > LEAST_VOLUME:
        raise ValueError("it has no surface")

    center = areas @ middles / area  # of the surface
    if inertia == "shell":
        weights = areas
    else:
        weights = _volumes(corners - center, normals, inertia)
        volume = float(weights.sum())
        if not volume > LEAST_VOLUME:
            raise ValueError("it has no volume, or its triangles are turned inward")
        center = weights @ (0.75 * middles + 0.25 * center) / volume

    corners = corners - center
    if inertia != "shell":
        weights = _volumes(corners, normals, inertia)
    size = float(weights.sum())
    sums = corners.sum(axis=1)
    products = np.einsum("nki,nkj->nij", corners, corners) + sums[:, :, None] * sums[:, None]
    if inertia == "shell":
        divisor = 12.0
    else:
        divisor = 20.0
    second = np.einsum("n,nij->ij", weights, products) / divisor
    moments = np.trace(second) * np.eye(3) - second
    return _MassProperties(size, center, moments)


def _volumes(corners: Array, normals: Array, inertia: str) -> Array:
    """Signed volumes (n,) of the pyramids over triangles (n, 3, 3) from the origin; all positive for "legacy"."""
    volumes: Array = np.einsum("ij,ij->i", corners.mean(axis=1), normals) / 3
    if inertia == "legacy":
        return np.abs(volumes)
    return volumes
