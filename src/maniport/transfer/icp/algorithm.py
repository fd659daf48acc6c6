"""Manifold-aware ICP (Reithmeir et al. 2022, Algorithm 1): match ellipsoids, rotate them onto their partners, repeat.

    step 1   recenter both clouds at the identity: P^-½ X P^-½                    eqs. 10, 11   `rigid_adapter.recenter`
    step 2   dilate the teacher's to the student's dispersion: X^s                eqs. 12 to 14 `rigid_adapter.recenter`
    start    rotation of parallel transport, and others                           § IV-C        `rotations_by_voting`
    step 3   (i, j, w_ij) = correspondence(R T_i Rᵀ, S_j)                         eq. 18        `icp.correspondence`
             R ← argmin Σ w_ij^k d²(S_j, R T_i Rᵀ) over SO(d)                     eq. 15        `icp.rotation`
    step 4   f(T) = S̄^½ R (T̄^-½ T T̄^-½)^s Rᵀ S̄^½                                  eqs. 16, 17   `rigid_adapter.RigidMap`

The scores of step 3 have no common objective with the rotation step, so that the best iterate is returned.
The paper follows one start; `best_registration` follows several.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from maniport.spd.kernels import cholesky, eigh
from maniport.transfer.icp.correspondence import Correspondence
from maniport.transfer.icp.rotation import RotationProblem
from maniport.transfer.rotation_group import orthonormal, rotation_angle
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array


@dataclass(frozen=True)
class Registration:
    """Result of ICP from one initial rotation; rotation and cost are those of its best iterate."""

    start: Array
    rotation: Array
    cost: float  # weighted root mean squared distance of the matched pairs
    history: list[float]  # cost at the start and after each iteration
    reason: str
    converged: bool


class ICP:
    """Step 3 for two recentered clouds, shapes (n, d, d) and (m, d, d)."""

    def __init__(
        self, teacher: Array, student: Array, correspondence: Correspondence, tol: float = 1e-8
    ):
        self.teacher = teacher
        self.student = student
        self.correspondence = correspondence
        self._match = correspondence.between(teacher, student)
        self._factors = cholesky(student)
        self._tol = tol

    def problem(self, rotation: Array) -> RotationProblem:
        """Match under `rotation` (eq. 18) and return the rotation problem (eq. 15)."""
        matches = self._match(rotation)
        factors = [factor[matches.student] for factor in self._factors]
        return RotationProblem(factors, self.teacher[matches.teacher], matches.weight)

    def run(
        self, start: Array, max_iter: int, gradient_tol: float = 1e-9, patience: int = 5
    ) -> Registration:
        """Alternate eqs. 18 and 15 until the rotation converges or `patience` iterations do not lower the cost."""
        rotation = start
        history = list[float]()
        rotations = list[Array]()
        reason = f"{max_iter} iterations without convergence"
        converged = False
        for iteration in range(max_iter + 1):
            problem = self.problem(rotation)
            rotations.append(rotation)
            history.append(float(np.sqrt(problem.cost(rotation))))
            best = int(np.argmin(history))
            if iteration == max_iter:
                break
            if iteration - best >= patience:
                reason = f"no lower cost in {patience} iterations; iteration {best} is kept"
                break
            following = problem.minimize(rotation, gradient_tol)
            if rotation_angle(following, rotation) <= self._tol:
                reason = "matches and rotation converged"
                converged = True
                break
            rotation = following
        return Registration(start, rotations[best], history[best], history, reason, converged)


def best_registration(
    icp: ICP,
    first: Array,
    others: Sequence[Array],
    margin: float,
    max_iter: int = 100,
    limit: int = 400,
) -> tuple[Registration, Registration]:
    """Return the registration from `first`, and the one of the lowest cost; another's is lower by a share `margin`.

    The others are followed for two iterations, on at most `limit` ellipsoids of the smaller cloud, and the best of them
    to its end.
    """
    start = icp.run(first, max_iter)
    if not others:
        return start, start
    clouds = [icp.teacher, icp.student]
    smaller = int(len(icp.student) < len(icp.teacher))
    clouds[smaller] = clouds[smaller][evenly_spaced(len(clouds[smaller]), limit)]
    thinned = ICP(clouds[0], clouds[1], icp.correspondence)
    runs = [thinned.run(other, 2, 1e-3) for other in others]
    ahead = min(runs, key=lambda run: run.cost)
    # a part of the cloud may mislead: the best has to beat the first rotation on all of it
    best = replace(icp.run(ahead.rotation, max_iter), start=ahead.start)
    if best.cost < start.cost * (1.0 - margin) - 1e-6:
        return start, best
    return start, start


def rotations_by_voting(
    teacher: Array, student: Array, elected: int, voters: int = 128, candidates: int = 3
) -> list[Array]:
    """Rotations that many pairs of ellipsoids with nearly equal eigenvalues agree on, most votes first.

    Up to `voters` ellipsoids of the smaller cloud each propose the rotations onto their most similar `candidates`.
    Without them 4 of 8 rotations are recovered instead of 8 where two clouds of 100 ellipsoids share half. Alignments
    of the clouds' frames, as further starts, recover no more.
    """
    if len(teacher) > len(student):
        inverses = rotations_by_voting(student, teacher, elected, voters, candidates)
        return [rotation.T for rotation in inverses]
    d = teacher.shape[-1]
    signs = np.array([turn for turn in product((1.0, -1.0), repeat=d) if np.prod(turn) > 0.0])
    # in even dimension −P does what P does
    if d % 2:
        signs = signs[:64]
    else:
        signs = signs[signs[:, 0] > 0.0][:64]
    count = min(voters, len(teacher), 4096 // (len(signs) * candidates))
    if count < 3:
        return []
    value_t, frame_t = eigh(teacher[evenly_spaced(len(teacher), count)])
    value_s, frame_s = eigh(student)
    for frame in (frame_t, frame_s):
        frame[:, :, 0] *= np.sign(np.linalg.det(frame))[:, None]
    _, similar = cKDTree(np.log(value_s)).query(
        np.log(value_t), k=[*range(1, min(candidates, len(student)) + 1)]
    )
    targets = frame_s[similar][:, :, None] * signs[:, None, :]
    turns = targets @ np.swapaxes(frame_t, 1, 2)[:, None, None]
    proposals = turns.reshape(-1, d * d)
    centers = turns[:, 0].reshape(-1, d * d)
    # |R - R'| of rotations that are 10° apart in one plane
    radius = 2.0 * np.sqrt(2.0) * np.sin(np.deg2rad(10.0) / 2.0)
    tree = cKDTree(proposals)
    votes = tree.query_ball_point(centers, radius, return_length=True)
    rotations = list[Array]()
    for place in np.argsort(-votes, kind="stable"):
        if len(rotations) == elected:
            break
        agreeing = tree.query_ball_point(centers[place], radius, return_sorted=True)
        rotation = orthonormal(proposals[agreeing].mean(axis=0).reshape(d, d))
        if all(np.linalg.norm(rotation - other) > 2.0 * radius for other in rotations):
            rotations.append(rotation)
    return rotations
