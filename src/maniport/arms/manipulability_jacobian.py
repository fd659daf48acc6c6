"""How the manipulability ellipsoid changes with each joint: closed form, from the geometric Jacobian alone.

Let v_i and w_i be the linear and the angular column of joint i, both along the axes of the base frame (w_i = 0 for a
slide). What moves joint k carries everything behind it along, so that for revolute and prismatic joints

    ∂v_i/∂q_k = w_min(i,k) × v_max(i,k),        ∂w_i/∂q_k = w_k × w_i for k < i, else 0

(Bruyninckx & De Schutter, "Symbolic differentiation of the velocity mapping for a serial kinematic chain",
Mechanism and Machine Theory 31 (1996)). With M = J C Jᵀ and B = C Jᵀ, the change of M is A_k + A_kᵀ with
A_k = (∂J/∂q_k) B, whose rows are

    linear   w_k × Σ_{i≥k} v_i B_i  −  v_k × Σ_{i<k} w_i B_i,        angular   w_k × Σ_{i>k} w_i B_i

so that running sums give all joints in one pass over the chain.
"""

from collections.abc import Sequence
from functools import reduce

import numpy as np

from maniport.arms.manipulability import VELOCITY, EllipsoidSpec, manipulability, weighted_rows
from maniport.util.jit import kernel, part
from maniport.util.validation import Array


def with_derivatives(
    jacobian: Array, chains: Sequence[tuple[float, Array, Array]], spec: EllipsoidSpec = VELOCITY
) -> tuple[Array, Array]:
    """Manipulability matrices (n, d, d) and their derivatives (n, dof, d, d) in the degrees of freedom.

    The Jacobian, shape (n, 6, dof), is a sum over chains: their factors, Jacobians in their joints, and couplings.
    """
    dof = jacobian.shape[2]
    rows = np.ascontiguousarray(weighted_rows(jacobian, spec))
    weights = 1.0 if spec.joint_weights is None else spec.weights(dof)
    ellipsoids, changes = np.empty((len(rows), rows.shape[1], rows.shape[1])), []
    for factor, of_joints, coupling in chains:
        change = np.empty((len(rows), dof, rows.shape[1], rows.shape[1]))
        # Numba compiles once more for arrays that are not contiguous
        arrays = np.ascontiguousarray(of_joints), rows, np.ascontiguousarray(coupling), coupling * weights
        _derivatives(*arrays, spec.part != "rotation", ellipsoids, change)
        changes.append(change if factor == 1.0 else np.multiply(factor, change, out=change))
    results = reduce(np.add, changes)
    if spec.kind == "velocity":
        return ellipsoids, results
    force = manipulability(jacobian, spec)
    change = -force[:, None] @ results @ force[:, None]  # of an inverse
    return force, np.asarray(0.5 * (change + np.swapaxes(change, -1, -2)))


@kernel
def _derivatives(jacobians, rows, coupling, weighted, linear, ellipsoids, results):  # type: ignore[no-untyped-def]
    """Fill M (n, d, d) and derivatives (n, dof, d, d); `rows` (n, d, dof) and `weighted` (joints, dof) have weights."""
    joints, dof = coupling.shape
    d = rows.shape[1]
    b, a, sums = np.empty((joints, d)), np.empty((joints, d, d)), np.empty((3, d))
    for n in range(len(jacobians)):
        for x in range(d):
            for y in range(x, d):
                total = 0.0
                for k in range(dof):
                    total += rows[n, x, k] * rows[n, y, k]
                ellipsoids[n, x, y] = ellipsoids[n, y, x] = total
        for i in range(joints):
            for y in range(d):
                b[i, y] = 0.0
            for k in range(dof):
                if weighted[i, k] != 0.0:
                    for y in range(d):
                        b[i, y] += weighted[i, k] * rows[n, y, k]
        if linear:
            _fill_rows(jacobians, n, b, 0, 0, sums, a)
            _subtract_rows(jacobians, n, b, sums, a)
        if d == 6 or not linear:
            _fill_rows(jacobians, n, b, 3, d - 3, sums, a)
        for k in range(dof):
            for x in range(d):
                for y in range(d):
                    results[n, k, x, y] = 0.0
            for i in range(joints):
                if coupling[i, k] != 0.0:
                    for x in range(d):
                        for y in range(d):
                            results[n, k, x, y] += coupling[i, k] * (a[i, x, y] + a[i, y, x])


@part
def _fill_rows(jacobians, n, b, column, first, behind, a):  # type: ignore[no-untyped-def]
    """Fill a[k, first:first + 3] = w_k × Σ v_i b_i over i ≥ k or, where the column is 3, w_k × Σ w_i b_i over i > k."""
    joints, d = b.shape
    for x in range(3):
        for y in range(d):
            behind[x, y] = 0.0
    for k in range(joints - 1, -1, -1):
        for turn in range(2):  # for i ≥ k the sum first, for i > k the product first
            for x in range(3):
                p, q = (x + 1) % 3, (x + 2) % 3
                for y in range(d):
                    if (turn == 0) == (column == 0):
                        behind[x, y] += jacobians[n, column + x, k] * b[k, y]
                    else:
                        a[k, first + x, y] = (
                            jacobians[n, 3 + p, k] * behind[q, y] - jacobians[n, 3 + q, k] * behind[p, y]
                        )


@part
def _subtract_rows(jacobians, n, b, before, a):  # type: ignore[no-untyped-def]
    """Subtract v_k × Σ_{i<k} w_i b_i from a[k, 0:3]."""
    joints, d = b.shape
    for x in range(3):
        for y in range(d):
            before[x, y] = 0.0
    for k in range(joints):
        for x in range(3):
            p, q = (x + 1) % 3, (x + 2) % 3
            for y in range(d):
                a[k, x, y] -= jacobians[n, p, k] * before[q, y] - jacobians[n, q, k] * before[p, y]
        for x in range(3):
            for y in range(d):
                before[x, y] += jacobians[n, 3 + x, k] * b[k, y]
