"""Compiled smooth extents along lines, see `maniport.arms.directional`, with derivatives."""

import numpy as np

from maniport.util.jit import kernel, part

TINY = 1e-300  # keeps the logarithm finite where no facet bounds a line


@kernel
def fill_force_extents(
    jacobians, torques, torque_changes, lines, power, logs, joint_changes, line_changes
):
    """Fill logarithms (n, k) of forces, and derivatives (n, k, dof) and (n, k, 3), unless they have length 0.

    Jacobians (n, 6, dof), torques T (n, dof) and their derivatives ∂T_j/∂q_k (n, dof, dof) are of configurations.
    With w and v the angular and linear columns, ∂J_j/∂q_k = w_min(j,k) × v_max(j,k).
    """
    dof = jacobians.shape[2]
    values = np.empty(dof)
    weights = np.empty(dof)
    for n in range(len(jacobians)):
        jacobian = jacobians[n]
        for line in range(lines.shape[1]):
            u = lines[n, line]
            for j in range(dof):
                along = jacobian[0, j] * u[0] + jacobian[1, j] * u[1] + jacobian[2, j] * u[2]
                values[j] = along / torques[n, j]
            logs[n, line] = _log_extent(values, power, weights)
            if len(joint_changes) == 0:
                continue

            for i in range(3):
                total = 0.0
                for j in range(dof):
                    total -= weights[j] * jacobian[i, j] / torques[n, j]
                line_changes[n, line, i] = total
            for k in range(dof):
                total = 0.0
                for j in range(dof):
                    first = min(j, k)
                    last = max(j, k)
                    change = _cross_along(jacobian, first, last, u)
                    change -= values[j] * torque_changes[n, j, k]
                    total -= weights[j] * change / torques[n, j]
                joint_changes[n, line, k] = total


@kernel
def fill_velocity_extents(jacobians, limits, lines, flat, power, logs, joint_changes, line_changes):
    """Fill logarithms (n, k) of speeds, and derivatives (n, k, dof) and (n, k, 3), unless they have length 0."""
    wanted = len(joint_changes) > 0
    dof = jacobians.shape[2]
    faces = dof * (dof - 1) // 2
    column_changes = np.empty((dof, dof, 3))  # of c_i along joint k
    normals = np.empty((faces, 3))
    sizes = np.empty(faces)
    normal_changes = np.empty((faces, dof, 3))
    size_changes = np.empty((faces, dof))
    values = np.empty(faces)
    weights = np.empty(faces)
    for n in range(len(jacobians)):
        jacobian = jacobians[n]
        for i in range(dof if wanted else 0):
            for k in range(dof):
                first = min(i, k)
                last = max(i, k)
                for x in range(3):
                    y = (x + 1) % 3
                    z = (x + 2) % 3
                    cross = jacobian[3 + y, first] * jacobian[z, last]
                    cross -= jacobian[3 + z, first] * jacobian[y, last]
                    column_changes[i, k, x] = limits[i] * cross

        face = 0
        for a in range(dof):
            for b in range(a + 1, dof):
                scale = limits[a] * limits[b]
                for x in range(3):
                    y = (x + 1) % 3
                    z = (x + 2) % 3
                    cross = jacobian[y, a] * jacobian[z, b] - jacobian[z, a] * jacobian[y, b]
                    normals[face, x] = scale * cross
                    for k in range(dof if wanted else 0):
                        change = limits[b] * column_changes[a, k, y] * jacobian[z, b]
                        change -= limits[b] * column_changes[a, k, z] * jacobian[y, b]
                        change += limits[a] * jacobian[y, a] * column_changes[b, k, z]
                        change -= limits[a] * jacobian[z, a] * column_changes[b, k, y]
                        normal_changes[face, k, x] = change
                _fill_size(
                    jacobian,
                    limits,
                    flat,
                    normals[face],
                    normal_changes[face],
                    column_changes,
                    wanted,
                    sizes[face : face + 1],
                    size_changes[face],
                )
                face += 1

        for line in range(lines.shape[1]):
            u = lines[n, line]
            for f in range(faces):
                along = normals[f, 0] * u[0] + normals[f, 1] * u[1] + normals[f, 2] * u[2]
                values[f] = along / sizes[f]
            logs[n, line] = _log_extent(values, power, weights)
            if len(joint_changes) == 0:
                continue

            for x in range(3):
                line_changes[n, line, x] = 0.0
            for k in range(dof):
                joint_changes[n, line, k] = 0.0
            for f in range(faces):
                weight = weights[f] / sizes[f]
                if weight == 0.0:
                    continue
                for x in range(3):
                    line_changes[n, line, x] -= weight * normals[f, x]
                for k in range(dof):
                    of_face = normal_changes[f, k]
                    change = of_face[0] * u[0] + of_face[1] * u[1] + of_face[2] * u[2]
                    change -= values[f] * size_changes[f, k]
                    joint_changes[n, line, k] -= weight * change


@part
def _fill_size(
    jacobian, limits, flat, normal, normal_changes, column_changes, wanted, size, size_changes
):
    """Fill Σ_i |wᵀ c_i| + ε |w|₁ + ε³ of a face with normal w, and its derivatives (dof,)."""
    dof = len(limits)
    size[0] = flat**3
    for k in range(dof):
        size_changes[k] = 0.0
    for i in range(dof):
        along = 0.0
        for x in range(3):
            along += normal[x] * jacobian[x, i]
        sign = np.sign(along)
        size[0] += sign * limits[i] * along
        for k in range(dof if wanted else 0):
            for x in range(3):
                change = limits[i] * normal_changes[k, x] * jacobian[x, i]
                change += normal[x] * column_changes[i, k, x]
                size_changes[k] += sign * change
    for x in range(3):
        sign = np.sign(normal[x])
        size[0] += flat * sign * normal[x]
        for k in range(dof if wanted else 0):
            size_changes[k] += flat * sign * normal_changes[k, x]


@part
def _log_extent(values, power, weights):
    """Return −1/p log Σ |s|ᵖ of values s, and fill weights |s|^(p−1) sign(s) / Σ |s|ᵖ."""
    largest = TINY
    for value in values:
        largest = max(largest, abs(value))
    total = 0.0
    for m in range(len(values)):
        share = values[m] / largest
        weights[m] = share ** (power - 1)
        total += weights[m] * share
    for m in range(len(values)):
        weights[m] /= total * largest
    return -np.log(largest) - np.log(total) / power


@part
def _cross_along(jacobian, first, last, u):
    """Return (w_first × v_last)ᵀ u."""
    total = 0.0
    for x in range(3):
        y = (x + 1) % 3
        z = (x + 2) % 3
        cross = jacobian[3 + y, first] * jacobian[z, last]
        cross -= jacobian[3 + z, first] * jacobian[y, last]
        total += u[x] * cross
    return total
