"""Configurations that are reported free of collisions are free of them, by the exact meshes of real robots.

`MANIPORT_NIGHTLY=1` runs all arms of example-robot-data with 5000 configurations each.
"""

import os
from itertools import combinations

import coal
import numpy as np
import pytest

from maniport.arms import load_arm
from maniport.arms.collisions import Collisions
from maniport.arms.loaders.packages import PACKAGES
from real_robots import NEEDS_ROBOTS

NIGHTLY = bool(os.environ.get("MANIPORT_NIGHTLY"))
NAMES = ("panda", *PACKAGES["example-robot-data"].names) if NIGHTLY else ("panda", "ur5")
COUNT, SAMPLES = (5000, 100) if NIGHTLY else (60, 40)
OVERLAPPING = (
    0.9  # meshes that meet in a larger share of the samples, and at rest, overlap by design
)
DEPTH = 1e-3  # contacts that are less deep do not count [m]


@NEEDS_ROBOTS
@pytest.mark.parametrize("name", NAMES)
def test_configurations_reported_free_are_free(name):
    arm = load_arm(f"example-robot-data/{name}")
    collisions = Collisions.of(arm)
    if not collisions.checked:
        pytest.skip(f"{name} has no meshes")
    unchecked = {frozenset(text.split(" against ")) for text in collisions.unchecked}
    q, rest = arm.sample(COUNT, 7), np.clip(0.0, arm.lower, arm.upper)
    free = q[~collisions.collides(q)]
    assert len(free) > 0.03 * COUNT
    for a, b in combinations(meshes(arm), 2):
        if abs(a[1] - b[1]) > 1 and frozenset((a[0], b[0])) not in unchecked:
            touching = free[touch(arm, free, a, b)]
            if len(touching) and touch(arm, touching, (*a[:2], smaller(a[2])), b).any():
                by_design = touch(arm, np.concatenate([[rest], arm.sample(SAMPLES, 1)]), a, b)
                assert by_design[0], (a[0], b[0])
                assert by_design.mean() > OVERLAPPING, (a[0], b[0])


def meshes(arm):
    """Names, numbers of joints and exact meshes of all bodies; grippers are open, then closed."""
    for link, mesh in arm.geometry.shapes.items():
        yield link, arm.chain.frames[link].joint, mesh
    for name, (points, triangles) in arm.geometry.attached[0].items():
        body = arm.chain.attached[name]
        for place in body.placements[:1] if len(body.placements) == 1 else body.placements[[0, -1]]:
            yield body.group, body.joint, (points @ place[:3, :3].T + place[:3, 3], triangles)


def touch(arm, q, *ends):
    """Whether two bodies touch at configurations (n, dof), shape (n,)."""
    request, result, solids = (
        coal.CollisionRequest(),
        coal.CollisionResult(),
        [solid_of(*mesh) for *_, mesh in ends],
    )
    touching = np.zeros(len(q), dtype=bool)
    for i, poses in enumerate(arm.link_poses(q)):
        places = [
            coal.Transform3s(poses[joint][:3, :3], poses[joint][:3, 3]) for _, joint, _ in ends
        ]
        result.clear()
        touching[i] = coal.collide(solids[0], places[0], solids[1], places[1], request, result) > 0
    return touching


def solid_of(points, triangles):
    solid = coal.BVHModelOBBRSS()
    solid.beginModel(len(triangles), len(points))
    solid.addVertices(np.ascontiguousarray(points))
    solid.addTriangles(np.asarray(triangles, dtype=np.int64))
    solid.endModel()
    return solid


def smaller(mesh):
    """A mesh that is smaller by `DEPTH` on each side of its box."""
    points, triangles = mesh
    middle, size = 0.5 * (points.min(axis=0) + points.max(axis=0)), np.ptp(points, axis=0)
    return middle + (points - middle) * np.maximum(
        1.0 - 2 * DEPTH / np.maximum(size, DEPTH), 0.5
    ), triangles
