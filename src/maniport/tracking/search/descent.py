"""Levenberg-Marquardt within joint limits, many searches at once.

Each search minimizes f(q) = ½ |r(q)|² with the residual r = vec(log(A^-½ M(q) A^-½)) in Mandel form and, where a hand
position is wanted, weight · (p(q) − p_wanted). The damping follows Madsen, Nielsen & Tingleff, Methods for Non-Linear
Least Squares Problems, 2004, § 3.2. Several searches serve one target: as soon as one has reached it the others end,
and every few steps the worse half of them does.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.bodies import Arm, EllipsoidSpec
from maniport.spd.kernels import compose, congruence, eigh
from maniport.tracking.search.normal_equations import add_log_residual, step_within_limits
from maniport.validation import SPD_TOLERANCE, Array

FIRST_DAMPING = 0.1
LARGEST_DAMPING = 1e8
LEAST_GAIN = 1e-4
"""Share of the expected fall of the cost that a step must bring to be taken."""
HALVING = 4
"""Number of steps after which, again and again, the worse half of a target's searches ends."""


@dataclass(frozen=True)
class Target:
    """What an arm shall reach, one row for each target.

    Attributes
    ----------
    arm : Arm
    options : dict
        ``part`` and ``joint_weights`` of the ellipsoids.
    force : bool
        Whether they are force instead of velocity ellipsoids.
    floor : float
        Added to the eigenvalues of the arm's ellipsoids.
    whitening : ndarray, shape (n, d, d)
        A^-½ of the wanted ellipsoids A, which include the floor.
    hands : ndarray, shape (n, 3), or None
        Wanted hand positions [m].
    weight : float
        What a metre counts for.
    """

    arm: Arm
    options: dict[str, Any]
    force: bool
    floor: float
    whitening: Array
    hands: Array | None
    weight: float

    def __getitem__(self, rows: Any) -> "Target":
        return replace(self, whitening=self.whitening[rows], hands=None if self.hands is None else self.hands[rows])

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """|r| (n,), the gradient Jᵀr (n, dof) and JᵀJ (n, dof, dof) at q (n, dof); |r| is infinite where r is not."""
        jacobian, own, changes = self.arm.differentials(q, EllipsoidSpec(**self.options))
        values, vectors, inverse, singular = self._spectrum(own)
        if inverse is not None:
            changes = -inverse[:, None] @ changes @ inverse[:, None]
        frames = np.swapaxes(vectors, -1, -2) @ self.whitening
        gradient, hessian = np.zeros(q.shape), np.zeros((*q.shape, q.shape[1]))
        add_log_residual(values, frames, changes, gradient, hessian)
        square = np.sum(np.log(values) ** 2, axis=1)
        if self.hands is not None:
            away = self.arm.forward(q)[:, :3, 3] - self.hands
            moves = jacobian[:, :3]
            gradient += self.weight**2 * (away[:, None] @ moves)[:, 0]
            hessian += self.weight**2 * (np.swapaxes(moves, -1, -2) @ moves)
            square += self.weight**2 * np.sum(away**2, axis=1)
        return np.sqrt(np.where(singular, np.inf, square)), gradient, hessian

    def distance(self, q: Array) -> Array:
        """Affine-invariant distances (n,) of the wanted from the arm's ellipsoids; infinite where one is singular."""
        values, _, _, singular = self._spectrum(self.arm.manipulability(q, **self.options))
        return np.where(singular, np.inf, np.sqrt(np.sum(np.log(values) ** 2, axis=1)))

    def _spectrum(self, own: Array) -> tuple[Array, Array, Array | None, NDArray[np.bool_]]:
        """Eigenvalues, ones where M is singular, and -vectors of A^-½ M A^-½; M⁻¹ of the velocity for a force."""
        inverse, singular = None, np.zeros(len(own), bool)
        if self.force:
            values, vectors = eigh(own)
            singular = values[:, 0] <= SPD_TOLERANCE * values.sum(axis=1)
            values[singular] = 1.0
            own = inverse = compose(1.0 / values, vectors)
        values, vectors = eigh(congruence(self.whitening, own + self.floor * np.eye(own.shape[-1])))
        singular |= values[:, 0] <= SPD_TOLERANCE * values[:, -1]
        values[singular] = 1.0
        return values, vectors, inverse, singular


class Searches:
    """The state of all searches, shapes (n · k, ...): the k of the first target, then those of the second and so on."""

    def __init__(self, target: Target, starts: Array):
        self.target, (self.count, self.each, dof) = target, starts.shape
        self.lower, self.upper = target.arm.lower, target.arm.upper
        self.q = np.clip(starts.reshape(-1, dof), self.lower, self.upper)
        self.owner = np.repeat(np.arange(self.count), self.each)
        self.length, self.gradient, self.hessian = target[self.owner].evaluate(self.q)
        self.damping, self.growth = np.full(len(self.q), FIRST_DAMPING), np.full(len(self.q), 2.0)

    def step(self, active: NDArray[np.intp]) -> None:
        """Try one step in each active search and take those that lower the cost."""
        trial, expected = np.empty((len(active), self.q.shape[1])), np.empty(len(active))
        step_within_limits(
            self.q[active], self.gradient[active], self.hessian[active], self.damping[active],
            self.lower, self.upper, trial, expected,
        )  # fmt: skip
        length, gradient, hessian = self.target[self.owner[active]].evaluate(trial)
        gain = 0.5 * (self.length[active] ** 2 - length**2)
        taken = gain > LEAST_GAIN * expected
        rows, lost = active[taken], active[~taken]
        ratio = gain[taken] / expected[taken]
        self.q[rows], self.length[rows] = trial[taken], length[taken]
        self.gradient[rows], self.hessian[rows] = gradient[taken], hessian[taken]
        self.damping[rows] *= np.maximum(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
        self.growth[rows] = 2.0
        self.damping[lost] *= self.growth[lost]
        self.growth[lost] *= 2.0

    def still_open(self, active: NDArray[np.intp], tol: float) -> NDArray[np.intp]:
        """The active searches that have something left to gain, of targets that none has reached."""
        q, slope, length = self.q[active], self.gradient[active], self.length[active]
        held = ((q <= self.lower) & (slope > 0)) | ((q >= self.upper) & (slope < 0))
        curvature = np.maximum(np.diagonal(self.hessian[active], axis1=1, axis2=2), np.finfo(np.float64).tiny)
        promise = np.where(held, 0.0, 0.5 * slope**2 / curvature).max(axis=1)
        reached = (self.length.reshape(self.count, self.each).min(axis=1) <= tol)[self.owner[active]]
        going = ~reached & (promise > tol * length) & np.isfinite(length) & (self.damping[active] < LARGEST_DAMPING)
        return np.asarray(active[going])

    def better_half(self, active: NDArray[np.intp]) -> NDArray[np.intp]:
        """Of each target's active searches the better half, at least one."""
        order = active[np.lexsort((self.length[active], self.owner[active]))]
        owner = self.owner[order]
        first = np.searchsorted(owner, owner)
        size = np.searchsorted(owner, owner, side="right") - first
        return np.sort(order[np.arange(len(order)) - first < (size + 1) // 2])


def descend(target: Target, starts: Array, tol: float, max_iter: int) -> Array:
    """Search for each target from several starts, shape (n, k, dof); the best joint positions found, (n, dof)."""
    searches = Searches(target, starts)
    active = searches.still_open(np.arange(len(searches.q)), tol)
    for iteration in range(1, max_iter + 1):
        if not len(active):
            break
        searches.step(active)
        active = searches.still_open(active, tol)
        if iteration % HALVING == 0:
            active = searches.better_half(active)
    lengths = searches.length.reshape(searches.count, searches.each)
    best = np.arange(searches.count) * searches.each + np.argmin(lengths, axis=1)
    return np.asarray(searches.q[best])
