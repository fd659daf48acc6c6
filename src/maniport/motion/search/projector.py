"""Feasible ellipsoids nearest to many others, round after round: each search continues from the last one."""

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.objective import Damping, Objective
from maniport.motion.search.descent import descend
from maniport.motion.search.seed_bank import SeedBank
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.validation import Array, as_number, as_points, require_shape

MAX_STARTS = 12_288
"""Samples that all first searches of a fit start from together; each has 24 to 48. With six a length field is worse."""


class FeasibleProjector:
    """Find the feasible ellipsoids of an arm nearest to others; a callable, as `maniport.LengthField` takes it.

    On one core 2048 ellipsoids of the Panda take 0.9 s, and 0.1 s in each further round of `search`. A result is the
    nearest that some start leads to: an upper bound of the distance, as in `nearest_feasible`.

    Parameters
    ----------
    arm : Arm
    spec : EllipsoidSpec
        Which ellipsoids.
    damping : float or Regularization
        As in `maniport.motion.track`, above zero: the ε of the ellipsoids that the object is called with.
    bank : SeedBank, optional
        Seed configurations. Default: 16 384 new samples.
    random_state : None, int or numpy.random.Generator
        Random seed of these samples.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong value.
    """

    needs_damping = True  # Ellipsoids that it gets must be damped

    def __init__(
        self,
        arm: Arm,
        spec: EllipsoidSpec = VELOCITY,
        damping: Damping = DAMPING,
        bank: SeedBank | None = None,
        random_state: Any = 0,
    ):
        self.objective = Objective.of(arm, spec, damping, positive=True)
        self.bank = SeedBank.given_or_built(bank, arm, spec, random_state)

    @property
    def damping(self) -> float | None:
        """Damping relative to the mean eigenvalue of the arm's ellipsoids; None where it was given as an absolute ε."""
        return self.objective.damping.damping

    @cached_property
    def axis(self) -> Array | None:
        """Direction of the first joint's axis in the base frame (3,), where the arm turns round it by 300°; else None.

        A feasible ellipsoid is then feasible turned by nearly any angle. Ellipsoids of size 6 have none.
        """
        arm, spec = self.objective.arm, self.objective.spec.velocity
        if spec.size != 3 or arm.upper[0] - arm.lower[0] < np.radians(300.0):
            return None
        before = np.linspace(arm.lower, arm.upper, 10)[1:-1]
        after, axis = before.copy(), np.asarray(arm.jacobian(before[0])[3:, 0])
        after[:, 0] = before[::-1, 0]
        turn = Rotation.from_rotvec((after - before)[:, :1] * axis).as_matrix()
        turned = turn @ arm.ellipsoids(before, spec) @ np.swapaxes(turn, 1, 2)
        same = np.allclose(arm.ellipsoids(after, spec), turned, atol=1e-9 * np.abs(turned).max())
        return axis if same and axis.any() else None

    def __call__(self, points: ArrayLike) -> Array:
        """Return the nearest ellipsoids to others, both shape (n, d, d) and with the damping."""
        return self.search(self.objective.damping.epsilon).nearest(points)[0]

    def search(self, damping: float) -> "FeasibleSearch":
        """Begin a search for ellipsoids that carry another damping ε [unit of M], which remembers its configurations.

        Raises
        ------
        InvalidInputError
            When ε is not above zero.
        """
        epsilon = Regularization.absolute(as_number(damping, "damping", above=0.0))
        return FeasibleSearch(replace(self.objective, damping=epsilon), self.bank)

    def __deepcopy__(self, memo: Any) -> "FeasibleProjector":
        return self  # immutable; scikit-learn copies the parameters of estimators that it clones

    def __repr__(self) -> str:
        objective = self.objective
        return f"FeasibleProjector({objective.arm.name!r}, {objective.spec}, damping {objective.damping.epsilon:.3g})"


class FeasibleSearch:
    """A search that continues where it ended; made by `FeasibleProjector.search`.

    Attributes
    ----------
    joint_positions : ndarray, shape (n, dof), or None
        Configurations of the last results [rad or m].
    """

    def __init__(self, objective: Objective, bank: SeedBank):
        self._objective, self._bank = objective, bank
        self.joint_positions: Array | None = None

    def nearest(self, points: ArrayLike, neighbors: NDArray[np.intp] | None = None) -> tuple[Array, Array]:
        """Find the nearest feasible ellipsoids, and derivatives of the logarithm from the points to them.

        The first call starts from samples of the bank. Later ones expect the same points, a little changed, and start
        from the last result of each, those of its neighbors and one sample.

        Parameters
        ----------
        points : array_like, shape (n, d, d)
            SPD, with the damping.
        neighbors : ndarray of int, shape (n, k), optional
            Indices of similar points, whose configurations are tried too.

        Returns
        -------
        ellipsoids : ndarray, shape (n, d, d)
            With the damping.
        changes : ndarray, shape (n, dof, d, d)
            Derivatives of log(A^-½ M A^-½), A the point and M the ellipsoid, along each joint; zero where a joint is at
            a limit.

        Raises
        ------
        NotSPDError, InvalidInputError
            When `points` are not SPD, or their number changes.
        """
        damped = as_points(points, "points", self._objective.spec.size, minimum=1)
        targets = self._objective.targets(self._objective.undamped(damped))
        before = self.joint_positions
        if before is None:
            each = min(max(MAX_STARTS // len(damped), 24), 48)
            starts, steps = self._bank.starts_for(targets, each), 20
        else:
            require_shape(damped, "points", (len(before), *damped.shape[1:]), ", as in the first call")
            similar = [] if neighbors is None else [before[neighbors]]
            starts = np.concatenate([before[:, None], *similar, self._bank.starts_for(targets, 1)], axis=1)
            steps = 8
        q = descend(targets, starts, 1e-6, steps, block=512, halving=2)
        if not np.all(np.isfinite(targets.distance(q))):
            raise InvalidInputError(f"the arm {self._objective.arm.name!r} is singular at all starts for some points")
        self.joint_positions = q
        arm = self._objective.arm
        changes = targets.log_changes(q)
        changes[(q <= arm.lower) | (q >= arm.upper)] = 0.0
        return self._objective.damped(arm.ellipsoids(q, self._objective.spec)), changes
