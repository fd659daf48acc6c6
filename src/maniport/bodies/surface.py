"""Surfaces: triangles that move with the joints of an arm, for drawing."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from maniport.bodies.chain import Chain
from maniport.bodies.mesh import Mesh, Triangles, joined, reduced, welded
from maniport.validation import Array

_FEWEST = 200
"""No shape gets fewer triangles than that, as far as the whole allows, so that small ones stay recognisable."""


@dataclass(frozen=True, eq=False, repr=False)
class Surface:
    """Triangles that move with one joint of an arm.

    Attributes
    ----------
    joint : int
        They are fixed after so many joints of the chain; 0: to the base. The index of their pose in what
        `maniport.bodies.Arm.link_poses` returns.
    points : ndarray, shape (n, 3)
        Corners [m], in that joint's frame; read-only.
    triangles : ndarray of int32, shape (m, 3)
        Which three points make a triangle, counter-clockwise seen from outside where the file says so; read-only.
    """

    joint: int
    points: Array
    triangles: Triangles

    def __repr__(self) -> str:
        return f"Surface(joint {self.joint}, {len(self.points)} points, {len(self.triangles)} triangles)"


@dataclass(frozen=True, eq=False)
class Shape:
    """One piece of what a link looks like, in the link's frame."""

    link: str
    mesh: Mesh


def surfaces_on(chain: Chain, shapes: Iterable[Shape], most_triangles: int | None) -> tuple[Surface, ...]:
    """Hang the shapes of links on the joints of a chain, reduced to so many triangles altogether.

    Shapes of links that are no part of the arm are left out; see `Chain.holds`.
    """
    meshes: list[Mesh] = []
    joints: list[int] = []
    for shape in shapes:
        if chain.holds(shape.link):
            frame = chain.frames[shape.link]
            points, triangles = shape.mesh
            mesh = welded((points @ frame.placement[:3, :3].T + frame.placement[:3, 3], triangles))
            if len(mesh[1]):
                meshes.append(mesh)
                joints.append(frame.joint)
    if most_triangles is not None:
        meshes, joints = _fewer(meshes, joints, most_triangles)
    return tuple(_surface(i, [m for m, j in zip(meshes, joints, strict=True) if j == i]) for i in sorted(set(joints)))


def _surface(joint: int, meshes: Sequence[Mesh]) -> Surface:
    points, triangles = joined(meshes)
    for array in (points, triangles):  # they are remembered and handed out again
        array.setflags(write=False)
    return Surface(joint, points, triangles)


def _fewer(meshes: list[Mesh], joints: list[int], most: int) -> tuple[list[Mesh], list[int]]:
    """Reduce meshes to at most `most` triangles together; where they are very many, those of a joint as one."""
    counts = np.array([len(triangles) for _, triangles in meshes], dtype=np.int64)
    if counts.sum() <= most:
        return meshes, joints
    if len(meshes) * 20 > most and len(meshes) > len(set(joints)):
        carriers = sorted(set(joints))
        as_one = [joined([m for m, j in zip(meshes, joints, strict=True) if j == i]) for i in carriers]
        return _fewer([welded(mesh) for mesh in as_one], carriers, most)
    smaller = [reduced(mesh, int(n)) for mesh, n in zip(meshes, _shares(counts, most), strict=True)]
    kept = [i for i, (_, triangles) in enumerate(smaller) if len(triangles)]
    return [smaller[i] for i in kept], [joints[i] for i in kept]


def _shares(counts: np.ndarray, most: int) -> np.ndarray:
    """How many triangles each mesh may keep: a minimum, and what is left in proportion to what it has beyond that."""
    least = np.minimum(counts, min(_FEWEST, most // len(counts)))
    beyond = counts - least
    return np.asarray(least + beyond * (most - least.sum()) // max(beyond.sum(), 1))
