"""Meshes: simple solids, welding, reducing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniport.arms.meshes import box, capsule, cylinder, ellipsoid, reduced


def volume(points: np.ndarray, triangles: np.ndarray) -> float:
    """Volume within a closed surface; positive when its triangles are counter-clockwise from outside."""
    a, b, c = (points[column] for column in triangles.T)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def ripples(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A wavy square metre with 2 n² triangles."""
    x, y = (axis.reshape(-1) for axis in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
    lower = np.stack([corner, corner + 1, corner + n + 2], axis=1)
    upper = np.stack([corner, corner + n + 2, corner + n + 1], axis=1)
    points = np.stack([x, y, 0.02 * np.sin(7 * x) * np.cos(5 * y)], axis=1)
    return points, np.concatenate([lower, upper]).astype(np.int32)


SOLIDS = {
    "box": (box((0.1, 0.2, 0.3)), 0.006, (0.1, 0.2, 0.3)),
    "ball": (ellipsoid((0.1, 0.1, 0.1)), 4 / 3 * np.pi * 1e-3, (0.2, 0.2, 0.2)),
    "ellipsoid": (ellipsoid((0.1, 0.2, 0.3)), 4 / 3 * np.pi * 6e-3, (0.2, 0.4, 0.6)),
    "cylinder": (cylinder(0.1, 0.3), np.pi * 3e-3, (0.2, 0.2, 0.3)),
    "capsule": (capsule(0.1, 0.3), np.pi * 3e-3 + 4 / 3 * np.pi * 1e-3, (0.2, 0.2, 0.5)),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_have_their_size(name):
    """Every edge has two triangles in opposite directions, sizes are exact, volumes 2.5 % small at most."""
    (points, triangles), exact, size = SOLIDS[name]
    edges = {tuple(edge) for edge in np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])}
    assert len(edges) == 3 * len(triangles)
    assert all((b, a) in edges for a, b in edges)
    np.testing.assert_allclose(np.ptp(points, axis=0), size, atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0), -points.min(axis=0), atol=1e-12)
    assert 0.975 * exact < volume(points, triangles) < (1 + 1e-9) * exact


@given(most=st.integers(1, 400), noise=st.floats(0, 0.02), seed=st.integers(0, 99))
def test_reducing_keeps_to_the_number_and_the_box(most, noise, seed):
    """Never more triangles than allowed, no point beyond the box around the mesh or not finite, no unused point."""
    points, triangles = ripples(15)
    points = points + noise * np.random.default_rng(seed).normal(size=points.shape)
    new_points, new_triangles = reduced((points, triangles), most)
    assert len(new_triangles) <= most
    assert np.all(np.isfinite(new_points))
    if len(new_points):
        assert np.all(new_points >= points.min(axis=0) - 1e-6)
        assert np.all(new_points <= points.max(axis=0) + 1e-6)
        np.testing.assert_array_equal(np.unique(new_triangles), np.arange(len(new_points)))
