"""Kinematics of a chain for many postures at once, compiled, without checks."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from maniport.bodies.chain import PRISMATIC, Chain, Frame
from maniport.validation import Array


class Kinematics:
    """What a chain computes.

    All methods take the positions of the chain's joints, shape (n, len(chain.joints)), and answer in the base frame;
    `positions` and `coupled` lead there from the degrees of freedom and back.
    """

    def __init__(self, chain: Chain):
        self._chain = chain
        self._trivial = np.array_equal(chain.coupling, np.eye(len(chain.joints))) and not np.any(chain.offset)
        count = len(chain.joints)
        self._moving = (
            np.array([joint.placement for joint in chain.joints], dtype=float).reshape(count, 4, 4),
            np.array([joint.axis for joint in chain.joints], dtype=float).reshape(count, 3),
            np.array([joint.kind == PRISMATIC for joint in chain.joints], dtype=np.bool_),
        )
        ends = np.abs([chain.lower, chain.upper]).max(axis=0)
        self._reach = np.abs(chain.coupling) @ ends + np.abs(chain.offset)
        tip = chain.frames[chain.frame]
        self._tip = int(tip.joint), np.ascontiguousarray(tip.placement, dtype=float)
        self._after = {joint.name: i + 1 for i, joint in enumerate(chain.joints)}

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
        """Poses of the tip, shape (n, 4, 4)."""
        return self._tips(positions, 0)[0]

    def motion(self, positions: Array) -> tuple[Array, Array]:
        """Poses of the tip (n, 4, 4), and its Jacobians with respect to the chain's joints, linear rows first."""
        return self._tips(positions, len(positions))

    def _tips(self, positions: Array, count: int) -> tuple[Array, Array]:
        """Poses, and `count` Jacobians: all or none."""
        from maniport.bodies.kernels import tips_of  # here: Numba takes its time

        poses, jacobians = np.empty((len(positions), 4, 4)), np.empty((count, 6, positions.shape[1]))
        tips_of(positions, *self._moving, *self._tip, poses, jacobians)
        return poses, jacobians

    def links(self, positions: Array) -> tuple[Array, Array]:
        """Rotations (n, joints + 1, 3, 3) and origins (n, joints + 1, 3) of the base and of what each joint carries."""
        from maniport.bodies.kernels import poses_of  # here: Numba takes its time

        count = len(self._moving[0]) + 1
        turns, origins = np.empty((len(positions), count, 3, 3)), np.empty((len(positions), count, 3))
        poses_of(positions, *self._moving, turns, origins)
        return turns, origins

    def velocities(self, turns: Array, origins: Array, points: Array) -> Array:
        """How points move with all joints, as if the last one carried them, shape (n, k, joints, 3).

        Parameters
        ----------
        turns, origins
            As `links` gives them.
        points : ndarray, shape (n, k, 3)
        """
        _, axes, slides = self._moving
        directions = np.einsum("njab,jb->nja", turns[:, 1:], axes)[:, None]
        return np.asarray(
            np.where(slides[:, None], directions, np.cross(directions, points[:, :, None] - origins[:, None, 1:]))
        )

    def leverage(self, after: NDArray[np.intp], far: Array) -> Array:
        """How quickly the distance of two things on the chain may change, with each degree of freedom, (dof, k).

        Parameters
        ----------
        after : ndarray of int, shape (k, 2)
            After how many joints either is.
        far : ndarray, shape (k, 2)
            How far its points are from the origin there, at most [m].
        """
        placements, _, slides = self._moving
        joints = np.arange(1, len(slides) + 1)
        shifts = np.linalg.norm(placements[:, :3, 3], axis=1) + np.where(slides, self._reach, 0.0)
        along = np.cumsum(np.append(0.0, shifts))
        last = after.argmax(axis=1)[:, None]
        first, second = after.min(axis=1), after.max(axis=1)
        arms = along[second] - along[joints][:, None] + np.take_along_axis(far, last, axis=1)[:, 0]
        arms = np.where(slides[:, None], 1.0, arms)
        between = (joints[:, None] > first) & (joints[:, None] <= second)
        return np.asarray(np.abs(self._chain.coupling).T @ np.where(between, arms, 0.0))

    def point_positions(self, positions: Array, frames: Sequence[str]) -> Array:
        """Origins of frames, shape (n, k, 3)."""
        return self._points(*self.links(positions), self._frames(frames))

    def point_jacobians(self, positions: Array, frames: Sequence[str]) -> Array:
        """Linear Jacobians of the origins of frames, shape (n, k, 3, joints)."""
        turns, origins = self.links(positions)
        known = self._frames(frames)
        moving = self.velocities(turns, origins, self._points(turns, origins, known))
        carried = np.array([frame.joint for frame in known], dtype=int)[:, None] > np.arange(positions.shape[1])
        return np.ascontiguousarray(np.swapaxes(np.where(carried[..., None], moving, 0.0), -1, -2))

    def joint_poses(self, positions: Array, joints: Sequence[str]) -> Array:
        """Poses of joints' frames after their motion, shape (n, k, 4, 4)."""
        turns, origins = self.links(positions)
        after = [self._after[name] for name in joints]
        poses = np.zeros((len(positions), len(after), 4, 4))
        poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = turns[:, after], origins[:, after], 1.0
        return poses

    def _frames(self, names: Sequence[str]) -> list[Frame]:
        return [self._chain.frames[name] for name in names]

    @staticmethod
    def _points(turns: Array, origins: Array, frames: Sequence[Frame]) -> Array:
        """Origins of frames, shape (n, k, 3)."""
        joints = [frame.joint for frame in frames]
        places = np.array([frame.placement[:3, 3] for frame in frames]).reshape(-1, 3)
        return np.asarray(np.einsum("nkab,kb->nka", turns[:, joints], places) + origins[:, joints])
