"""Where the links of a chain are, for thousands of postures at once: most pairs are excluded by that alone."""

import numpy as np
from numpy.typing import NDArray

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
        self._reach = np.abs(chain.coupling) @ ends + np.abs(chain.offset)

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Rotations (n, joints + 1, 3, 3) and origins (n, joints + 1, 3), as `maniport.bodies.Arm.link_poses` has them.

        Compiled, a tenth of the time.
        """
        count = len(self._reach) + 1
        turns, origins = np.empty((len(q), count, 3, 3)), np.empty((len(q), count, 3))
        poses_of(np.ascontiguousarray(q @ self._coupling.T + self._offset), *self._moving, turns, origins)
        return turns, origins

    def slopes(self, q: Array, points: Array, normals: Array, after: NDArray[np.intp]) -> Array:
        """How quickly two things on the chain part along a normal with each degree of freedom, shape (n, dof).

        The point that joint i carries moves by axis × (point − origin), or along the axis of a slide. Joints before
        both things move both.

        Parameters
        ----------
        q : ndarray, shape (n, dof)
        points, normals : ndarray, shape (n, 3)
            Where the first of the two is nearest to the second, and the direction from the second to it.
        after : ndarray of int, shape (n, 2)
            After how many joints either is.
        """
        turns, origins = self.poses(q)
        _, axes, slides = self._moving
        directions = np.einsum("njab,jb->nja", turns[:, 1:], axes)
        velocities = np.where(slides[:, None], directions, _cross(directions, points[:, None] - origins[:, 1:]))
        joints = np.arange(1, len(slides) + 1)
        carries = (joints <= after[:, :1]).astype(float) - (joints <= after[:, 1:])
        return np.asarray((np.einsum("nja,na->nj", velocities, normals) * carries) @ self._coupling)

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
        return np.asarray(np.abs(self._coupling).T @ np.where(between, arms, 0.0))


def _cross(a: Array, b: Array) -> Array:
    """Cross products (..., 3) as NumPy has them, which takes twice the time for a few."""
    product = np.empty(a.shape)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return product
