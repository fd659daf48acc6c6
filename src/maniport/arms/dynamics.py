"""Gravity torques and joint-space inertia of a chain, with derivatives, for many configurations.

With the axis s_k of joint k as a spatial motion vector and the composite inertia I_k of all links outward from joint k
(Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 6), all in the base frame,

    H_ij = s_iᵀ I_j s_j for i ≤ j,            g_k = s_kᵀ I_k (−γ; 0) with the acceleration γ of gravity,

and a joint k takes all outward of it along, so that with the cross product × of motion vectors

    ∂H_ij/∂q_k = 0 for k ≤ i ≤ j,
               = −(s_k × s_i)ᵀ I_j s_j for i < k ≤ j,
               = −(s_k × s_i)ᵀ I_k s_j − (s_k × s_j)ᵀ I_k s_i for i ≤ j < k,
    ∂g_k/∂q_j  = ∂g_j/∂q_k = −s_kᵀ I_k (s_j × (−γ; 0)) for j ≤ k.
"""

from typing import NamedTuple

import numpy as np

from maniport.arms.chain import Chain
from maniport.arms.kinematics import Kinematics
from maniport.util.validation import Array


class DynamicsTerms(NamedTuple):
    """Terms of the equation of motion at n configurations; arrays have length 0 where they were not computed."""

    gravity: Array  # (n, dof): torques g that hold the arm [N m] or [N]
    gravity_changes: Array  # (n, dof, dof): ∂g_i/∂q_k
    inertia: Array  # (n, dof, dof): joint-space inertia H
    inertia_changes: Array  # (n, dof, dof, dof): ∂H/∂q_k, k first


class Dynamics:
    """Dynamics of a chain with masses."""

    def __init__(self, chain: Chain):
        assert chain.inertia is not None
        self._kinematics, links = Kinematics(chain), np.asarray(chain.inertia, dtype=np.float64)
        masses, moments = links[:, 0, 0], links[:, [5, 3, 4], [1, 2, 0]]  # m and m c of each link
        rotational = links[:, 3:, 3:]  # about the origin of the link
        self._bodies = tuple(np.ascontiguousarray(array) for array in (masses, moments, rotational))
        self._up = -np.asarray(chain.gravity, dtype=np.float64)

    def __call__(self, q: Array, gravity: bool = True, inertia: bool = True, changes: bool = False) -> DynamicsTerms:
        """Compute the terms at configurations (n, dof), with derivatives where `changes` is set."""
        from maniport.arms.dynamics_kernels import fill_dynamics  # here: Numba takes its time

        of, count = self._kinematics, len(self._kinematics.axes)
        rows = [len(q) if wanted else 0 for wanted in (gravity, gravity and changes, inertia, inertia and changes)]
        terms = DynamicsTerms(*(np.empty((n, *[count] * size)) for n, size in zip(rows, (1, 2, 2, 3), strict=True)))
        fill_dynamics(*of.link_poses(q), of.axes, of.slides, *self._bodies, self._up, *terms)
        if of.trivial:
            return terms
        c = of.coupling
        return DynamicsTerms(
            of.coupled(terms.gravity),
            c.T @ of.coupled(terms.gravity_changes),
            c.T @ of.coupled(terms.inertia),
            np.einsum("nmij,mk->nkij", c.T @ of.coupled(terms.inertia_changes), c, optimize=True),
        )


def point_mass(mass: float, point: Array) -> Array:
    """Spatial inertia (6, 6), linear rows first, of a mass [kg] at a point (3,) [m], about the origin."""
    x, y, z = point
    arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return mass * np.block([[np.eye(3), -arm], [arm, -arm @ arm]])


def moved_inertia(inertia: Array, pose: Array) -> Array:
    """Spatial inertia (..., 6, 6) about another frame in which its present frame has the pose (4, 4)."""
    turn, (x, y, z) = pose[:3, :3], pose[:3, 3]
    arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    force = np.block([[turn, np.zeros((3, 3))], [arm @ turn, turn]])  # transforms forces and momenta
    return np.asarray(force @ inertia @ force.T)
