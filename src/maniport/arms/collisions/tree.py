"""Poses of the links of an arm or a group of arms, for thousands of configurations at once."""

import numpy as np
from numpy.typing import NDArray

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup, as_group
from maniport.arms.chain import PRISMATIC, Joint
from maniport.arms.chain_kernels import fill_link_poses
from maniport.util.validation import Array


class LinkTree:
    """The base, which is link 0, and the link after each joint of an arm or a group."""

    def __init__(self, arm: Arm | ArmGroup):
        group = as_group(arm)
        self.of_chain: list[list[int]] = []
        joints: list[Joint] = []
        parents: list[int] = []
        coupling, offset, reach = [], [], []
        for i, own in enumerate(group.columns):
            chain, before = group.arms[i].chain, group.common[i, :i]
            shared = int(before.max(initial=0))
            links = self.of_chain[int(before.argmax())][: shared + 1] if i else [0]
            ends = np.abs([chain.lower, chain.upper]).max(axis=0)
            for k in range(shared, len(chain.joints)):
                joints.append(chain.joints[k])
                parents.append(links[-1])
                links.append(len(joints))
                coupling.append(np.zeros(arm.dof))
                coupling[-1][own] = chain.coupling[k]
                offset.append(chain.offset[k])
                reach.append(np.abs(chain.coupling[k]) @ ends + np.abs(chain.offset[k]))
            self.of_chain.append(links)
        count = len(joints)
        self.parents = np.array(parents, dtype=np.int64)
        self.coupling = np.array(coupling).reshape(count, arm.dof)
        self._offset = np.array(offset)
        self._placements = np.array([joint.placement for joint in joints], dtype=float).reshape(count, 4, 4)
        self._axes = np.array([joint.axis for joint in joints], dtype=float).reshape(count, 3)
        self._slides = np.array([joint.kind == PRISMATIC for joint in joints], dtype=np.bool_)
        shifts = np.linalg.norm(self._placements[:, :3, 3], axis=1) + np.where(self._slides, reach, 0.0)
        self.moves = np.zeros((count + 1, count), dtype=np.bool_)
        self._along = np.zeros(count + 1)  # largest distance of each link's frame from the base [m]
        for joint, parent in enumerate(parents):
            self.moves[joint + 1] = self.moves[parent]
            self.moves[joint + 1, joint] = True
            self._along[joint + 1] = self._along[parent] + shifts[joint]

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Rotations (n, links, 3, 3) and origins (n, links, 3) at configurations (n, dof)."""
        links = len(self.parents) + 1
        turns, origins = np.empty((len(q), links, 3, 3)), np.empty((len(q), links, 3))
        positions = np.ascontiguousarray(q @ self.coupling.T + self._offset)
        fill_link_poses(positions, self.parents, self._placements, self._axes, self._slides, turns, origins)
        return turns, origins

    def slopes(self, q: Array, points: Array, normals: Array, links: NDArray[np.intp]) -> Array:
        """How quickly pairs of links (n, 2) part along normals (n, 3) at points (n, 3), shape (n, dof)."""
        turns, origins = self.poses(q)
        axes = np.einsum("njab,jb->nja", turns[:, 1:], self._axes)
        velocities = np.where(self._slides[:, None], axes, _cross(axes, points[:, None] - origins[:, 1:]))
        carries = self.moves[links[:, 0]].astype(float) - self.moves[links[:, 1]]
        return np.asarray((np.einsum("nja,na->nj", velocities, normals) * carries) @ self.coupling)

    def leverage(self, links: NDArray[np.intp], far: Array) -> Array:
        """Bound of how quickly the distance of pairs of links (k, 2) changes with the degrees of freedom, (dof, k).

        `far`, shape (k, 2), is how far each link reaches from its frame [m].
        """
        first, second = self.moves[links[:, 0]], self.moves[links[:, 1]]
        ends = self._along[links] + far
        arms = np.where(first, ends[:, :1], ends[:, 1:]) - self._along[1:]
        arms = np.where(self._slides, 1.0, arms)
        return np.asarray(np.abs(self.coupling).T @ np.where(first != second, arms, 0.0).T)


def _cross(a: Array, b: Array) -> Array:
    """Cross products (..., 3) as NumPy has them, which takes twice the time for a few."""
    product = np.empty(a.shape)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return product
