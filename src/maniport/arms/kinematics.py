"""Kinematics and gravity of chains for many configurations, without checks.

Numba takes a quarter of a second to load, so that the kernels are imported where they are called.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.arms.chain import PRISMATIC, Chain
from maniport.util.validation import Array

Attachment = tuple[
    int, Array
]  # number of joints before it, and a vector (3,) in the frame of the last of them


class GravityTerms(NamedTuple):
    """Torques that hold an arm at n configurations; derivatives that were not computed have length 0."""

    torques: Array  # (n, dof): g [N m] or [N]
    changes: Array  # (n, dof, dof): ∂g_i/∂q_k


class Kinematics:
    """Poses and Jacobians of chains that may begin with common joints; the end effector is that of the first.

    Link 0 is the base, link k + 1 that after joint k. Without `columns` there is one chain.
    """

    def __init__(
        self,
        *chains: Chain,
        columns: Sequence[NDArray[np.intp]] = (),  # indices of the coordinates of each chain
        dof: int = 0,  # number of all coordinates
        common: NDArray[np.intp]
        | None = None,  # (chains, chains): number of joints with which two chains begin
    ):
        columns = columns or [np.arange(len(chains[0].coordinates))]
        dof = dof or len(chains[0].coordinates)
        joints = []
        parents = list[int]()
        rows = []
        offset = list[float]()
        self.links: list[list[int]] = []  # of each chain
        for i, (chain, own) in enumerate(zip(chains, columns, strict=True)):
            if common is None or not i:
                before = np.zeros(1, dtype=np.intp)
            else:
                before = common[i, :i]
            shared = int(before.max())
            if i:
                links = self.links[int(before.argmax())][: shared + 1]
            else:
                links = [0]
            for k in range(shared, len(chain.joints)):
                joints.append(chain.joints[k])
                parents.append(links[-1])
                links.append(len(joints))
                rows.append(np.zeros(dof))
                rows[-1][own] = chain.coupling[k]
                offset.append(chain.offset[k])
            self.links.append(links)
        count = len(joints)
        frame = chains[0].frames[chains[0].frame]
        self.parents = np.array(parents, dtype=np.int64)
        self.coupling = np.array(rows).reshape(count, dof)
        self.offset = np.array(offset)
        self.trivial = np.array_equal(self.coupling, np.eye(count)) and not np.any(self.offset)
        self.placements = np.array([joint.placement for joint in joints], dtype=np.float64).reshape(
            count, 4, 4
        )
        self.axes = np.array([joint.axis for joint in joints], dtype=np.float64).reshape(count, 3)
        self.slides = np.array([joint.kind == PRISMATIC for joint in joints], dtype=np.bool_)
        self._frame = frame.joint, np.array(frame.placement, dtype=np.float64, order="C")
        self._inertia = chains[0].inertia
        self._up = -np.array(chains[0].gravity)
        self.has_weight = self._inertia is not None and bool(self._up.any())
        self.arrays = self.parents, self.placements, self.axes, self.slides
        self.moves = np.zeros((count + 1, count), dtype=np.bool_)  # which joints move each link
        for joint, parent in enumerate(parents):
            self.moves[joint + 1] = self.moves[parent]
            self.moves[joint + 1, joint] = True

    def positions(self, q: Array) -> Array:
        """Positions of the joints, shape (n, joints), for degrees of freedom, shape (n, dof)."""
        return np.ascontiguousarray(q if self.trivial else q @ self.coupling.T + self.offset)

    def coupled(self, jacobians: Array) -> Array:
        """Chain rule from the joints, shape (..., joints), to the degrees of freedom, shape (..., dof)."""
        if self.trivial:
            return jacobians
        # One large product is faster than one small product a configuration.
        flat = jacobians.reshape(-1, jacobians.shape[-1]) @ self.coupling
        return np.asarray(flat.reshape(*jacobians.shape[:-1], flat.shape[1]))

    def motion(self, q: Array, with_jacobians: bool = True) -> tuple[Array, Array]:
        """Poses of the end effector (n, 4, 4), and Jacobians in the joints, linear rows first, (n, 6, joints)."""
        from maniport.arms.kernels import fill_motion

        rotations, origins = self.link_poses(q)
        poses = np.empty((len(q), 4, 4))
        jacobians = np.empty((len(q) if with_jacobians else 0, 6, len(self.axes)))
        fill_motion(rotations, origins, self.axes, self.slides, *self._frame, poses, jacobians)
        return poses, jacobians

    def link_poses(self, q: Array) -> tuple[Array, Array]:
        """Rotations (n, links, 3, 3) and origins (n, links, 3) of all links for degrees of freedom, shape (n, dof)."""
        from maniport.arms.kernels import fill_link_poses

        rotations = np.empty((len(q), len(self.moves), 3, 3))
        origins = np.empty((len(q), len(self.moves), 3))
        fill_link_poses(self.positions(q), *self.arrays, rotations, origins)
        return rotations, origins

    def gravity(self, q: Array, changes: bool = False) -> GravityTerms:
        """Gravity torques of one chain with masses at configurations (n, dof), perhaps with derivatives.

        With the axis s_k of joint k as a spatial motion vector, the composite inertia I_k of all links outward from it
        (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 6) and the acceleration γ of gravity, all in the
        base frame,

            g_k = s_kᵀ I_k (−γ; 0),    ∂g_k/∂q_j = ∂g_j/∂q_k = −s_kᵀ I_k (s_j × (−γ; 0)) for j ≤ k.
        """
        from maniport.arms.kernels import fill_gravity

        assert self._inertia is not None
        n = len(q)
        count = len(self.axes)
        rotations, origins = self.link_poses(q)
        torques = np.empty((n, count))
        slopes = np.empty((n if changes else 0, count, count))
        masses = self._inertia[:, 0, 0].copy()
        first_moments = self._inertia[:, [5, 3, 4], [1, 2, 0]]
        fill_gravity(
            rotations,
            origins,
            self.axes,
            self.slides,
            masses,
            first_moments,
            self._up,
            torques,
            slopes,
        )
        torques = self.coupled(torques)
        if not self.trivial:
            slopes = self.coupling.T @ slopes @ self.coupling
        return GravityTerms(torques, slopes)


class PointKinematics:
    """Origins of frames and directions fixed to a chain, with derivatives."""

    def __init__(self, chain: Chain, points: Sequence[str], directions: Sequence[Attachment] = ()):
        frames = [chain.frames[name] for name in points]
        self._count = len(points)
        fixed = [*((frame.joint, frame.placement[:3, 3]) for frame in frames), *directions]
        self._kinematics = Kinematics(chain)
        self._joints = np.array([joint for joint, _ in fixed], dtype=np.int64)
        self._vectors = np.array([vector for _, vector in fixed], dtype=np.float64).reshape(-1, 3)

    def arrays(self) -> tuple[Any, ...]:
        """Return offset and placements of the joints, and the arguments of `place_points` after the poses of links."""
        of = self._kinematics
        return (
            of.offset,
            of.placements,
            of.axes,
            of.slides,
            of.coupling,
            self._joints,
            self._vectors,
            self._count,
        )

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Compute vectors (n, k, 3) and derivatives (n, k, 3, dof) at configurations (n, dof)."""
        from maniport.arms.kernels import fill_points

        values = np.empty((len(q), len(self._joints), 3))
        slopes = np.empty((*values.shape, q.shape[1]))
        _, _, *arrays = self.arrays()
        fill_points(*self._kinematics.link_poses(q), *arrays, values, slopes)
        return values, slopes


def axis_of(chain: Chain, coordinate: int, above: int) -> Attachment:
    """Return the axis of the joint of a coordinate while the coordinates from `above` up to it are zero."""
    last = [joint.name for joint in chain.joints].index(chain.coordinates[coordinate])
    still = np.clip(0.0, chain.lower[above:coordinate], chain.upper[above:coordinate])
    first = max((j + 1 for j in range(last) if chain.coupling[j, :above].any()), default=0)
    vector = chain.joints[last].placement[:3, :3] @ chain.joints[last].axis
    for j in range(last - 1, first - 1, -1):
        joint = chain.joints[j]
        position = chain.coupling[j, above:coordinate] @ still + chain.offset[j]
        vector = (joint.placement @ joint.motion(position))[:3, :3] @ vector
    return first, vector
