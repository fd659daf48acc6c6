"""Searches of configurations: seed configurations, the descent from them, and the pointwise optimum.

Reaching an ellipsoid has many local minima. Samples with the most similar ellipsoids are starts in several basins. Each
search minimizes the costs of `maniport.motion.problem` by Levenberg-Marquardt steps within joint limits; their damping
follows Madsen, Nielsen & Tingleff, Methods for Non-Linear Least Squares Problems, 2004, § 3.2.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.motion.arm_model import require_compatible
from maniport.motion.kernels import step_within_limits
from maniport.motion.problem import EXACT_WEIGHT, SEARCH_WEIGHT, ArmProblem, MotionProblem
from maniport.motion.targets import TargetTrajectory, as_damping
from maniport.spd.kernels import congruence, roots
from maniport.spd.matrix_functions import apply, to_vector
from maniport.util.defaults import DAMPING
from maniport.util.progress import ReportFraction, counted, ignore_fraction, pieces
from maniport.util.validation import Array, as_count

TOLERANCE = 1e-6
LARGEST_DAMPING = 1e8
LEAST_GAIN = 1e-4  # Share of the expected decrease of the cost that a step must bring to be taken
POSITION_WEIGHT = 6.0
"""Weight of a distance between positions [1/m]: less than in a search, since samples lie decimetres apart."""

WaypointProblem = ArmProblem | MotionProblem  # with a row for each waypoint


class SeedBank:
    """Seed configurations: sampled configurations of an arm with their positions and ellipsoids.

    16 384 samples of the Panda take 0.2 s.

    Parameters
    ----------
    arm : Arm
    n : int
        Number of samples, from a scrambled Sobol sequence within the joint limits.
    random_state : None, int or numpy.random.Generator
        Same seed, same bank.
    spec : EllipsoidSpec
        Which ellipsoids.

    Attributes
    ----------
    joint_positions : ndarray, shape (n, dof)
        The samples [rad or m].
    damping : Regularization
        Its ε is added to all eigenvalues before ellipsoids are compared.
    """

    def __init__(
        self,
        arm: Arm,
        n: int = 16_384,
        random_state: int | np.random.Generator | None = 0,
        spec: EllipsoidSpec = VELOCITY,
    ):
        self.arm = arm
        self.spec = spec
        self.joint_positions = arm.sample(as_count(n, "n"), random_state)
        ellipsoids = arm.ellipsoids(self.joint_positions, spec)
        self.damping = as_damping(DAMPING, lambda: ellipsoids, positive=True)
        self._shift = self.damping.epsilon * np.eye(ellipsoids.shape[-1])
        # a congruence changes no affine-invariant distance; about the mean, log space agrees with it best
        logs = apply(ellipsoids + self._shift, np.log)
        self._whitening = roots(apply(logs.mean(axis=0), np.exp))[1]
        self._vectors = self._log_vectors(ellipsoids)

    def __len__(self) -> int:
        return len(self.joint_positions)

    def __repr__(self) -> str:
        return f"SeedBank({self.arm.name!r}, n={len(self)}, {self.spec}, damping {self.damping.epsilon:.3g})"

    def starts_for(self, target: TargetTrajectory, k: int) -> Array:
        """Return the k configurations with the most similar ellipsoids and positions, nearest first, (n, k, dof)."""
        ellipsoids = apply(
            target.damped_ellipsoids - target.shift, lambda values: np.maximum(values, 0.0)
        )
        vectors = self._log_vectors(ellipsoids)
        tree = self._tree
        if target.positions is not None:
            vectors = np.hstack([vectors, POSITION_WEIGHT * target.positions])
            tree = self._positioned_tree
        rows = tree.query(vectors, k=[*range(1, min(k, len(self)) + 1)])[1]
        return np.asarray(self.joint_positions[rows])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._vectors)

    @cached_property
    def _positioned_tree(self) -> cKDTree:
        positions = self.arm.forward(self.joint_positions)[:, :3, 3]
        return cKDTree(np.hstack([self._vectors, POSITION_WEIGHT * positions]))

    def _log_vectors(self, ellipsoids: Array) -> Array:
        return to_vector(apply(congruence(self._whitening, ellipsoids + self._shift), np.log))


def bank_for(
    arm: Arm,
    spec: EllipsoidSpec,
    bank: SeedBank | None,
    random_state: int | np.random.Generator | None,
) -> SeedBank:
    """Return a bank after checking that it is of the arm, whatever its limits, or build one where there is none."""
    if bank is None:
        return SeedBank(arm, random_state=random_state, spec=spec)
    require_compatible("the seed bank was built for", (bank.arm, arm), (bank.spec, spec))
    return bank


def search_from_starts(
    problem: WaypointProblem,
    starts: Array,
    *,
    max_iter: int = 100,
    block: int = 64,
    halving: int = 4,
    progress: ReportFraction = ignore_fraction,
) -> Array:
    """Search for each waypoint from starts (n, k, dof); return the best joint positions (n, dof).

    Searches for a waypoint end when the root of the cost falls below `TOLERANCE`, and where no joint alone promises to
    lower it by as much. Every `halving` steps the worse half of them ends. `block` waypoints are searched together.
    """
    blocks = [slice(i, i + block) for i in range(0, len(starts), block)]
    results = []
    for rows in counted(blocks, len(blocks), progress):
        results.append(_descend(problem[rows], starts[rows], max_iter, halving))
    return np.concatenate(results)


def _descend(problem: WaypointProblem, starts: Array, max_iter: int, halving: int) -> Array:
    """Search from all starts at once: rows are those of the first waypoint, then those of the second and so on."""
    count, n_starts, dof = starts.shape
    lower = problem.robot.lower
    upper = problem.robot.upper
    q = np.clip(starts.reshape(-1, dof), lower, upper)
    owner = np.repeat(np.arange(count), n_starts)
    equations = problem[owner].normal_equations(q)
    length = equations.distance
    gradient = equations.gradient
    hessian = equations.hessian
    damping = np.full(len(q), 0.1)
    growth = np.full(len(q), 2.0)

    def still_open(rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Those that have something left to gain, of waypoints that none has reached."""
        slope = gradient[rows]
        length_here = length[rows]
        below = (q[rows] <= lower) & (slope > 0)
        above = (q[rows] >= upper) & (slope < 0)
        curvature = np.diagonal(hessian[rows], axis1=1, axis2=2)
        # flatter joints, such as one whose axis goes through the end effector, have only rounding in both
        flat = np.maximum(1e-9 * curvature.max(axis=1, keepdims=True), np.finfo(np.float64).tiny)
        gains = 0.5 * slope**2 / np.maximum(curvature, flat)
        promise = np.where(below | above, 0.0, gains).max(axis=1)
        waypoint_reached = length.reshape(count, n_starts).min(axis=1) <= TOLERANCE
        reached = waypoint_reached[owner[rows]]
        promising = promise > TOLERANCE * length_here
        going_on = ~reached & promising & np.isfinite(length_here)
        return np.asarray(rows[going_on & (damping[rows] < LARGEST_DAMPING)])

    active = still_open(np.arange(len(q)))
    for iteration in range(1, max_iter + 1):
        if not len(active):
            break
        trial = np.empty((len(active), dof))
        expected = np.empty(len(active))
        step_within_limits(
            q[active],
            gradient[active],
            hessian[active],
            damping[active],
            lower,
            upper,
            trial,
            expected,
        )
        found = problem[owner[active]].normal_equations(trial)
        trial_length = found.distance
        gain = 0.5 * (length[active] ** 2 - trial_length**2)
        taken = gain > LEAST_GAIN * expected
        rows = active[taken]
        lost = active[~taken]
        ratio = gain[taken] / expected[taken]
        q[rows] = trial[taken]
        length[rows] = trial_length[taken]
        gradient[rows] = found.gradient[taken]
        hessian[rows] = found.hessian[taken]
        damping[rows] *= np.maximum(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
        growth[rows] = 2.0
        damping[lost] *= growth[lost]
        growth[lost] *= 2.0
        active = still_open(active)
        if iteration % halving == 0:  # of each waypoint the better half, at least one
            order = active[np.lexsort((length[active], owner[active]))]
            waypoint = owner[order]
            first = np.searchsorted(waypoint, waypoint)
            size = np.searchsorted(waypoint, waypoint, side="right") - first
            active = np.sort(order[np.arange(len(order)) - first < (size + 1) // 2])
    best = np.argmin(length.reshape(count, n_starts), axis=1)
    return np.asarray(q[np.arange(count) * n_starts + best])


def pointwise_best(
    problem: WaypointProblem,
    starts: Array,
    motion: Array,
    progress: ReportFraction = ignore_fraction,
) -> Array:
    """Return the best configuration for each waypoint by itself, with the end effector in place, shape (n, dof).

    The search starts from (n, k, dof), then from the results of the neighbors and from a motion (n, dof). The result is
    no motion, it may jump.
    """
    first, then = pieces(progress, 4.0, 1.0)
    q = search_from_starts(problem.with_position_weight(SEARCH_WEIGHT), starts, progress=first)
    starts = np.stack([q, np.roll(q, 1, axis=0), np.roll(q, -1, axis=0), motion], axis=1)
    return search_from_starts(problem.with_position_weight(EXACT_WEIGHT), starts, progress=then)


def interpolated_distance(rows: NDArray[np.intp], distance: Array, count: int) -> Array:
    """Distances (count,) from those at some rows: the square is linear, which keeps the mean square."""
    return np.asarray(np.sqrt(np.interp(np.arange(count), rows, distance**2)))
