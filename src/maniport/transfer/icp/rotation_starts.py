"""Where to start the search for a rotation between two sets of ellipsoids."""

from functools import lru_cache
from itertools import permutations, product

import numpy as np
from scipy.stats import special_ortho_group

from maniport.spd.kernels import eigh
from maniport.transfer.rotation_group import orthonormal
from maniport.validation import Array

NEAR_ISOTROPIC = 0.1


def starts(teacher: Array, student: Array, random: np.random.Generator) -> list[Array]:
    """Rotations worth starting from: those that align the frames of the two sets' arithmetic means.

    For d = 3 these are the 24 rotations of the cube between the two frames; where eigenvalues are distinct and the
    sets are rotated copies, the true rotation is among them. Sixteen random rotations join in when a mean is near
    isotropic (its frame then says little) and always from d = 4 up, where the frames are tried with their axes in
    order of length only.
    """
    value_t, frame_t = eigh(teacher.mean(axis=0))
    value_s, frame_s = eigh(student.mean(axis=0))
    d = len(value_t)
    found = [frame_s @ turn @ frame_t.T for turn in signed_permutations(d)]
    found = [orthonormal(r) if np.linalg.det(r) > 0 else orthonormal(_mirrored(r, frame_t)) for r in found]
    gaps = np.concatenate([np.diff(value_t) / value_t[1:], np.diff(value_s) / value_s[1:]])
    if d > 3 or gaps.min() < NEAR_ISOTROPIC:
        found += [special_ortho_group.rvs(d, random_state=random) for _ in range(16)]
    return found


@lru_cache
def signed_permutations(d: int) -> tuple[Array, ...]:
    """Signed permutation matrices of determinant +1; beyond d = 3 only sign changes, at most 64 of them."""
    orders = list(permutations(range(d))) if d <= 3 else [tuple(range(d))]
    found = []
    for order in orders:
        for signs in product((1.0, -1.0), repeat=d):
            matrix = np.zeros((d, d))
            matrix[np.arange(d), order] = signs
            # in even dimension −P does what P does: one of the two is enough
            if np.linalg.det(matrix) > 0 and (d % 2 or signs[0] > 0):
                found.append(matrix)
    return tuple(found[:64])


def _mirrored(rotation: Array, frame: Array) -> Array:
    """Flip the first axis of the frame, so that the determinant changes sign."""
    axis = frame[:, :1]
    return np.asarray(rotation @ (np.eye(len(rotation)) - 2.0 * axis @ axis.T))
