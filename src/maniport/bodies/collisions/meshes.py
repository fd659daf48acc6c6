"""Whether the meshes of two parts touch, which decides about pairs whose hulls fill hollows."""

from collections.abc import Sequence

import coal
import numpy as np
from numpy.typing import NDArray

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.chain import Mesh
from maniport.bodies.collisions.hulls import Hull, Part
from maniport.bodies.collisions.links import links_of
from maniport.validation import Array


class Meshes:
    """The meshes of hulls' parts; each is prepared when it is first needed."""

    def __init__(self, arm: Arm | Arms, hulls: Sequence[Hull], parts: Sequence[Part]):
        self._links, self._hulls, self._parts = links_of(arm), hulls, parts
        self._solids: dict[Part, coal.BVHModelOBBRSS] = {}

    def touch(self, q: Array, first: int, second: int) -> NDArray[np.bool_]:
        """Whether the meshes around two hulls touch, shape (n,), for q (n, dof)."""
        request = coal.CollisionRequest()
        one, other = (self._solid(self._parts[i]) for i in (first, second))
        a, b = self._hulls[first].joint, self._hulls[second].joint
        found = np.zeros(len(q), dtype=np.bool_)
        for i, (turns, origins) in enumerate(zip(*self._links.poses(q), strict=True)):
            places = [coal.Transform3s(turns[joint], origins[joint]) for joint in (a, b)]
            found[i] = coal.collide(one, places[0], other, places[1], request, coal.CollisionResult()) > 0
        return found

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
