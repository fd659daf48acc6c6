"""Where the links of a chain are, for thousands of postures at once: most pairs are excluded by that alone."""

import numpy as np
from numpy.typing import NDArray

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.chain import PRISMATIC, Chain
from maniport.bodies.collisions.kernels import poses_of
from maniport.validation import Array


class Links:
    """The base and what each joint of a chain carries; `q` are degrees of freedom, shape (n, dof)."""

    def __init__(self, chain: Chain):
        count = len(chain.joints)
        self._coupling, self._offset = chain.coupling, chain.offset
        self._moving = (
            np.array([joint.placement for joint in chain.joints], dtype=float).reshape(count, 4, 4),
            np.array([joint.axis for joint in chain.joints], dtype=float).reshape(count, 3),
            np.array([joint.kind == PRISMATIC for joint in chain.joints], dtype=np.bool_),
        )
        ends = np.abs([chain.lower, chain.upper]).max(axis=0)
        reach = np.abs(chain.coupling) @ ends + np.abs(chain.offset)
        shifts = np.linalg.norm(self._moving[0][:, :3, 3], axis=1) + np.where(self._moving[2], reach, 0.0)
        self.along = np.cumsum(np.append(0.0, shifts))
        """How far the frame after each joint is from the base at most, along the chain [m], shape (joints + 1,)."""

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Rotations (n, joints + 1, 3, 3) and origins (n, joints + 1, 3)."""
        count = len(self._offset) + 1
        turns, origins = np.empty((len(q), count, 3, 3)), np.empty((len(q), count, 3))
        poses_of(np.ascontiguousarray(q @ self._coupling.T + self._offset), *self._moving, turns, origins)
        return turns, origins

    def slopes(self, q: Array, points: Array, normals: Array, after: NDArray[np.intp]) -> Array:
        """How quickly two things on the chain part along a normal with each degree of freedom, shape (n, dof)."""
        turns, origins = self.poses(q)
        _, axes, slides = self._moving
        directions = np.einsum("njab,jb->nja", turns[:, 1:], axes)
        velocities = np.where(slides[:, None], directions, _cross(directions, points[:, None] - origins[:, 1:]))
        joints = np.arange(1, len(slides) + 1)
        carries = (joints <= after[:, :1]).astype(float) - (joints <= after[:, 1:])
        return np.asarray((np.einsum("nja,na->nj", velocities, normals) * carries) @ self._coupling)

    def leverage(self, after: NDArray[np.intp], far: Array) -> Array:
        """How quickly the distance of two things on the chain may change, with each degree of freedom, (dof, k)."""
        slides, along = self._moving[2], self.along
        joints = np.arange(1, len(slides) + 1)
        last = after.argmax(axis=1)[:, None]
        first, second = after.min(axis=1), after.max(axis=1)
        arms = along[second] - along[joints][:, None] + np.take_along_axis(far, last, axis=1)[:, 0]
        arms = np.where(slides[:, None], 1.0, arms)
        between = (joints[:, None] > first) & (joints[:, None] <= second)
        return np.asarray(np.abs(self._coupling).T @ np.where(between, arms, 0.0))


def _cross(a: Array, b: Array) -> Array:
    """Cross products (..., 3) as NumPy has them, which takes twice the time for a few."""
    product = np.empty(a.shape)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return product


class PairLinks:
    """The same of two arms: the base, what each joint of the left arm carries, and each of the right one's own.

    Joints with which both chains begin come once, with the left arm.
    """

    def __init__(self, arms: Arms):
        self._each = [Links(arm.chain) for arm in arms.each]
        self._columns, self._dof = arms.columns, arms.dof
        self._trunk, self._ours = arms.trunk, len(arms.left.chain.joints)

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Rotations and origins, as those of `Links`."""
        left, right = (links.poses(q[:, own]) for links, own in zip(self._each, self._columns, strict=True))
        turns, origins = (
            np.concatenate([ours, theirs[:, self._trunk + 1 :]], axis=1)
            for ours, theirs in zip(left, right, strict=True)
        )
        return turns, origins

    def slopes(self, q: Array, points: Array, normals: Array, after: NDArray[np.intp]) -> Array:
        """As `Links.slopes`: what the left chain's joints do, the shared ones too, and what the right one's own do."""
        slope = np.zeros((len(q), self._dof))
        for links, own, joints in zip(self._each, self._columns, self._on_each(after), strict=True):
            slope[:, own] += links.slopes(q[:, own], points, normals, joints)
        return slope

    def leverage(self, after: NDArray[np.intp], far: Array) -> Array:
        """As `Links.leverage`."""
        found = np.zeros((self._dof, len(after)))
        left, right = self._on_each(after)
        along = self._each[1].along
        out = (far + along[right] - along[self._trunk], far)  # a shared joint swings the right arm as a whole
        for links, own, joints, reach in zip(self._each, self._columns, (left, right), out, strict=True):
            found[own] += links.leverage(joints, reach)
        return found

    def _on_each(self, after: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """After how many joints of either chain things are that hang on the pair."""
        right = after > self._ours
        return np.where(right, self._trunk, after), np.where(right, after - self._ours + self._trunk, self._trunk)


def links_of(arm: Arm | Arms) -> Links | PairLinks:
    """The links of an arm or of a pair."""
    return Links(arm.chain) if isinstance(arm, Arm) else PairLinks(arm)
