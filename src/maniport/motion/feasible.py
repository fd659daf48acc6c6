"""The feasible ellipsoids nearest to targets: searches over joint positions within their limits."""

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError, NotSPDError
from maniport.motion.arm_model import Axis
from maniport.motion.problem import ArmProblem
from maniport.motion.search import SeedBank, bank_for, search_from_starts
from maniport.motion.targets import (
    HINT,
    Damping,
    TargetTrajectory,
    checked_ellipsoids,
    damping_of,
)
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step
from maniport.util.validation import Array, as_count, as_metres, as_number, as_points, require_shape

MOST_STARTS = 12_288  # of all points of a search together
FIRST_STEPS = 20  # steps of a search from samples
LATER_STEPS = 8  # from earlier results


class FeasibleEllipsoids(NamedTuple):
    """The nearest feasible ellipsoids to targets; made by `nearest_feasible`."""

    joint_positions: Array  # (n, dof), within the limits [rad or m]
    ellipsoids: Array  # (n, d, d), there, without damping
    distance: Array  # (n,), affine-invariant, to the targets, with the damping
    position_error: Array | None = (
        None  # (n,), of the end effector, where there are target positions [m]
    )


def nearest_feasible(
    arm: Arm,
    ellipsoids: ArrayLike,
    *,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    positions: ArrayLike | None = None,
    n_starts: int = 48,
    bank: SeedBank | None = None,
    random_state: int | np.random.Generator | None = 0,
    progress: Progress | None = None,
) -> FeasibleEllipsoids:
    """Find the joint positions within limits whose ellipsoid is nearest: min_q d(A + ε I, M(q) + ε I).

    The distances are upper bounds of the true minima, since searches from finitely many starts may miss them. Of
    ellipsoids of the Panda at new joint positions 99.7 % score below 0.01.

    Parameters
    ----------
    arm : Arm
    ellipsoids : array_like, shape (n, d, d)
        Target ellipsoids in the arm's base frame, without damping.
    spec, damping
        As in `maniport.motion.TargetTrajectory`, of force too, and None for no damping.
    positions : array_like, shape (n, 3), optional
        Target positions of the end effector in the base frame [m]. The search then minimizes
        ``d² + (50 · position error)²``.
    n_starts : int
        Samples to search from for each ellipsoid. Arms with fewer joints need more: of a UR5's own ellipsoids 98 %
        score below 0.01 with 48, above 99 % with 96.
    bank : SeedBank, optional
        Seed configurations. Default: 16 384 new samples.
    random_state, progress
        As in `maniport.motion.plan_motion`.

    Raises
    ------
    NotSPDError
        When an ellipsoid is asymmetric or, with the damping, not positive-definite; when without damping the arm
        itself is singular at all starts.
    """
    count = as_count(n_starts, "n_starts")
    regularization = damping_of(arm, spec, damping)
    undamped = checked_ellipsoids(ellipsoids, "ellipsoids", spec, regularization)
    end_positions = None
    if positions is not None:
        end_positions = as_metres(positions, "positions")
        require_shape(end_positions, "positions", (len(undamped), 3), ", one for each ellipsoid")
    target = TargetTrajectory(
        time=np.zeros(len(undamped)),
        ellipsoids=undamped,
        spec=spec,
        damping=regularization,
        positions=end_positions,
    )
    problem = ArmProblem.of(arm, target)
    bank = bank_for(arm, spec, bank, random_state)

    step = Step(progress, "Search feasible ellipsoids")
    starts = bank.starts_for(target, count)
    q = search_from_starts(problem, starts, block=128, progress=step)
    distance = problem.distance(q)
    if not np.all(np.isfinite(distance)):
        raise NotSPDError(f"the arm {arm.name!r} is singular at all starts. {HINT}")
    step.end()
    return FeasibleEllipsoids(q, arm.ellipsoids(q, spec), distance, problem.position_error(q))


class FeasibleProjector:
    """Find the feasible ellipsoids of an arm nearest to the argument; the projector of `maniport.LengthField`.

    On one core 2048 ellipsoids of the Panda take 0.9 s, and 0.1 s in each further round of `search`. A result is the
    nearest that some start leads to: an upper bound of the distance, as in `nearest_feasible`.

    Parameters
    ----------
    arm : Arm
    spec : EllipsoidSpec
        Which ellipsoids.
    damping : float or Regularization
        As in `maniport.motion.TargetTrajectory`, above zero: the ε of the ellipsoids that the object is called with.
    bank : SeedBank, optional
        Seed configurations. Default: 16 384 new samples.
    random_state : None, int or numpy.random.Generator
        Random seed of these samples.
    """

    needs_damping = True  # Ellipsoids that it gets must be damped

    def __init__(
        self,
        arm: Arm,
        spec: EllipsoidSpec = VELOCITY,
        damping: Damping = DAMPING,
        bank: SeedBank | None = None,
        random_state: int | np.random.Generator | None = 0,
    ):
        self.arm = arm
        self.spec = spec
        self.regularization = damping_of(arm, spec, damping, positive=True)
        self.bank = bank_for(arm, spec, bank, random_state)

    @property
    def damping(self) -> float | None:
        """Damping relative to the mean eigenvalue of the arm's ellipsoids; None where it was given as an absolute ε."""
        return self.regularization.damping

    @cached_property
    def axis(self) -> Array | None:
        """Direction of the first joint's axis in the base frame (3,), where the arm turns round it by 300°; else None.

        A feasible ellipsoid is then feasible turned by nearly any angle. Ellipsoids of size 6 have none.
        """
        arm = self.arm
        if self.spec.size != 3 or arm.upper[0] - arm.lower[0] < np.radians(300.0):
            return None
        probes = arm.sample(32, 0)
        axis = Axis.of(arm.jacobian(probes), arm.forward(probes)[:, :3, 3])
        if axis is None:
            return None
        return np.asarray(axis.frame[2])

    def __call__(self, points: ArrayLike) -> Array:
        """Return the nearest ellipsoids to others, both shape (n, d, d) and with the damping."""
        return self.nearest(points)[0]

    def nearest(self, points: ArrayLike) -> tuple[Array, Array]:
        """Find the nearest feasible ellipsoids M (n, d, d) to points A (n, d, d), all with the damping.

        Also return the derivatives of log(A^-½ M A^-½) along each joint (n, dof, d, d), zero where one is at a limit.
        Equal points have equal results, whatever was searched before.
        """
        return self.search(self.regularization.epsilon).nearest(points)

    def search(self, damping: float) -> "FeasibleSearch":
        """Begin a search for ellipsoids that carry another damping ε > 0 [unit of M]."""
        epsilon = Regularization(epsilon=as_number(damping, "damping", above=0.0))
        return FeasibleSearch(self.arm, self.spec, epsilon, self.bank)

    def __deepcopy__(self, memo: dict[int, object]) -> "FeasibleProjector":
        return self  # immutable; scikit-learn copies the parameters of estimators that it clones

    def __repr__(self) -> str:
        epsilon = self.regularization.epsilon
        return f"FeasibleProjector({self.arm.name!r}, {self.spec}, damping {epsilon:.3g})"


class FeasibleSearch:
    """Find the feasible ellipsoids nearest to points that change a little from call to call.

    Make one with `FeasibleProjector.search`.

    Parameters
    ----------
    arm : Arm
    spec : EllipsoidSpec
    damping : Regularization
        That of the points.
    bank : SeedBank
        Seed configurations.

    Attributes
    ----------
    joint_positions : ndarray, shape (n, dof), or None
        Result of the last call [rad or m]; None before the first.
    """

    def __init__(self, arm: Arm, spec: EllipsoidSpec, damping: Regularization, bank: SeedBank):
        self.arm = arm
        self.spec = spec
        self.damping = damping
        self.bank = bank
        self.joint_positions: Array | None = None

    def nearest(
        self, points: ArrayLike, neighbors: NDArray[np.intp] | None = None
    ) -> tuple[Array, Array]:
        """Find the nearest feasible ellipsoids, as `FeasibleProjector.nearest` does.

        The first call starts from samples of the bank. Later ones expect the same points, a little changed, and start
        from the last result of each, those of its `neighbors` (n, k) and one sample.
        """
        arm = self.arm
        damped = as_points(points, "points", self.spec.size, minimum=1)
        shift = self.damping.epsilon * np.eye(self.spec.size)
        target = TargetTrajectory(
            time=np.zeros(len(damped)),
            ellipsoids=np.asarray(damped - shift),
            spec=self.spec,
            damping=self.damping,
        )
        problem = ArmProblem.of(arm, target)
        if self.joint_positions is None:
            starts = self._first_starts(target)
            steps = FIRST_STEPS
        else:
            starts = self._later_starts(target, self.joint_positions, neighbors)
            steps = LATER_STEPS

        q = search_from_starts(problem, starts, max_iter=steps, block=512, halving=2)
        if not np.all(np.isfinite(problem.distance(q))):
            raise InvalidInputError(
                f"the arm {arm.name!r} is singular at all starts for some points"
            )
        self.joint_positions = q

        changes = problem.ellipsoid.log_changes(problem.at(q))
        changes[(q <= arm.lower) | (q >= arm.upper)] = 0.0
        return np.asarray(arm.ellipsoids(q, self.spec) + shift), changes

    def _first_starts(self, target: TargetTrajectory) -> Array:
        count = min(max(MOST_STARTS // len(target), 24), 48)  # six: worse length fields
        return self.bank.starts_for(target, count)

    def _later_starts(
        self, target: TargetTrajectory, before: Array, neighbors: NDArray[np.intp] | None
    ) -> Array:
        size = self.spec.size
        require_shape(
            target.ellipsoids, "points", (len(before), size, size), ", as in the first call"
        )
        starts = [before[:, None]]
        if neighbors is not None:
            starts.append(before[neighbors])
        starts.append(self.bank.starts_for(target, 1))
        return np.concatenate(starts, axis=1)
