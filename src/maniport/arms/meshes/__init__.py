"""What an arm looks like: its skeleton, the poses of its links and the triangles that hang on them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from maniport.arms.chain import PRISMATIC, Chain, Mesh, Triangles
from maniport.arms.kinematics import Kinematics
from maniport.arms.meshes.visual import fewer, joined, welded
from maniport.errors import FileFormatError
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False, repr=False)
class Surface:
    """Triangles that move with one joint of an arm.

    Attributes
    ----------
    joint : int
        They are fixed after so many joints of the chain; 0: to the base. The index of their pose in what
        `maniport.arms.Arm.link_poses` returns.
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


class Look:
    """The look of the arm that a chain describes; positions are those of the chain's joints, shape (n, joints).

    What is read of files is remembered.
    """

    def __init__(self, chain: Chain, kinematics: Kinematics):
        self.chain = chain
        self._kinematics = kinematics
        self._shapes: tuple[tuple[str, Mesh], ...] | None = None
        self._stand_ins: tuple[str, ...] = ()
        self._surfaces: dict[int | None, tuple[Surface, ...]] = {}

    def skeleton(self, positions: Array) -> Array:
        """Polylines from the base through the joints to the tip, shape (n, k, 3) [m]."""
        joints, tip = self.chain.joints, self.chain.frames[self.chain.frame]
        apart = [j.name for j in joints if np.any(j.placement[:3, 3]) or j.kind == PRISMATIC]
        start = np.zeros(3) if self.chain.stand is None else self.chain.stand[:3, 3]
        corners = [np.tile(start, (len(positions), 1, 1)), self._kinematics.joint_poses(positions, apart)[..., :3, 3]]
        if np.any(tip.placement[:3, 3]) or not apart:
            corners.append(self._kinematics.forward(positions)[:, None, :3, 3])
        return np.concatenate(corners, axis=1)

    def link_poses(self, positions: Array) -> Array:
        """Poses of the base and of the frame after each joint, shape (n, joints + 1, 4, 4)."""
        poses = np.empty((len(positions), len(self.chain.joints) + 1, 4, 4))
        poses[:, 0] = np.eye(4)
        poses[:, 1:] = self._kinematics.joint_poses(positions, [joint.name for joint in self.chain.joints])
        return poses

    def surfaces(self, most: int | None) -> tuple[Surface, ...]:
        """The shapes of the arm's links on the joints that carry them, reduced to `most` triangles together."""
        if most not in self._surfaces:
            meshes = [mesh for _, mesh in self.shapes()]
            joints = [self.chain.frames[link].joint for link, _ in self.shapes()]
            if most is not None:
                meshes, joints = fewer(meshes, joints, most)
            self._surfaces[most] = tuple(
                _surface(i, [m for m, j in zip(meshes, joints, strict=True) if j == i]) for i in sorted(set(joints))
            )
        return self._surfaces[most]

    def shapes(self) -> tuple[tuple[str, Mesh], ...]:
        """Links of the arm, see `Chain.holds`, and their shapes in the frames of the joints that carry them."""
        if self._shapes is None:
            links = [link for link in self.chain.frames if self.chain.holds(link)]
            found, instead = [], []
            for shape in () if self.chain.shapes is None else self.chain.shapes(links):
                placement = self.chain.frames[shape.link].placement
                points, triangles = shape.mesh
                instead += [shape.link] if shape.stand_in else []
                found.append((shape.link, welded((points @ placement[:3, :3].T + placement[:3, 3], triangles))))
            self._shapes = tuple((link, mesh) for link, mesh in found if len(mesh[1]))
            self._stand_ins = tuple(dict.fromkeys(instead))
        return self._shapes

    @cached_property
    def attached(self) -> tuple[dict[str, Mesh], tuple[str, ...]]:
        """Shapes of the bodies that are attached to the chain, in their own frames, and names of those not readable."""
        names, shapes = [*self.chain.attached], self.chain.shapes
        meshes: dict[str, list[Mesh]] = {}
        missing = []
        try:
            read = [] if shapes is None or not names else [*shapes(names)]
        except FileFormatError:  # of one body, perhaps, which must not hide the others
            read = []
            for name in names:
                try:
                    read += shapes([name]) if shapes is not None else []
                except FileFormatError:
                    missing.append(name)
        for shape in read:
            meshes.setdefault(shape.link, []).append(welded(shape.mesh))
        whole = {link: joined(parts) for link, parts in meshes.items()}
        return {link: mesh for link, mesh in whole.items() if len(mesh[1])}, tuple(missing)

    def stand_ins(self) -> tuple[str, ...]:
        """Links that have the shapes which they collide with, since meshes of what they look like are missing."""
        self.shapes()
        return self._stand_ins


def _surface(joint: int, meshes: Sequence[Mesh]) -> Surface:
    points, triangles = joined(meshes)
    for array in (points, triangles):  # they are remembered and handed out again
        array.setflags(write=False)
    return Surface(joint, points, triangles)
