"""Seed configurations: samples of an arm that searches for ellipsoids start from.

Reaching an ellipsoid has many local minima. The samples with the most similar ellipsoids are starts in several basins.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.collisions import free_configurations
from maniport.motion.arm_model import require_compatible
from maniport.motion.objective import Damping, Targets, as_damping
from maniport.spd.matrix_functions import apply, congruence, roots, to_vector
from maniport.util.defaults import DAMPING
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array, as_count, as_metres, as_number, as_points, as_square, require_shape


class SeedBank(NotebookDisplay):
    """Seed configurations: sampled configurations of an arm with their positions and ellipsoids.

    Make one with `SeedBank.build`.

    Attributes
    ----------
    joint_positions : ndarray, shape (n, dof)
        The samples, within the joint limits [rad or m].
    positions : ndarray, shape (n, 3)
        Positions of the end effector in the base frame [m].
    ellipsoids : ndarray, shape (n, d, d)
        Ellipsoids of the arm, without damping.
    spec : EllipsoidSpec
        Which ellipsoids.
    damping : Regularization
        Its ε is added to all eigenvalues before ellipsoids are compared.
    """

    def __init__(self, arm: Arm, joint_positions: Array, damping: Damping, spec: EllipsoidSpec):
        self.arm, self.joint_positions, self.spec = arm, joint_positions, spec
        self.positions = np.ascontiguousarray(arm.forward(joint_positions)[:, :3, 3])
        self.ellipsoids = arm.ellipsoids(joint_positions, spec)
        self.damping = as_damping(damping, lambda: self.ellipsoids, positive=True)
        self._shift = self.damping.epsilon * np.eye(self.ellipsoids.shape[-1])
        # A congruence changes no affine-invariant distance; about the mean, log space agrees with it best.
        logs = apply(self.ellipsoids + self._shift, np.log)
        self._whitening = roots(apply(logs.mean(axis=0), np.exp))[1]
        self._vectors = self._log_vectors(self.ellipsoids + self._shift)
        self._trees: dict[float, cKDTree] = {}

    @classmethod
    def build(
        cls,
        arm: Arm,
        n: int = 16_384,
        random_state: Any = 0,
        *,
        spec: EllipsoidSpec = VELOCITY,
        damping: Damping = DAMPING,
        collisions: Any = None,
    ) -> "SeedBank":
        """Sample the joint space of an arm; 16 384 samples of the Panda take 0.2 s.

        Parameters
        ----------
        arm : Arm
        n : int
            Number of samples, from a scrambled Sobol sequence within the joint limits.
        random_state : None, int or numpy.random.Generator
            Same seed, same bank.
        spec : EllipsoidSpec
            Which ellipsoids.
        damping : float or Regularization
            As in `maniport.motion.track`, so that flat ellipsoids can be compared; a number is relative to the mean
            eigenvalue of the bank's own samples.
        collisions : maniport.arms.collisions.Collisions or True, optional
            Configurations that collide are omitted, as in `maniport.sample_domain`.

        Raises
        ------
        InvalidInputError
            When an argument has a wrong value.
        """
        return cls(arm, free_configurations(arm, as_count(n, "n"), random_state, collisions=collisions), damping, spec)

    @classmethod
    def given_or_built(cls, bank: "SeedBank | None", arm: Arm, spec: EllipsoidSpec, random_state: Any) -> "SeedBank":
        """Return `bank`, which must fit, or build one where it is None."""
        if bank is None:
            return cls.build(arm, random_state=random_state, spec=spec)
        bank.require_fits(arm, spec)
        return bank

    def __len__(self) -> int:
        return len(self.joint_positions)

    def __repr__(self) -> str:
        return f"SeedBank({self.arm.name!r}, n={len(self)}, {self.spec}, damping {self.damping.epsilon:.3g})"

    def query(
        self, ellipsoids: ArrayLike, positions: ArrayLike | None = None, k: int = 5, position_weight: float = 6.0
    ) -> Array:
        """Return configurations with the most similar ellipsoids and positions.

        Parameters
        ----------
        ellipsoids : array_like, shape (n, d, d)
            Target ellipsoids in the arm's base frame, without damping.
        positions : array_like, shape (n, 3), optional
            Target positions of the end effector in the base frame [m].
        k : int
            How many configurations for each; a smaller bank returns all it has.
        position_weight : float
            Weight of a distance between positions [1/m]: less than in a search, since samples lie decimetres apart.

        Returns
        -------
        ndarray, shape (n, k, dof)
            Nearest first, by the logarithms of the ellipsoids relative to the bank's mean.

        Raises
        ------
        InvalidInputError, NotSPDError
            When an argument has a wrong shape or value, or an ellipsoid is asymmetric or, with the bank's damping, not
            positive-definite.
        """
        damped = as_square(ellipsoids, "ellipsoids", len(self._whitening)) + self._shift
        vectors, weight = self._log_vectors(as_points(damped, "ellipsoids", minimum=1)), 0.0
        if positions is not None:
            weight = as_number(position_weight, "position_weight", above=0.0)
            vectors = np.concatenate([vectors, weight * as_positions(positions, len(vectors))], axis=1)
        if weight not in self._trees:
            features = np.concatenate([self._vectors, weight * self.positions], axis=1)
            self._trees[weight] = cKDTree(features if weight else self._vectors)
        count = min(as_count(k, "k"), len(self))
        return np.asarray(self.joint_positions[self._trees[weight].query(vectors, k=[*range(1, count + 1)])[1]])

    def starts_for(self, targets: Targets, k: int) -> Array:
        """Return start configurations for targets, shape (n, k, dof), whatever their damping."""
        ellipsoids = apply(targets.ellipsoids, lambda values: np.maximum(values, 0.0))
        return self.query(ellipsoids, targets.positions, k)

    def require_fits(self, arm: Arm, spec: EllipsoidSpec) -> None:
        """Raise InvalidInputError unless this bank is of the same arm, whatever its limits, and ellipsoids."""
        require_compatible("the seed bank was built for", (self.arm, arm), (self.spec, spec), limits=False)

    def _log_vectors(self, damped: Array) -> Array:
        return to_vector(apply(congruence(self._whitening, damped), np.log))


def as_positions(value: ArrayLike, count: int) -> Array:
    """Convert to target positions of the end effector, shape (count, 3)."""
    positions = as_metres(value, "positions")
    require_shape(positions, "positions", (count, 3), ", one for each ellipsoid")
    return positions
