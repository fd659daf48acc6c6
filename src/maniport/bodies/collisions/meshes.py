"""Whether the meshes of two parts touch, which decides about pairs whose hulls fill hollows."""

import coal
import numpy as np
from numpy.typing import NDArray

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.chain import Mesh
from maniport.bodies.collisions.hulls import Part
from maniport.bodies.collisions.links import links_of

SAMPLES = 10_000
SEED = 0
"""Configurations by which pairs are left out."""

_Body = tuple[Part, int]
"""A part, and the joint that carries it among those of the arm or pair."""


class Meshes:
    """Exact meshes of parts in samples of the joint space, of which the first is at rest.

    Each mesh is prepared when it is first needed, and no test is repeated.
    """

    def __init__(self, arm: Arm | Arms):
        rest = np.clip(0.0, arm.lower, arm.upper)[None]
        self.samples = np.concatenate([rest, arm.sample(SAMPLES - 1, SEED)])
        self._links = links_of(arm)
        self._solids: dict[Part, coal.BVHModelOBBRSS] = {}
        self._results: dict[tuple[_Body, _Body], dict[int, bool]] = {}

    def touch(self, rows: NDArray[np.intp], first: _Body, second: _Body) -> NDArray[np.bool_]:
        """Whether the meshes of two parts touch in some of the samples, shape (n,)."""
        known = self._results.setdefault((first, second), {})
        missing = [row for row in rows.tolist() if row not in known]
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        one, other = self._solid(first[0]), self._solid(second[0])
        for row, turns, origins in zip(missing, *self._links.poses(self.samples[missing]), strict=True):
            a, b = (coal.Transform3s(turns[joint], origins[joint]) for _, joint in (first, second))
            result.clear()
            known[row] = coal.collide(one, a, other, b, request, result) > 0
        return np.array([known[row] for row in rows.tolist()], dtype=np.bool_)

    def _solid(self, part: Part) -> coal.BVHModelOBBRSS:
        if part not in self._solids:
            self._solids[part] = _solid(part.mesh)
        return self._solids[part]


def _solid(mesh: Mesh) -> coal.BVHModelOBBRSS:
    points, triangles = mesh
    solid = coal.BVHModelOBBRSS()
    solid.beginModel(len(triangles), len(points))
    solid.addVertices(points)
    solid.addTriangles(triangles.astype(np.int64))
    solid.endModel()
    return solid
