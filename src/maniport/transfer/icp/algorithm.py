"""Manifold-aware ICP (Reithmeir et al. 2022, Algorithm 1): match ellipsoids, rotate them onto their partners, repeat.

Steps 1 and 2 of the algorithm recenter both clouds at the identity and dilate the teacher's to the student's dispersion
(paper, eqs. 10 to 14; `maniport.transfer.rigid_adapter`). Step 3, here, alternates

    matches   (i, j, w_ij) = correspondence(R T_i Rᵀ, S_j)                           paper, eq. 18
    rotation  R ← argmin Σ w_ij^k d²(S_j, R T_i Rᵀ) over SO(d)                        paper, eq. 15

from an initial rotation, by default that of parallel transport. Except for the nearest neighbor, no objective falls in
every iteration, so that the best iterate is returned.
"""

from dataclasses import dataclass

import numpy as np

from maniport.transfer.icp.matches import Correspondence, Matches
from maniport.transfer.icp.rotation import RotationProblem, cholesky_factors
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array


@dataclass(frozen=True)
class Registration:
    """Result of ICP from one initial rotation; rotation, cost and matches are those of its best iterate."""

    start: Array
    rotation: Array
    cost: float  # weighted root mean squared distance of the matched pairs
    matches: Matches
    history: list[float]  # cost at the start and after each iteration
    reason: str
    converged: bool


class ICP:
    """Iterative closest point between two recentered clouds, shapes (n, d, d) and (m, d, d)."""

    def __init__(
        self,
        teacher: Array,
        student: Array,
        correspondence: Correspondence,
        tol: float = 1e-8,
        pairs: tuple[Array, Array] | None = None,
    ):
        self.teacher, self.student, self.correspondence = teacher, student, correspondence
        self._match, self._tol, self._pairs = correspondence.between(teacher, student), tol, pairs
        self._pair_matches: Matches | None = None
        if pairs is not None:  # appended to the clouds
            index = np.arange(len(pairs[0]))
            weight = np.full(len(index), 1.0 / len(index))
            self._pair_matches = Matches(len(teacher) + index, len(student) + index, weight)
            teacher, student = (np.concatenate(both) for both in zip((teacher, student), pairs, strict=True))
        self._sources, self._factors = teacher, cholesky_factors(student)

    def subsampled(self, limit: int) -> "ICP":
        """Return the same with at most `limit` ellipsoids of the smaller cloud, evenly chosen."""
        teacher, student = self.teacher, self.student
        if min(len(teacher), len(student)) <= limit:
            return self
        if len(teacher) <= len(student):
            teacher = teacher[evenly_spaced(len(teacher), limit)]
        else:
            student = student[evenly_spaced(len(student), limit)]
        return ICP(teacher, student, self.correspondence, self._tol, self._pairs)

    def problem(self, rotation: Array) -> tuple[RotationProblem, Matches]:
        """Match under `rotation` (eq. 18); return the rotation problem (eq. 15) and the matches."""
        matches = self._match(rotation)
        pairs = matches if self._pair_matches is None else matches.joined(self._pair_matches)
        factors = np.take(self._factors, pairs.student, axis=1)
        return RotationProblem(factors, self._sources[pairs.teacher], pairs.weight), matches

    def run(self, start: Array, max_iter: int, gradient_tol: float = 1e-9, patience: int = 5) -> Registration:
        """Alternate (18) and (15) until the rotation converges or `patience` iterations do not lower the cost."""
        rotation, history, iterates = start, list[float](), list[tuple[Array, Matches]]()
        reason, converged = f"{max_iter} iterations without convergence", False
        for iteration in range(max_iter + 1):
            problem, matches = self.problem(rotation)
            iterates.append((rotation, matches))
            if iteration == max_iter:  # the last rotation is measured, not improved
                history.append(float(np.sqrt(problem.cost(rotation))))
                break
            step = problem.minimize(rotation, gradient_tol)
            history.append(float(np.sqrt(step.start_cost)))
            best = int(np.argmin(history))
            if iteration - best >= patience:
                reason = f"no lower cost in {patience} iterations; iteration {best} is kept"
                break
            if rotation_angle(step.rotation, rotation) <= self._tol:
                reason, converged = "matches and rotation converged", True
                break
            rotation = step.rotation
        best = int(np.argmin(history))
        return Registration(start, iterates[best][0], history[best], iterates[best][1], history, reason, converged)
