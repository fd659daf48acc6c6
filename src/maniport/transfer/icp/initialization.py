"""Initial rotations of the ICP."""

from functools import lru_cache
from itertools import permutations, product

import numpy as np
from scipy.spatial import cKDTree

from maniport.spd.kernels import eigh
from maniport.transfer.rotation_group import orthonormal, random_rotation
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array


def aligned_frames(
    teacher: Array, student: Array, random: np.random.Generator, near_isotropic: float = 0.1
) -> list[Array]:
    """Rotations that align the frames of the arithmetic means; also random ones where these frames are ill-defined."""
    value_t, frame_t = eigh(teacher.mean(axis=0))
    value_s, frame_s = eigh(student.mean(axis=0))
    d = len(value_t)
    aligned = frame_s @ np.array(signed_permutations(d)) @ frame_t.T
    aligned[np.linalg.det(aligned) < 0] @= np.eye(d) - 2.0 * frame_t[:, :1] @ frame_t[:, :1].T  # a mirror image
    rotations = list(orthonormal(aligned))
    gaps = np.concatenate([np.diff(value_t) / value_t[1:], np.diff(value_s) / value_s[1:]])
    if d > 3 or gaps.min() < near_isotropic:
        rotations += [random_rotation(d, random) for _ in range(16)]
    return rotations


def rotations_by_voting(
    teacher: Array, student: Array, voters: int = 128, candidates: int = 3, elected: int = 4
) -> list[Array]:
    """Rotations that many pairs of ellipsoids with nearly equal eigenvalues agree on, most votes first.

    Up to `voters` ellipsoids of the smaller cloud each propose the rotations onto their most similar `candidates`.
    Without them 4 of 8 rotations are recovered instead of 8 where two clouds of 100 ellipsoids share half.
    """
    if len(teacher) > len(student):
        return [rotation.T for rotation in rotations_by_voting(student, teacher, voters, candidates, elected)]
    d = teacher.shape[-1]
    signs = np.array([np.diag(turn) for turn in signed_permutations(d) if np.diag(turn).all()])
    count = min(voters, len(teacher), 4096 // (len(signs) * candidates))
    if count < 3:
        return []
    (value_t, frame_t), (value_s, frame_s) = eigh(teacher[evenly_spaced(len(teacher), count)]), eigh(student)
    for frame in (frame_t, frame_s):
        frame[:, :, 0] *= np.sign(np.linalg.det(frame))[:, None]
    _, similar = cKDTree(np.log(value_s)).query(np.log(value_t), k=[*range(1, min(candidates, len(student)) + 1)])
    turns = (frame_s[similar][:, :, None] * signs[:, None, :]) @ np.swapaxes(frame_t, 1, 2)[:, None, None]
    proposals = turns.reshape(-1, d * d)
    centers = turns[:, 0].reshape(-1, d * d)
    radius = 2.0 * np.sqrt(2.0) * np.sin(np.deg2rad(10.0) / 2.0)  # |R - R'| for 10° apart in one plane
    tree, rotations = cKDTree(proposals), list[Array]()
    for place in np.argsort(-tree.query_ball_point(centers, radius, return_length=True), kind="stable"):
        if len(rotations) == elected:
            break
        agreeing = tree.query_ball_point(centers[place], radius, return_sorted=True)
        rotation = orthonormal(proposals[agreeing].mean(axis=0).reshape(d, d))
        if all(np.linalg.norm(rotation - other) > 2.0 * radius for other in rotations):
            rotations.append(rotation)
    return rotations


@lru_cache
def signed_permutations(d: int) -> tuple[Array, ...]:
    """Signed permutation matrices of determinant +1; beyond d = 3 only sign changes, at most 64 of them."""
    orders = list(permutations(range(d))) if d <= 3 else [tuple(range(d))]
    rotations = []
    for order in orders:
        for signs in product((1.0, -1.0), repeat=d):
            matrix = np.zeros((d, d))
            matrix[np.arange(d), order] = signs
            # in even dimension −P does what P does: one of the two is enough
            if np.linalg.det(matrix) > 0 and (d % 2 or signs[0] > 0):
                rotations.append(matrix)
    return tuple(rotations[:64])
