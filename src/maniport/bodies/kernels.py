"""What is compiled of kinematics: poses of links, of the tip, and how it moves with the joints."""

import numpy as np

from maniport.compiling import njit


@njit(cache=True, nogil=True, error_model="numpy")
def place_links(positions, placements, axes, slides, turns, origins):  # type: ignore[no-untyped-def]
    """Write the poses of the base and of the frame after each joint, as `maniport.bodies.Arm.link_poses` has them.

    Parameters
    ----------
    positions : ndarray, shape (joints,)
        Of the chain's joints [rad] or [m].
    placements : ndarray, shape (joints, 4, 4)
        Of each joint in the frame of the one before it.
    axes : ndarray, shape (joints, 3)
    slides : ndarray of bool, shape (joints,)
    turns, origins : ndarray, shapes (joints + 1, 3, 3) and (joints + 1, 3)
        Results.
    """
    turn = np.empty((3, 3))
    for i in range(3):
        origins[0, i] = 0.0
        for j in range(3):
            turns[0, i, j] = 1.0 if i == j else 0.0
    for k in range(len(positions)):
        x, y, z, angle = axes[k, 0], axes[k, 1], axes[k, 2], positions[k]
        sine, cosine = (0.0, 1.0) if slides[k] else (np.sin(angle), np.cos(angle))
        rest = 1.0 - cosine  # Rodrigues
        turn[0, 0], turn[0, 1], turn[0, 2] = cosine + x * x * rest, x * y * rest - z * sine, x * z * rest + y * sine
        turn[1, 0], turn[1, 1], turn[1, 2] = x * y * rest + z * sine, cosine + y * y * rest, y * z * rest - x * sine
        turn[2, 0], turn[2, 1], turn[2, 2] = x * z * rest - y * sine, y * z * rest + x * sine, cosine + z * z * rest
        for i in range(3):
            total = origins[k, i]
            for m in range(3):
                total += turns[k, i, m] * placements[k, m, 3]
            origins[k + 1, i] = total
            a, b, c = 0.0, 0.0, 0.0
            for m in range(3):
                a += turns[k, i, m] * placements[k, m, 0]
                b += turns[k, i, m] * placements[k, m, 1]
                c += turns[k, i, m] * placements[k, m, 2]
            for j in range(3):
                turns[k + 1, i, j] = a * turn[0, j] + b * turn[1, j] + c * turn[2, j]
            if slides[k]:
                origins[k + 1, i] += angle * (a * x + b * y + c * z)


@njit(cache=True, nogil=True, error_model="numpy")
def poses_of(positions, placements, axes, slides, turns, origins):  # type: ignore[no-untyped-def]
    """`place_links` for configurations, all arrays with a leading axis."""
    for n in range(len(positions)):
        place_links(positions[n], placements, axes, slides, turns[n], origins[n])


@njit(cache=True, nogil=True, error_model="numpy")
def tips_of(positions, placements, axes, slides, joint, placement, poses, jacobians):  # type: ignore[no-untyped-def]
    """Write poses of the tip and, unless that is empty, its Jacobians, as `maniport.bodies.Arm.jacobian` has them.

    Parameters
    ----------
    positions, placements, axes, slides
        As in `place_links`, positions with a leading axis.
    joint : int
        After how many joints the tip sits, and
    placement : ndarray, shape (4, 4)
        where in the frame of the last of them.
    poses : ndarray, shape (n, 4, 4)
    jacobians : ndarray, shape (n, 6, joints) or (0, 6, joints)
        Results.
    """
    count = len(placements)
    turns, origins = np.empty((count + 1, 3, 3)), np.empty((count + 1, 3))
    for n in range(len(positions)):
        place_links(positions[n], placements, axes, slides, turns, origins)
        for i in range(3):
            poses[n, 3, i] = 0.0
            for j in range(4):
                total = origins[joint, i] if j == 3 else 0.0
                for m in range(3):
                    total += turns[joint, i, m] * placement[m, j]
                poses[n, i, j] = total
        poses[n, 3, 3] = 1.0
        if len(jacobians) == 0:
            continue
        for k in range(count):
            if k >= joint:
                for i in range(6):
                    jacobians[n, i, k] = 0.0
                continue
            turn, axis = turns[k + 1], axes[k]
            x = turn[0, 0] * axis[0] + turn[0, 1] * axis[1] + turn[0, 2] * axis[2]
            y = turn[1, 0] * axis[0] + turn[1, 1] * axis[1] + turn[1, 2] * axis[2]
            z = turn[2, 0] * axis[0] + turn[2, 1] * axis[1] + turn[2, 2] * axis[2]
            if slides[k]:
                jacobians[n, 0, k], jacobians[n, 1, k], jacobians[n, 2, k] = x, y, z
                jacobians[n, 3, k], jacobians[n, 4, k], jacobians[n, 5, k] = 0.0, 0.0, 0.0
                continue
            a = poses[n, 0, 3] - origins[k + 1, 0]
            b = poses[n, 1, 3] - origins[k + 1, 1]
            c = poses[n, 2, 3] - origins[k + 1, 2]
            jacobians[n, 0, k], jacobians[n, 1, k], jacobians[n, 2, k] = y * c - z * b, z * a - x * c, x * b - y * a
            jacobians[n, 3, k], jacobians[n, 4, k], jacobians[n, 5, k] = x, y, z
