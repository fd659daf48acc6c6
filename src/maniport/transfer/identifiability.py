"""Whether two clouds determine the rotation between them (`docs/method/identifiability.md`).

Rotations are compared without matching: by the mean distance between all pairs, half of the energy distance up to a
constant (equation 18), with its sampling error, and by the number of ellipsoids that coincide.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from maniport.spd.kernels import roots
from maniport.spd.matrix_functions import apply, mandel_basis, to_vector
from maniport.transfer.rotation_group import orthonormal, rotation_angle, rotation_from_vector
from maniport.util.jit import kernel
from maniport.util.validation import Array

ADVICE = "give base_rotation= (orientation of the student's base in the teacher's)"

Distances = tuple[Array, Array]


class Gain(NamedTuple):
    """A mean difference, and its standard error over draws of both clouds."""

    mean: float
    standard_error: float

    @property
    def certainty(self) -> float:
        """The gain in standard errors; zero where nothing changed."""
        if self.standard_error > 0.0:
            return self.mean / self.standard_error
        return 0.0


class CloudPair:
    """Two clouds of SPD matrices, (n, d, d) and (m, d, d), about the identity; as log-vectors."""

    def __init__(self, teacher: Array, student: Array, largest: int = 1024, seekers: int = 256):
        if teacher.shape[-1] <= 3:
            limit = largest
        else:
            limit = largest // 8
        whole = [to_vector(apply(cloud, np.log)) for cloud in (teacher, student)]
        self.teacher, self.student = (subsample(vectors, limit) for vectors in whole)
        self._teacher_seeks = len(teacher) <= len(student)
        if self._teacher_seeks:
            smaller, larger = whole
        else:
            smaller, larger = reversed(whole)
        self._seeking = subsample(smaller, seekers)
        self._sought = larger

    def distances(self, rotation: Array) -> Distances:
        """Mean distances, shapes (m,) and (n,), from each student's to all turned teachers and from these to all."""
        return _distances(self.student, self.teacher @ _mandel_rotation(rotation).T)[:2]

    def nearest(self, rotation: Array) -> Array:
        """Distances from the seeking ellipsoids to the nearest of the other cloud, shape (k,)."""
        turning = _mandel_rotation(rotation)
        return _distances(
            self._seeking @ (turning.T if self._teacher_seeks else turning), self._sought
        )[2]

    def improved(
        self, start: Array, end: Array, certainty: float = 3.0, share: float = 0.1
    ) -> tuple[bool, str]:
        """Whether the rotation `end` clearly brings the clouds nearer than `start`; and if not, what it does.

        It does where the mean distance between the clouds falls by `certainty` standard errors and a `share` of their
        energy distance, or where more ellipsoids coincide by `certainty` standard errors. Without the second test 1 of
        8 rotations is accepted instead of 8 where 100 ellipsoids of each cloud share half. Measured on ten draws of
        4096 and 16384 ellipsoids: where the start was right, −0.6 to 0.4 standard errors (Panda to Panda); where the
        domains differ in shape, −1.9 to 3.8 and at most 4 % (human to Panda); where the start was 30° off, 3.9 to 5.9
        and more than half.
        """
        if rotation_angle(start, end) < 1e-6:
            return False, ""
        before = self.distances(start)
        within = sum(
            float(_distances(cloud, cloud)[0].mean()) for cloud in (self.teacher, self.student)
        )
        gain = _combined([(1.0, before), (-1.0, self.distances(end))])
        gained = 2.0 * gain.mean / max(2.0 * float(before[0].mean()) - within, 1e-12)
        nearer = gain.certainty >= certainty and gained >= share
        if nearer or _coincidence(self.nearest(start), self.nearest(end)).certainty >= certainty:
            return True, ""
        if gain.mean > 0.0:
            error = gained / gain.certainty
            return (
                False,
                f"brings the domains nearer by {100 * gained:.1f} % ± {100 * error:.1f} % only",
            )
        return False, "does not bring the domains nearer"

    def free_directions(
        self, rotation: Array, turn: float = np.pi / 6.0, least: float = 1e-3
    ) -> Array:
        """Directions (k, m) of a rotation, m = d (d − 1) / 2, that the clouds do not determine, as rotation vectors.

        `turn` is the angle of the finite differences [rad]; much smaller ones measure the graininess of the samples. A
        direction is free where the curvature, relative to the mean distance, is below `least` [1/rad²], or not above
        zero by two standard errors, unless certainly more ellipsoids coincide here than on either side. Measured: 1e-4
        to 2.4e-4 about the Panda's base axis and 2e-3 to 3e-3 across it, at most 4e-4 in the plane of a planar arm of
        two joints, at least 8.5e-3 in clouds with random covariance.
        """
        middle = self.distances(rotation)
        here = self.nearest(rotation)

        def sides(step: Array) -> list[Array]:
            return [rotation_from_vector(sign * step) @ rotation for sign in (-1.0, 1.0)]

        def difference(step: Array) -> Gain:
            """Second difference of the mean distance."""
            return _combined(
                [(-2.0, middle), *((1.0, self.distances(side)) for side in sides(step))]
            )

        directions = np.eye(len(rotation) * (len(rotation) - 1) // 2)
        free = []
        # oblique directions are off by up to 3°; measured again along these they are exact to 0.1°
        for _ in range(2):
            steps = 0.5 * turn * directions
            hessian = np.diag([difference(step).mean for step in steps])
            for a, first in enumerate(steps):
                for b, second in enumerate(steps[:a]):
                    along = (first + second) / np.sqrt(2.0)
                    across = (first - second) / np.sqrt(2.0)
                    hessian[a, b] = hessian[b, a] = 0.5 * (
                        difference(along).mean - difference(across).mean
                    )
            directions = np.linalg.eigh(hessian)[1].T @ directions
        for direction in directions:
            change = difference(turn * direction)
            if change.mean < least * turn**2 * middle[0].mean() or change.certainty < 2.0:
                certainties = []
                for side in sides(turn * direction):
                    certainties.append(_coincidence(self.nearest(side), here).certainty)
                if min(certainties) < 3.0:
                    free.append(direction)
        return np.array(free).reshape(-1, len(directions))


def free_axes(pair: CloudPair, rotation: Array, student_mean: Array) -> Array:
    """Axes (k, 3) in the student's base frame about which two clouds of 3×3 matrices leave the rotation free."""
    # S̄^½ Q S̄^-½, which a turn Q about v is in the base frame, leaves S̄^½ v where it is
    axes = pair.free_directions(rotation) @ roots(student_mean)[0]
    return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True))


class HalfTurns(NamedTuple):
    """Half turns that leave two clouds as near as they are.

    `axes` (k, 3) are in the student's base frame; `before` and `after` (k,) are the mean distances between the clouds
    without and with each turn.
    """

    axes: Array
    before: float
    after: Array


def half_turns(
    pair: CloudPair, rotation: Array, student_mean: Array, free: Array, least: float = 2e-3
) -> HalfTurns:
    """Find half turns about the axes of the student's base, and across a free axis, that the clouds do not exclude.

    A turn is excluded where the mean distance rises by the share `least` and by two standard errors, or where certainly
    fewer ellipsoids coincide. Turns about the axes in `free` (k, 3) follow from these and are not listed. Measured on
    two samples of the Panda: shares below 1e-3 about horizontal axes; 3e-2 and more between clouds of random
    covariance.
    """
    here = pair.distances(rotation)
    near = pair.nearest(rotation)
    before = float(here[0].mean())
    root, whitening = roots(student_mean)

    axes = list[Array]()
    after = list[float]()
    for axis in _candidate_axes(free):
        turn = 2.0 * np.outer(axis, axis) - np.eye(3)
        turned = orthonormal(whitening @ turn @ root) @ rotation
        there = pair.distances(turned)
        rise = _combined([(1.0, there), (-1.0, here)])
        if rise.mean > least * before and rise.certainty > 2.0:
            continue
        if _coincidence(pair.nearest(turned), near).certainty >= 3.0:
            continue
        axes.append(axis)
        after.append(float(there[0].mean()))
    return HalfTurns(np.array(axes).reshape(-1, 3), before, np.array(after))


def _candidate_axes(free: Array) -> list[Array]:
    """Axes of the base frame, and two across a free axis that is none of these; without the free ones."""
    if len(free) == 3:
        return []
    candidates = [*np.eye(3)]
    aligned = np.cos(np.deg2rad(20.0))  # free axes of 400 ellipsoids are up to 18° off
    for axis in free:
        if np.abs(axis).max() < aligned:
            _, _, across = np.linalg.svd(axis[None])
            candidates += [*across[1:]]
    chosen = []
    for candidate in candidates:
        if all(abs(float(candidate @ axis)) < aligned for axis in free):
            chosen.append(candidate)
    return chosen


def describe_determined(free: Array, turns: HalfTurns) -> str:
    """Return whether the domains determine the rotation, and if not, up to which turns."""
    text = describe_free_axes(free)
    half = describe_half_turns(turns)
    if not half:
        return text
    if not len(free):
        return half
    return f"{text}; {half}"


def describe_half_turns(turns: HalfTurns) -> str:
    """Return which half turns the domains do not exclude, with the mean distances; empty without any."""
    if not len(turns.axes):
        return ""
    parts = []
    for axis, distance in zip(turns.axes, turns.after, strict=True):
        name = "(" + ", ".join(f"{part:.2f}" for part in axis) + ")"
        if np.abs(axis).max() == 1.0:
            name = "xyz"[int(np.argmax(np.abs(axis)))]
        parts.append(f"{name} ({distance:.5g})")
    axes = " and ".join(parts)
    return (
        f"half turns about the axes {axes} of the student's base leave the domains as near as they are "
        f"(mean distance {turns.before:.5g})"
    )


def describe_free_axes(axes: Array) -> str:
    """Return whether the domains determine the rotation, and if not, about which axes it is free."""
    if not len(axes):
        return "the domains determine the rotation in every direction"
    if len(axes) == 3:
        return "the domains do not determine the rotation about any axis"
    names = []
    for axis in axes:
        nearest = int(np.argmax(np.abs(axis)))
        off = float(np.rad2deg(np.arccos(min(1.0, abs(float(axis[nearest]))))))
        upward = ", ".join(f"{part:.2f}" for part in axis * np.sign(axis[nearest]))
        near = f"the {'xyz'[nearest]} axis of the student's base ({off:.1f}° off)"
        names.append(near if off <= 15.0 else f"the axis ({upward}) of the student's base")
    return f"the domains do not determine the rotation about {' and '.join(names)}"


def subsample(vectors: Array, limit: int) -> Array:
    """Take at most `limit` of many vectors (n, k), one from each of as many equal parts of the cloud."""
    if len(vectors) <= limit:
        return vectors
    order = np.asarray(cKDTree(vectors, leafsize=max(1, len(vectors) // limit)).indices)
    middles = ((np.arange(limit) + 0.5) * (len(vectors) / limit)).astype(int)
    return np.asarray(vectors[order[middles]])


def _combined(terms: Sequence[tuple[float, Distances]]) -> Gain:
    """Mean of a linear combination of distances, and its standard error over draws of both clouds."""
    rows = np.sum([factor * means[0] for factor, means in terms], axis=0)
    columns = np.sum([factor * means[1] for factor, means in terms], axis=0)
    variance = np.var(rows, ddof=1) / len(rows) + np.var(columns, ddof=1) / len(columns)
    return Gain(float(np.mean(rows)), float(np.sqrt(variance)))


def _coincidence(before: Array, after: Array) -> Gain:
    """By how much more ellipsoids coincide than before, from nearest distances under two rotations."""
    change = (2.0 * after <= before).astype(float) - (2.0 * before <= after)
    return Gain(float(change.mean()), float(np.linalg.norm(change) / len(change)))


def _mandel_rotation(rotation: Array) -> Array:
    """Matrix that turns Mandel vectors as R X Rᵀ turns the matrices."""
    basis = mandel_basis(len(rotation))
    turned = (rotation @ basis @ rotation.T).reshape(len(basis), -1)
    return np.asarray(basis.reshape(len(basis), -1) @ turned.T)


def _distances(vectors: Array, others: Array) -> tuple[Array, Array, Array]:
    """Mean distances from each vector (n, k) to the others (m, k), and from these to all; and to the nearest other."""
    rows = np.empty(len(vectors))
    columns = np.zeros(len(others))
    least = np.empty(len(vectors))
    # single precision is twice as fast, and exact enough
    single = np.ascontiguousarray(vectors, np.float32)
    single_others = np.ascontiguousarray(others.T, np.float32)
    _fill_distances(single, single_others, rows, columns, least)
    return rows / len(columns), columns / len(rows), least


@kernel(fastmath=True)
def _fill_distances(
    vectors: NDArray[np.float32],
    others: NDArray[np.float32],
    sums: Array,
    columns: Array,
    least: Array,
) -> None:
    """Fill sums and minima of |v_i − w_j| over j, shapes (n,), and sums over i, shape (m,); `others` is (k, m)."""
    squares = np.empty(len(columns), np.float32)
    for i in range(len(vectors)):
        squares[:] = 0.0
        for k in range(len(others)):
            for j in range(len(squares)):
                squares[j] += (others[k, j] - vectors[i, k]) ** 2
        total = 0.0
        smallest = squares[0]
        for j in range(len(squares)):
            squares[j] = np.sqrt(squares[j])
            columns[j] += squares[j]
        for j in range(len(squares)):
            total += squares[j]
            smallest = min(smallest, squares[j])
        sums[i] = total
        least[i] = smallest
