"""Compiled gravity torques and joint-space inertia of a chain, with derivatives, for many configurations.

With the axis s_k of joint k as a spatial motion vector and the composite inertia I_k of all links outward from joint k
(Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 6), all in the base frame,

    H_ij = s_iᵀ I_j s_j for i ≤ j,            g_k = s_kᵀ I_k (−γ; 0) with the acceleration γ of gravity,

and a joint k takes all outward of it along, so that with the cross product × of motion vectors

    ∂H_ij/∂q_k = 0 for k ≤ i ≤ j,
               = −(s_k × s_i)ᵀ I_j s_j for i < k ≤ j,
               = −(s_k × s_i)ᵀ I_k s_j − (s_k × s_j)ᵀ I_k s_i for i ≤ j < k,
    ∂g_k/∂q_j  = ∂g_j/∂q_k = −s_kᵀ I_k (s_j × (−γ; 0)) for j ≤ k.
"""

import numpy as np

from maniport.util.jit import kernel, part


@kernel
def fill_dynamics(  # type: ignore[no-untyped-def]
    rotations,
    origins,
    axes,
    slides,
    masses,
    moments,
    rotational,
    up,
    gravity,
    gravity_changes,
    inertia,
    inertia_changes,
):
    """Fill the terms in the joints of a chain; arrays of length 0 are left out.

    Links have masses, first moments (3,) and rotational inertias (3, 3) about their origins; −`up` is gravity.
    """
    joints = len(axes)
    s, composite = np.empty((joints, 6)), np.zeros((joints, 13))
    turns = len(inertia) > 0 or len(inertia_changes) > 0  # gravity does not depend on rotational inertia
    momenta, crosses = np.empty((joints, joints, 6)), np.empty((joints, joints, 6))
    for n in range(len(rotations)):
        for k in range(joints):
            for i in range(3):
                s[k, 3 + i] = 0.0
                for m in range(3):
                    s[k, 3 + i] += rotations[n, k + 1, i, m] * axes[k, m]
            _cross(origins[n, k + 1], s[k, 3:], s[k, :3])
            for i in range(3 if slides[k] else 0):  # an assignment of slices takes 2 s more to compile
                s[k, i], s[k, 3 + i] = s[k, 3 + i], 0.0
        for k in range(joints - 1, -1, -1):
            _place_inertia(
                rotations[n, k + 1],
                origins[n, k + 1],
                masses[k + 1],
                moments[k + 1],
                rotational[k + 1],
                turns,
                composite[k],
            )
            if k + 1 < joints:
                for i in range(13):
                    composite[k, i] += composite[k + 1, i]
            _apply_inertia(composite[k], s[k], momenta[k, k])
            for j in range(k if len(inertia_changes) > 0 else 0):
                _apply_inertia(composite[k], s[j], momenta[k, j])
                _cross(s[k, 3:], s[j, 3:], crosses[k, j, 3:])
                _cross(s[k, 3:], s[j, :3], crosses[k, j, :3])
                for i in range(3):
                    p, q = (i + 1) % 3, (i + 2) % 3
                    crosses[k, j, i] += s[k, p] * s[j, 3 + q] - s[k, q] * s[j, 3 + p]
        if len(gravity) > 0:
            for k in range(joints):
                gravity[n, k] = 0.0
                for i in range(3):
                    gravity[n, k] += momenta[k, k, i] * up[i]
        if len(gravity_changes) > 0:
            for k in range(joints):
                for j in range(k + 1):
                    total = 0.0
                    for i in range(3):
                        p, q = (i + 1) % 3, (i + 2) % 3
                        total -= momenta[k, k, i] * (s[j, 3 + p] * up[q] - s[j, 3 + q] * up[p])
                    gravity_changes[n, k, j] = gravity_changes[n, j, k] = total
        for j in range(joints if len(inertia) > 0 else 0):
            for i in range(j + 1):
                inertia[n, i, j] = inertia[n, j, i] = _dot(s[i], momenta[j, j])
        for k in range(joints if len(inertia_changes) > 0 else 0):
            for j in range(joints):
                for i in range(j + 1):
                    total = 0.0
                    if k > j:
                        total = -_dot(crosses[k, i], momenta[k, j]) - _dot(crosses[k, j], momenta[k, i])
                    elif k > i:
                        total = -_dot(crosses[k, i], momenta[j, j])
                    inertia_changes[n, k, i, j] = inertia_changes[n, k, j, i] = total


@part
def _cross(a, b, result):  # type: ignore[no-untyped-def]
    for i in range(3):
        p, q = (i + 1) % 3, (i + 2) % 3
        result[i] = a[p] * b[q] - a[q] * b[p]


@part
def _dot(a, b):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@part
def _place_inertia(rotation, origin, mass, moment, rotational, turns, result):  # type: ignore[no-untyped-def]
    """Fill mass, first moment and rotational inertia about the base's origin (13,) of a link, along the base's axes.

    The rotational inertia is left out unless `turns`.
    """
    turned = np.empty(3)
    for i in range(3):
        turned[i] = 0.0
        for m in range(3):
            turned[i] += rotation[i, m] * moment[m]
        result[1 + i] = turned[i] + mass * origin[i]
    result[0] = mass
    for i in range(3 if turns else 0):
        for j in range(3):
            # R I Rᵀ, and the shift of the origin (Huygens and Steiner)
            total = -mass * origin[i] * origin[j] - origin[i] * turned[j] - turned[i] * origin[j]
            for m in range(3):
                for k in range(3):
                    total += rotation[i, m] * rotational[m, k] * rotation[j, k]
                if i == j:
                    total += mass * origin[m] * origin[m] + 2.0 * origin[m] * turned[m]
            result[4 + 3 * i + j] = total


@part
def _apply_inertia(body, motion, result):  # type: ignore[no-untyped-def]
    """Fill the spatial momentum (6,) of a body (13,), see `_place_inertia`, with a spatial velocity."""
    for i in range(3):
        p, q = (i + 1) % 3, (i + 2) % 3
        result[i] = body[0] * motion[i] + motion[3 + p] * body[1 + q] - motion[3 + q] * body[1 + p]
        result[3 + i] = body[1 + p] * motion[q] - body[1 + q] * motion[p]
        for m in range(3):
            result[3 + i] += body[4 + 3 * i + m] * motion[3 + m]
