"""Manifold-aware ICP (Reithmeir et al. 2022, Algorithm 1): match ellipsoids, rotate them onto their partners, repeat.

Both clouds are recentred at the identity and the teacher's is dilated to the student's dispersion (steps 1 and 2 of the
algorithm, `maniport.transfer.rigid_adapter`). What remains is the rotation R, found by alternating

    matches   (i, j, w_ij) = correspondence(R T_i Rᵀ, S_j)                           paper, eq. 18
    rotation  R ← argmin Σ w_ij^k d²(S_j, R T_i Rᵀ) over SO(d)                        paper, eq. 15

from R = the rotation of parallel transport. Except for the nearest neighbor, no objective falls in every iteration, so
that the best iterate is returned.
"""

from dataclasses import dataclass

import numpy as np

from maniport.transfer.icp.matches import Correspondence, Matches
from maniport.transfer.icp.rotation import RotationProblem, cholesky_factors
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array, as_choice, as_count, as_flag, as_number


@dataclass(frozen=True)
class Search:
    """Start, extent and acceptance of the search of `RiemannianICP`.

    Parameters
    ----------
    start : {"parallel-transport", "identity"}
        First rotation of recentred ellipsoids.
    n_starts : int
        Number of further starts that are followed when no base_rotation is given: rotations that align the frames of the
        two clouds, and those that ellipsoids with equal eigenvalues vote for. Zero follows `start` alone.
    margin : float
        Fraction by which the cost from another start must be lower than that from `start`. Clouds of arms are nearly
        symmetric: between two draws of the Panda's own domain, a rotation with a cost 1.2 % lower was off by 180°.
    compete : bool
        Keep the first start unless the found rotation clearly brings the clouds nearer; see
        `maniport.transfer.icp.starts.start_is_kept`. False takes the found rotation, as the paper does.
    most_singular : int, optional
        Match only this many ellipsoids of each domain, those with the largest condition after mean-transport.
    max_iter : int
        Largest number of iterations from each start.
    tol : float
        Rotation [rad] below which an iteration counts as converged.

    Raises
    ------
    UnknownNameError, InvalidInputError
        When an option is wrong.
    """

    start: str = "parallel-transport"
    n_starts: int = 8
    margin: float = 0.05
    compete: bool = True
    most_singular: int | None = None
    max_iter: int = 100
    tol: float = 1e-8

    def __post_init__(self) -> None:
        as_choice(self.start, "start", ("parallel-transport", "identity"))
        as_count(self.n_starts, "n_starts", minimum=0)
        as_number(self.margin, "margin", minimum=0.0, below=1.0)
        as_flag(self.compete, "compete")
        if self.most_singular is not None:
            as_count(self.most_singular, "most_singular", minimum=2)
        as_count(self.max_iter, "max_iter")
        as_number(self.tol, "tol", above=0.0)


@dataclass(frozen=True)
class Registration:
    """Result of ICP from one start; rotation, cost and matches are those of its best iterate."""

    start: Array
    rotation: Array
    cost: float  # weighted root mean squared distance of the matched pairs
    matches: Matches
    history: list[float]  # cost at the start and after each iteration
    reason: str
    converged: bool


class ICP:
    """Iterative closest point between two recentred clouds, shapes (n, d, d) and (m, d, d)."""

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
        self._known: Matches | None = None
        if pairs is not None:  # appended to the clouds
            index = np.arange(len(pairs[0]))
            weight = np.full(len(index), 1.0 / len(index))
            self._known = Matches(len(teacher) + index, len(student) + index, weight)
            teacher, student = (np.concatenate(both) for both in zip((teacher, student), pairs, strict=True))
        self._sources, self._targets, self._factors = teacher, student, cholesky_factors(student)

    def subsampled(self, most: int) -> "ICP":
        """Return the same with at most `most` ellipsoids of the smaller cloud, evenly chosen."""
        teacher, student = self.teacher, self.student
        if min(len(teacher), len(student)) <= most:
            return self
        if len(teacher) <= len(student):
            teacher = teacher[evenly_spaced(len(teacher), most)]
        else:
            student = student[evenly_spaced(len(student), most)]
        return ICP(teacher, student, self.correspondence, self._tol, self._pairs)

    def problem(self, rotation: Array) -> tuple[RotationProblem, Matches]:
        """Match under `rotation`; return the rotation problem (eq. 15) and the matches (eq. 18)."""
        matches = self._match(rotation)
        pairs = matches if self._known is None else matches.joined(self._known)
        student, factors = self._targets[pairs.student], np.take(self._factors, pairs.student, axis=1)
        return RotationProblem(student, self._sources[pairs.teacher], pairs.weight, factors), matches

    def run(self, start: Array, max_iter: int, gradient_tol: float = 1e-9, patience: int = 5) -> Registration:
        """Alternate matching and rotation until the rotation stands still or `patience` iterations gain nothing."""
        rotation, history, iterates = start, list[float](), list[tuple[Array, Matches]]()
        reason, converged = f"{max_iter} iterations without convergence", False
        for iteration in range(max_iter + 1):
            problem, matches = self.problem(rotation)
            iterates.append((rotation, matches))
            if iteration == max_iter:  # only measured
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
