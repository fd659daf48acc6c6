"""Initial rotations of the ICP."""

from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from maniport.spd.kernels import eigh
from maniport.transfer.rotation_group import orthonormal
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array


def rotations_by_voting(
    teacher: Array, student: Array, elected: int, voters: int = 128, candidates: int = 3
) -> list[Array]:
    """Rotations that many pairs of ellipsoids with nearly equal eigenvalues agree on, most votes first.

    Up to `voters` ellipsoids of the smaller cloud each propose the rotations onto their most similar `candidates`.
    Without them 4 of 8 rotations are recovered instead of 8 where two clouds of 100 ellipsoids share half. Alignments
    of the clouds' frames, as further starts, recover no more.
    """
    if len(teacher) > len(student):
        return [rotation.T for rotation in rotations_by_voting(student, teacher, elected, voters, candidates)]
    d = teacher.shape[-1]
    signs = np.array([turn for turn in product((1.0, -1.0), repeat=d) if np.prod(turn) > 0.0])
    signs = signs[:64] if d % 2 else signs[signs[:, 0] > 0.0][:64]  # in even dimension −P does what P does
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
