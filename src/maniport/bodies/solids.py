"""Triangles on simple solids: boxes, balls, cylinders and capsules, each around its own centre, long axis along z."""

from collections.abc import Sequence

import numpy as np

from maniport.bodies.mesh import Mesh
from maniport.validation import Array

SIDES = 32
"""Corners of the polygon that stands for a circle; its sides lie within 0.5 % of the radius."""


def box(size: Sequence[float]) -> Mesh:
    """A box with edges of the lengths `size` [m]: 8 points, 12 triangles."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * np.asarray(size)
    squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [triangle for a, b, c, d in squares for triangle in ((a, b, c), (a, c, d))]
    return corners, np.array(triangles, dtype=np.int32)


def ellipsoid(radii: Sequence[float]) -> Mesh:
    """An ellipsoid with semi-axes `radii` [m] along x, y and z."""
    points, triangles = _turned(np.sin(_ARC), -np.cos(_ARC))
    return points * np.asarray(radii), triangles


def cylinder(radius: float, length: float) -> Mesh:
    """A cylinder of that length, with flat ends [m]."""
    return _turned(np.array([0.0, radius, radius, 0.0]), 0.5 * length * np.array([-1.0, -1.0, 1.0, 1.0]))


def capsule(radius: float, length: float) -> Mesh:
    """A cylinder of that length with a half ball on either end [m]."""
    half = len(_ARC) // 2
    arc = np.concatenate([_ARC[: half + 1], _ARC[half:]])
    shift = np.repeat([-0.5 * length, 0.5 * length], half + 1)
    return _turned(radius * np.sin(arc), shift - radius * np.cos(arc))


_ARC = np.linspace(0.0, np.pi, SIDES // 2 + 1)  # from the lower pole to the upper


def _turned(radii: Array, heights: Array) -> Mesh:
    """The solid that an outline makes when it turns about z; its first and last point lie on the axis."""
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    rings = np.stack(
        [
            np.multiply.outer(radii[1:-1], np.cos(angles)),
            np.multiply.outer(radii[1:-1], np.sin(angles)),
            np.repeat(heights[1:-1, None], SIDES, axis=1),
        ],
        axis=-1,
    )
    points = np.concatenate([[[0, 0, heights[0]]], rings.reshape(-1, 3), [[0, 0, heights[-1]]]])
    here = np.arange(SIDES)
    after, last = (here + 1) % SIDES, len(points) - 1
    top = last - SIDES
    triangles = [np.stack([np.zeros_like(here), 1 + after, 1 + here], axis=1)]
    for ring in range(len(radii) - 3):
        low, high = 1 + ring * SIDES, 1 + (ring + 1) * SIDES
        triangles += [np.stack([low + here, low + after, high + after], axis=1)]
        triangles += [np.stack([low + here, high + after, high + here], axis=1)]
    triangles += [np.stack([top + here, top + after, np.full_like(here, last)], axis=1)]
    return points, np.concatenate(triangles).astype(np.int32)
