"""Seed configurations: samples of an arm that searches for ellipsoids start from.

Reaching an ellipsoid has many local minima. The samples with the most similar ellipsoids are starts in several basins.
"""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.motion.arm_model import require_compatible
from maniport.motion.objective import Targets, as_damping
from maniport.spd.kernels import congruence, roots
from maniport.spd.matrix_functions import apply, to_vector
from maniport.util.defaults import DAMPING
from maniport.util.validation import Array, as_count

POSITION_WEIGHT = 6.0
"""Weight of a distance between positions [1/m]: less than in a search, since samples lie decimetres apart."""


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

    def __init__(self, arm: Arm, n: int = 16_384, random_state: Any = 0, spec: EllipsoidSpec = VELOCITY):
        self.arm, self.spec, self.joint_positions = arm, spec, arm.sample(as_count(n, "n"), random_state)
        ellipsoids = arm.ellipsoids(self.joint_positions, spec)
        self.damping = as_damping(DAMPING, lambda: ellipsoids, positive=True)
        self._shift = self.damping.epsilon * np.eye(ellipsoids.shape[-1])
        # a congruence changes no affine-invariant distance; about the mean, log space agrees with it best
        logs = apply(ellipsoids + self._shift, np.log)
        self._whitening = roots(apply(logs.mean(axis=0), np.exp))[1]
        self._vectors = self._log_vectors(ellipsoids)
        self._trees: dict[bool, cKDTree] = {}

    @classmethod
    def given_or_built(cls, bank: "SeedBank | None", arm: Arm, spec: EllipsoidSpec, random_state: Any) -> "SeedBank":
        """Return `bank`, which must fit, or build one where it is None."""
        if bank is None:
            return cls(arm, random_state=random_state, spec=spec)
        bank.require_fits(arm, spec)
        return bank

    def __len__(self) -> int:
        return len(self.joint_positions)

    def __repr__(self) -> str:
        return f"SeedBank({self.arm.name!r}, n={len(self)}, {self.spec}, damping {self.damping.epsilon:.3g})"

    def starts_for(self, targets: Targets, k: int) -> Array:
        """Return the k configurations with the most similar ellipsoids and positions, shape (n, k, dof).

        The nearest come first, by the logarithms of the ellipsoids relative to the bank's mean; a smaller bank returns
        all it has.
        """
        positioned, vectors = targets.positions is not None, self._vectors
        wanted = self._log_vectors(apply(targets.ellipsoids, lambda values: np.maximum(values, 0.0)))
        if targets.positions is not None:
            wanted = np.concatenate([wanted, POSITION_WEIGHT * targets.positions], axis=1)
        if positioned not in self._trees:
            if positioned:
                end_positions = self.arm.forward(self.joint_positions)[:, :3, 3]
                vectors = np.concatenate([vectors, POSITION_WEIGHT * end_positions], axis=1)
            self._trees[positioned] = cKDTree(vectors)
        rows = self._trees[positioned].query(wanted, k=[*range(1, min(k, len(self)) + 1)])[1]
        return np.asarray(self.joint_positions[rows])

    def require_fits(self, arm: Arm, spec: EllipsoidSpec) -> None:
        """Raise InvalidInputError unless this bank is of the same arm, whatever its limits, and ellipsoids."""
        require_compatible("the seed bank was built for", (self.arm, arm), (self.spec, spec))

    def _log_vectors(self, ellipsoids: Array) -> Array:
        return to_vector(apply(congruence(self._whitening, ellipsoids + self._shift), np.log))
