"""Where to start the search for a rotation between two sets of ellipsoids: frames, votes of copies, and known pairs."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations, product

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from maniport.errors import InvalidInputError
from maniport.spd.kernels import eigh
from maniport.subsample import evenly_spaced
from maniport.transfer.cloud_kernels import count_above
from maniport.transfer.icp.rotation import RotationPrior, RotationProblem
from maniport.transfer.rotation_group import orthonormal, random_rotation, rotation_angle
from maniport.validation import Array, as_points

NEAR_ISOTROPIC = 0.1

SEEKERS = 128
"""Ellipsoids of the smaller cloud that vote for rotations."""

RESEMBLING = 3
"""How many ellipsoids of the other cloud each of them takes for its copy."""

AGREEING = np.deg2rad(10.0)
"""Rotations closer than this vote for one another [rad]."""

ELECTED = 4
"""Rotations that are elected."""

VOTES = 4096
"""Rotations that are compared at most."""

Side = Callable[[ArrayLike, str], Array]
"""Treats ellipsoids, shape (k, d, d), as those of a domain were; also takes their name, for messages."""

TIE_BREAK = 1e-6
"""Weight of a prior, relative to the pairs' own size, that decides between rotations that suit the pairs equally."""

DISTINCT = 0.01
"""Angle [rad] from which on rotations are different ones."""


def starts(teacher: Array, student: Array, random: np.random.Generator) -> list[Array]:
    """Rotations worth starting from: those that align the frames of the two sets' arithmetic means."""
    value_t, frame_t = eigh(teacher.mean(axis=0))
    value_s, frame_s = eigh(student.mean(axis=0))
    d = len(value_t)
    found = [frame_s @ turn @ frame_t.T for turn in signed_permutations(d)]
    found = [orthonormal(r) if np.linalg.det(r) > 0 else orthonormal(_mirrored(r, frame_t)) for r in found]
    gaps = np.concatenate([np.diff(value_t) / value_t[1:], np.diff(value_s) / value_s[1:]])
    if d > 3 or gaps.min() < NEAR_ISOTROPIC:
        found += [random_rotation(d, random) for _ in range(16)]
    return found


def voted(teacher: Array, student: Array) -> list[Array]:
    """Rotations that many pairs of ellipsoids with equal axes agree on, the most popular first."""
    if len(teacher) > len(student):
        return [rotation.T for rotation in voted(student, teacher)]
    d = teacher.shape[-1]
    signs = np.array([np.diag(turn) for turn in signed_permutations(d) if np.diag(turn).all()])
    count = min(SEEKERS, len(teacher), VOTES // (len(signs) * RESEMBLING))
    if count < 3:
        return []
    (value_t, frame_t), (value_s, frame_s) = eigh(teacher[evenly_spaced(len(teacher), count)]), eigh(student)
    for frame in (frame_t, frame_s):
        frame[:, :, 0] *= np.sign(np.linalg.det(frame))[:, None]
    like = cKDTree(np.log(value_s)).query(np.log(value_t), k=[*range(1, min(RESEMBLING, len(student)) + 1)])[1]
    turns = (frame_s[like][:, :, None] * signs[:, None, :]) @ np.swapaxes(frame_t, 1, 2)[:, None, None]
    proposals = turns.reshape(-1, d * d)
    radius = 2.0 * np.sqrt(2.0) * np.sin(AGREEING / 2.0)  # |R - R'| of a turn in one plane
    agreeing = d - 0.5 * radius**2  # tr(RᵀR') of rotations that far apart
    votes = np.empty(len(proposals))
    count_above(proposals, np.ascontiguousarray(proposals.T), agreeing, votes)
    found = list[Array]()
    for place in np.argsort(-votes, kind="stable"):
        if len(found) == ELECTED:
            break
        here = orthonormal(proposals[proposals @ proposals[place] > agreeing].mean(axis=0).reshape(d, d))
        if all(np.linalg.norm(here - other) > 2.0 * radius for other in found):
            found.append(here)
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


@dataclass(frozen=True)
class KnownPairs:
    """Ellipsoids that belong together, teacher[i] and student[i], shapes (k, d, d)."""

    teacher: Array
    student: Array

    def rotations(self, near: Array, random: np.random.Generator) -> list[Array]:
        """Return the rotations that turn the teacher's ellipsoids best onto the student's, equally well."""
        count = len(self.teacher)
        size = np.sum(np.log(np.linalg.eigvalsh(np.concatenate([self.teacher, self.student]))) ** 2) / count
        prior = RotationPrior(near, TIE_BREAK * (1.0 + float(size)))
        problem = RotationProblem(self.student, self.teacher, np.full(count, 1.0 / count), prior)
        first = [near, *starts(self.teacher, self.student, random)]
        ends = sorted((problem.minimize(start, tol=1e-12) for start in first), key=lambda end: end.cost)
        found = [ends[0].rotation]
        equal = ends[0].cost + 2.0 * len(near) * prior.weight  # the largest penalty there is
        for end in ends:
            if end.cost <= equal and min(rotation_angle(end.rotation, other) for other in found) > DISTINCT:
                found.append(end.rotation)
        return found


def regular_pairs(
    pairs: tuple[ArrayLike, ArrayLike], sides_of: tuple[Side, Side], dimension: int
) -> tuple[Array, Array]:
    """Check known pairs and treat each side as its domain was; shapes (k, d, d)."""
    try:
        teacher, student = pairs
    except (TypeError, ValueError):
        raise InvalidInputError(
            "pairs must be two sets of ellipsoids, (teacher, student), each of shape (k, d, d); "
            f"found {type(pairs).__name__}" + (f" of {len(pairs)}" if hasattr(pairs, "__len__") else "")
        ) from None
    first, other = (
        as_points(own(side, name), name, dimension, minimum=1)
        for name, side, own in zip(("pairs[0]", "pairs[1]"), (teacher, student), sides_of, strict=True)
    )
    if len(first) != len(other):
        raise InvalidInputError(
            "pairs must hold equally many ellipsoids of teacher and student, the same task at the same time; "
            f"found {len(first)} and {len(other)}"
        )
    return first, other
