"""Kinematics of a chain for many configurations, without checks."""

from collections.abc import Sequence

import numpy as np

from maniport.arms.chain import PRISMATIC, Chain
from maniport.util.validation import Array


class Kinematics:
    """Poses and Jacobians of a chain."""

    def __init__(self, chain: Chain):
        self._chain = chain
        self._trivial = np.array_equal(chain.coupling, np.eye(len(chain.joints))) and not np.any(chain.offset)
        count, frame = len(chain.joints), chain.frames[chain.frame]
        self._placements = np.array([joint.placement for joint in chain.joints], dtype=np.float64).reshape(count, 4, 4)
        self._axes = np.array([joint.axis for joint in chain.joints], dtype=np.float64).reshape(count, 3)
        self._slides = np.array([joint.kind == PRISMATIC for joint in chain.joints], dtype=np.bool_)
        self._frame = frame.joint, np.array(frame.placement, dtype=np.float64, order="C")
        self._links = {joint.name: i + 1 for i, joint in enumerate(chain.joints)}

    def positions(self, q: Array) -> Array:
        """Positions of the chain's joints, shape (n, joints), for degrees of freedom, shape (n, dof)."""
        return np.ascontiguousarray(q if self._trivial else q @ self._chain.coupling.T + self._chain.offset)

    def coupled(self, jacobians: Array) -> Array:
        """Chain rule from the chain's joints, shape (..., joints), to the degrees of freedom, shape (..., dof)."""
        if self._trivial:
            return jacobians
        # One large product is faster than one small product a configuration.
        flat = jacobians.reshape(-1, jacobians.shape[-1]) @ self._chain.coupling
        return np.asarray(flat.reshape(*jacobians.shape[:-1], flat.shape[1]))

    def forward(self, positions: Array) -> Array:
        """Poses of the end effector, shape (n, 4, 4)."""
        return self._motion(positions, 0)[0]

    def jacobian(self, positions: Array) -> Array:
        """Jacobians of the end effector in the chain's joints, linear rows first, shape (n, 6, joints)."""
        return self.motion(positions)[1]

    def motion(self, positions: Array) -> tuple[Array, Array]:
        """Results of `forward` and `jacobian`, in one pass over the chain."""
        return self._motion(positions, len(positions))

    def joint_poses(self, positions: Array, joints: Sequence[str]) -> Array:
        """Poses of joints' frames after their motion, shape (n, k, 4, 4)."""
        from maniport.arms.chain_kernels import fill_link_poses

        n, count = positions.shape
        rotations, origins = np.empty((n, count + 1, 3, 3)), np.empty((n, count + 1, 3))
        parents = np.arange(count)
        fill_link_poses(positions, parents, self._placements, self._axes, self._slides, rotations, origins)
        links, poses = [self._links[name] for name in joints], np.zeros((n, len(joints), 4, 4))
        poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = rotations[:, links], origins[:, links], 1.0
        return poses

    def _motion(self, positions: Array, n_jacobians: int) -> tuple[Array, Array]:
        from maniport.arms.chain_kernels import fill_motion  # here: Numba takes a quarter of a second to load

        poses, jacobians = np.empty((len(positions), 4, 4)), np.empty((n_jacobians, 6, len(self._axes)))
        fill_motion(positions, self._placements, self._axes, self._slides, *self._frame, poses, jacobians)
        return poses, jacobians
