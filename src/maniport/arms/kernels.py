"""Compiled kinematics of trees of joints and derivatives of ellipsoids, for many configurations."""

import numpy as np

from maniport.util.jit import kernel, part


@kernel
def fill_link_poses(positions, parents, placements, axes, slides, rotations, origins):
    """Fill rotations (n, links, 3, 3) and origins (n, links, 3) of the base and of the link after each joint."""
    for n in range(len(positions)):
        place_links(positions[n], parents, placements, axes, slides, rotations[n], origins[n])


@kernel
def fill_motion(rotations, origins, axes, slides, frame_joint, frame, poses, jacobians):
    """Fill poses (n, 4, 4) of a frame (4, 4) after so many joints of a chain, and its Jacobians (n, 6, joints).

    The poses of the links are those of `fill_link_poses`. Columns of later joints are zero; without Jacobians, shape
    (0, 6, joints), only poses are filled.
    """
    joints = len(axes)
    axis = np.empty(3)
    for n in range(len(poses)):
        pose = poses[n]
        for i in range(3):
            for j in range(4):
                if j == 3:
                    pose[i, j] = origins[n, frame_joint, i]
                else:
                    pose[i, j] = 0.0
                for m in range(3):
                    pose[i, j] += rotations[n, frame_joint, i, m] * frame[m, j]
            pose[3, i] = 0.0
        pose[3, 3] = 1.0
        if len(jacobians) > 0:
            jacobian = jacobians[n]
            for k in range(joints):
                for i in range(3):
                    axis[i] = 0.0
                    for m in range(3):
                        axis[i] += rotations[n, k + 1, i, m] * axes[k, m]
                for i in range(3):
                    p = (i + 1) % 3
                    q = (i + 2) % 3
                    across = axis[p] * (pose[q, 3] - origins[n, k + 1, q]) - axis[q] * (
                        pose[p, 3] - origins[n, k + 1, p]
                    )
                    if slides[k]:
                        jacobian[i, k] = axis[i]
                    else:
                        jacobian[i, k] = across
                    if slides[k]:
                        jacobian[3 + i, k] = 0.0
                    else:
                        jacobian[3 + i, k] = axis[i]
                    if k >= frame_joint:
                        jacobian[i, k] = jacobian[3 + i, k] = 0.0


@kernel
def fill_points(rotations, origins, axes, slides, coupling, joints, vectors, count, values, slopes):
    """Fill vectors (n, k, 3) on a chain and derivatives (n, k, 3, dof); see `place_points`."""
    for n in range(len(values)):
        place_points(
            rotations[n],
            origins[n],
            axes,
            slides,
            coupling,
            joints,
            vectors,
            count,
            values[n],
            slopes[n],
        )


@part
def place_points(
    rotations, origins, axes, slides, coupling, joints, vectors, count, values, slopes
):
    """Fill vectors (k, 3) after so many `joints` and derivatives (k, 3, dof); only the first `count` are points.

    The poses of the links are those of `place_links`.
    """
    axis = np.empty(3)
    slopes[:] = 0.0
    for v in range(len(joints)):
        for i in range(3):
            if v < count:
                values[v, i] = origins[joints[v], i]
            else:
                values[v, i] = 0.0
            for m in range(3):
                values[v, i] += rotations[joints[v], i, m] * vectors[v, m]
    for j in range(len(axes)):
        for i in range(3):
            axis[i] = 0.0
            for m in range(3):
                axis[i] += rotations[j + 1, i, m] * axes[j, m]
        for k in range(coupling.shape[1]):
            if coupling[j, k] == 0.0:
                continue
            x = coupling[j, k] * axis[0]
            y = coupling[j, k] * axis[1]
            z = coupling[j, k] * axis[2]
            for v in range(len(joints)):
                if j < joints[v]:
                    # zero for directions
                    if v < count:
                        at = origins[j + 1]
                        moves = 1.0
                    else:
                        at = origins[0]
                        moves = 0.0
                    p = values[v, 0] - at[0]
                    q = values[v, 1] - at[1]
                    r = values[v, 2] - at[2]
                    slopes[v, 0, k] += moves * x if slides[j] else y * r - z * q
                    slopes[v, 1, k] += moves * y if slides[j] else z * p - x * r
                    slopes[v, 2, k] += moves * z if slides[j] else x * q - y * p


@part
def place_links(positions, parents, placements, axes, slides, rotations, origins):
    """Fill the poses of the base and of the link after each joint, whose parent is the link `parents` names."""
    turn = np.empty((3, 3))
    for i in range(3):
        origins[0, i] = 0.0
        for j in range(3):
            if i == j:
                rotations[0, i, j] = 1.0
            else:
                rotations[0, i, j] = 0.0
    for k in range(len(positions)):
        x = axes[k, 0]
        y = axes[k, 1]
        z = axes[k, 2]
        angle = positions[k]
        above = parents[k]
        if slides[k]:
            sine = 0.0
            cosine = 1.0
        else:
            sine = np.sin(angle)
            cosine = np.cos(angle)
        rest = 1.0 - cosine  # Rodrigues
        turn[0, 0] = cosine + x * x * rest
        turn[0, 1] = x * y * rest - z * sine
        turn[0, 2] = x * z * rest + y * sine
        turn[1, 0] = x * y * rest + z * sine
        turn[1, 1] = cosine + y * y * rest
        turn[1, 2] = y * z * rest - x * sine
        turn[2, 0] = x * z * rest - y * sine
        turn[2, 1] = y * z * rest + x * sine
        turn[2, 2] = cosine + z * z * rest
        for i in range(3):
            total = origins[above, i]
            a = 0.0
            b = 0.0
            c = 0.0
            for m in range(3):
                total += rotations[above, i, m] * placements[k, m, 3]
                a += rotations[above, i, m] * placements[k, m, 0]
                b += rotations[above, i, m] * placements[k, m, 1]
                c += rotations[above, i, m] * placements[k, m, 2]
            origins[k + 1, i] = total
            for j in range(3):
                rotations[k + 1, i, j] = a * turn[0, j] + b * turn[1, j] + c * turn[2, j]
            if slides[k]:
                origins[k + 1, i] += angle * (a * x + b * y + c * z)


@kernel
def fill_gravity(rotations, origins, axes, slides, masses, moments, up, torques, changes):
    """Fill gravity torques (n, joints), and derivatives (n, joints, joints) unless of length 0.

    Links have masses and first moments (links, 3) about their origins; −`up` is gravity.
    """
    joints = len(axes)
    turning = np.empty((joints, 3))
    momenta = np.empty((joints, 3))
    moment = np.empty(3)
    for n in range(len(torques)):
        # of all links outward, about the base's origin
        mass = 0.0
        moment[:] = 0.0
        for k in range(joints - 1, -1, -1):
            mass += masses[k + 1]
            for i in range(3):
                turning[k, i] = 0.0
                moment[i] = moment[i] + masses[k + 1] * origins[n, k + 1, i]
                for m in range(3):
                    turning[k, i] += rotations[n, k + 1, i, m] * axes[k, m]
                    moment[i] += rotations[n, k + 1, i, m] * moments[k + 1, m]
            torques[n, k] = 0.0
            for i in range(3):
                p = (i + 1) % 3
                q = (i + 2) % 3
                at_p = moment[p] - mass * origins[n, k + 1, p]
                at_q = moment[q] - mass * origins[n, k + 1, q]
                if slides[k]:
                    momenta[k, i] = mass * turning[k, i]
                else:
                    momenta[k, i] = turning[k, p] * at_q - turning[k, q] * at_p
                torques[n, k] += momenta[k, i] * up[i]
        for k in range(joints if len(changes) > 0 else 0):
            for j in range(k + 1):
                total = 0.0
                for i in range(0 if slides[j] else 3):
                    p = (i + 1) % 3
                    q = (i + 2) % 3
                    total -= momenta[k, i] * (turning[j, p] * up[q] - turning[j, q] * up[p])
                changes[n, k, j] = changes[n, j, k] = total


@kernel
def fill_derivatives(jacobians, rows, coupling, weighted, linear, ellipsoids, results):
    """Fill ellipsoids M (n, d, d) and derivatives (n, dof, d, d) from Jacobians (n, 6, joints).

    `rows` are J W (n, d, dof) with M = J W Wᵀ Jᵀ, and `weighted` J W Wᵀ; the derivatives are those at constant W.

    Equation (2) of docs/method/geometry.md has the derivatives of the linear and angular columns v_i and w_i. With
    B = W Wᵀ Jᵀ in all joints the derivative of M is A_k + A_kᵀ with A_k = (∂J/∂q_k) B, whose rows are

        linear   w_k × Σ_{i≥k} v_i B_i  −  v_k × Σ_{i<k} w_i B_i,        angular   w_k × Σ_{i>k} w_i B_i

    so that running sums give all joints in one pass over the chain.
    """
    joints, dof = coupling.shape
    d = rows.shape[1]
    angular = d == 6 or not linear
    b = np.empty((joints, d))
    a = np.empty((joints, d, d))
    before = np.empty((3, d))
    behind = np.empty((6, d))
    for n in range(len(jacobians)):
        for x in range(d):
            for y in range(x, d):
                total = 0.0
                for k in range(dof):
                    total += rows[n, x, k] * rows[n, y, k]
                ellipsoids[n, x, y] = ellipsoids[n, y, x] = total
        before[:] = 0.0  # Σ w_i B_i over i < k
        for i in range(joints):
            for y in range(d):
                b[i, y] = 0.0
            for k in range(dof):
                if coupling[i, k] != 0.0:
                    for y in range(d):
                        b[i, y] += coupling[i, k] * weighted[n, y, k]
            for x in range(3 if linear else 0):
                p = (x + 1) % 3
                q = (x + 2) % 3
                for y in range(d):
                    a[i, x, y] = (
                        jacobians[n, p, i] * before[q, y] - jacobians[n, q, i] * before[p, y]
                    )
            for x in range(3):
                for y in range(d):
                    before[x, y] += jacobians[n, 3 + x, i] * b[i, y]
        behind[:] = 0.0  # Σ v_i B_i and Σ w_i B_i over i > k
        for k in range(joints - 1, -1, -1):
            for x in range(3):
                p = (x + 1) % 3
                q = (x + 2) % 3
                for y in range(d):
                    if angular:
                        a[k, d - 3 + x, y] = (
                            jacobians[n, 3 + p, k] * behind[3 + q, y]
                            - jacobians[n, 3 + q, k] * behind[3 + p, y]
                        )
            for x in range(3):
                for y in range(d):
                    behind[x, y] += jacobians[n, x, k] * b[k, y]
                    behind[3 + x, y] += jacobians[n, 3 + x, k] * b[k, y]
            for x in range(3 if linear else 0):
                p = (x + 1) % 3
                q = (x + 2) % 3
                for y in range(d):
                    turned = (
                        jacobians[n, 3 + p, k] * behind[q, y]
                        - jacobians[n, 3 + q, k] * behind[p, y]
                    )
                    a[k, x, y] = turned - a[k, x, y]
        for k in range(dof):
            for x in range(d):
                for y in range(d):
                    results[n, k, x, y] = 0.0
            for i in range(joints):
                if coupling[i, k] != 0.0:
                    for x in range(d):
                        for y in range(d):
                            results[n, k, x, y] += coupling[i, k] * (a[i, x, y] + a[i, y, x])
