"""Seed configurations: samples of an arm that searches for ellipsoids start from.

Reaching an ellipsoid has many local minima. The samples with the most similar ellipsoids are starts in several basins.
"""

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.collisions import free_postures
from maniport.errors import FileFormatError, InvalidInputError
from maniport.motion.objective import Damping, Targets, as_damping
from maniport.spd.matrix_functions import apply, congruence, roots, to_vector
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.files import array_names, load_arrays, save_arrays
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import (
    Array,
    as_count,
    as_finite,
    as_metres,
    as_number,
    as_points,
    as_square,
    require_shape,
)

FILE_FORMAT = "maniport-start-bank-2"
_ARRAYS = (
    *("format", "arm", "kind", "part", "joint_weights", "damping"),
    *("joint_positions", "tip_positions", "ellipsoids"),
)
BANK_SIZE = 16_384
CHECKED = 16  # Number of samples that are computed again to check that a bank belongs to an arm


class SeedBank(NotebookDisplay):
    """Seed configurations: sampled configurations of an arm with their positions and ellipsoids.

    Make one with `SeedBank.build`, or read one with `SeedBank.load`.

    Attributes
    ----------
    joint_positions : ndarray, shape (n, dof)
        The samples, within the joint limits [rad or m].
    tip_positions : ndarray, shape (n, 3)
        Positions of the end effector in the base frame [m].
    ellipsoids : ndarray, shape (n, d, d)
        Ellipsoids of the arm, without damping.
    spec : EllipsoidSpec
        Which ellipsoids.
    damping : Regularization
        Its ε is added to all eigenvalues before ellipsoids are compared.
    """

    def __init__(self, arm: Arm, joint_positions: Array, damping: Damping, spec: EllipsoidSpec):
        self._arm_name = arm.name
        self.joint_positions, self.spec = joint_positions, spec
        self.tip_positions = np.ascontiguousarray(arm.forward(joint_positions)[:, :3, 3])
        self.ellipsoids = arm.ellipsoids(joint_positions, spec)
        self.damping = as_damping(damping, lambda: self.ellipsoids, positive=True)
        # A congruence changes no affine-invariant distance; about the mean, log space agrees with it best.
        logs = apply(self._damped(self.ellipsoids), np.log)
        self._whitening = roots(apply(logs.mean(axis=0), np.exp))[1]
        self._vectors = self._log_vectors(self._damped(self.ellipsoids))
        self._trees: dict[float, cKDTree] = {}

    @classmethod
    def build(
        cls,
        arm: Arm,
        n: int = BANK_SIZE,
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
            Postures that collide are left out, as in `maniport.sample_domain`.

        Raises
        ------
        InvalidInputError
            When an argument has a wrong value.
        """
        return cls(arm, free_postures(arm, as_count(n, "n"), random_state, collisions=collisions), damping, spec)

    @classmethod
    def given_or_built(cls, bank: "SeedBank | None", arm: Arm, spec: EllipsoidSpec, random_state: Any) -> "SeedBank":
        """Return a bank that was given, which must fit, or build one of the usual size."""
        if bank is None:
            return cls.build(arm, BANK_SIZE, random_state, spec=spec)
        bank.require_fits(arm, spec)
        return bank

    def __len__(self) -> int:
        return len(self.joint_positions)

    def __repr__(self) -> str:
        return f"SeedBank({self._arm_name!r}, n={len(self)}, {self.spec}, damping {self.damping.epsilon:.3g})"

    def query(
        self,
        ellipsoids: ArrayLike,
        positions: ArrayLike | None = None,
        k: int = 5,
        position_weight: float = 6.0,
    ) -> Array:
        """Configurations whose ellipsoids, and positions where given, are most similar to the targets.

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
        InvalidInputError
            When an argument has a wrong shape or value.
        NotSPDError
            When an ellipsoid is asymmetric or, with the bank's damping, not positive-definite.
        """
        damped = self._damped(as_square(ellipsoids, "ellipsoids", len(self._whitening)))
        vectors, weight = self._log_vectors(as_points(damped, "ellipsoids", minimum=1)), 0.0
        if positions is not None:
            weight = as_number(position_weight, "position_weight", above=0.0)
            vectors = np.concatenate([vectors, weight * as_positions(positions, len(vectors))], axis=1)
        if weight not in self._trees:
            known = np.concatenate([self._vectors, weight * self.tip_positions], axis=1)
            self._trees[weight] = cKDTree(known if weight else self._vectors)
        count = min(as_count(k, "k"), len(self))
        _, nearest = self._trees[weight].query(vectors, k=[*range(1, count + 1)])
        return np.asarray(self.joint_positions[nearest])

    def starts(self, targets: Array, positions: Array | None, k: int) -> Array:
        """`query` for targets (n, d, d) that are positive-definite with a damping of their own, maybe not the bank's.

        Negative eigenvalues count as zero.
        """
        return self.query(apply(targets, lambda values: np.maximum(values, 0.0)), positions, k)

    def starts_for(self, targets: Targets, k: int) -> Array:
        """Samples to search for targets from, shape (n, k, dof)."""
        return self.starts(targets.ellipsoids, targets.positions, k)

    def require_fits(self, arm: Arm, spec: EllipsoidSpec) -> None:
        """Raise InvalidInputError unless this bank holds the ellipsoids of `spec` that `arm` makes."""
        some = self.joint_positions[:CHECKED], self.tip_positions[:CHECKED], self.ellipsoids[:CHECKED]
        _require_fit(arm, spec, *some, f"the start bank was built for the arm {self._arm_name!r} with {self.spec!r}")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the bank to an ``.npz`` file without pickled objects; `SeedBank.load` reads it."""
        weights = self.spec.joint_weights
        arrays: dict[str, Any] = {
            "format": FILE_FORMAT,
            "arm": self._arm_name,
            "kind": self.spec.kind,
            "part": self.spec.part,
            "joint_weights": [] if weights is None else weights,
            "damping": self.damping.epsilon,
            "joint_positions": self.joint_positions,
            "tip_positions": self.tip_positions[:CHECKED],  # the others are computed as fast as they are read
            "ellipsoids": self.ellipsoids[:CHECKED],
        }
        save_arrays(path, {name: np.asarray(array) for name, array in arrays.items()})

    @classmethod
    def load(cls, path: str | os.PathLike[str], arm: Arm) -> "SeedBank":
        """Read a bank that was written by `save`, for the arm that it was built for.

        Raises
        ------
        FileFormatError
            When the file cannot be read or holds something else.
        InvalidInputError
            When the bank was built for an arm with other kinematics or wider limits.
        """
        arrays = load_arrays(path, "start bank file", _ARRAYS)
        if set(arrays) != set(_ARRAYS) or str(arrays["format"]) != FILE_FORMAT:
            raise FileFormatError(
                f"{str(path)!r} is not a start bank of this version; it holds {array_names(path, 'start bank file')}"
            )
        weights = arrays["joint_weights"]
        try:
            named = str(weights) if weights.dtype.kind == "U" else None
            spec = EllipsoidSpec(
                str(arrays["kind"]), str(arrays["part"]), named or (tuple(weights.tolist()) if weights.size else None)
            )
            samples, tips, ellipsoids = (as_finite(arrays[name], name) for name in _ARRAYS[-3:])
            require_shape(samples, "joint_positions", ("n", "dof"))
            damping = Regularization.absolute(as_number(arrays["damping"], "damping"))
        except (InvalidInputError, TypeError) as error:
            raise FileFormatError(f"{str(path)!r} is a damaged start bank: {error}") from None
        bank = f"the start bank {str(path)!r} was built for the arm {str(arrays['arm'])!r}"
        _require_fit(arm, spec, samples[:CHECKED], tips, ellipsoids, bank)
        return cls(arm, samples, damping, spec)

    def _damped(self, ellipsoids: Array) -> Array:
        return ellipsoids + self.damping.epsilon * np.eye(ellipsoids.shape[-1])

    def _log_vectors(self, damped: Array) -> Array:
        return to_vector(apply(congruence(self._whitening, damped), np.log))


def as_positions(value: ArrayLike, count: int) -> Array:
    """Convert to target positions of the tip, shape (count, 3), one for each ellipsoid."""
    positions = as_metres(value, "positions")
    require_shape(positions, "positions", (count, 3), ", one for each ellipsoid")
    return positions


def _require_fit(arm: Arm, spec: EllipsoidSpec, samples: Array, tips: Array, ellipsoids: Array, bank: str) -> None:
    """Raise unless an arm has its tip at `tips` and makes these ellipsoids at these samples, all within its limits."""
    differing = _differing(arm, spec, samples, tips, ellipsoids)
    if differing:
        raise InvalidInputError(
            f"{bank}; it does not fit {arm.name!r} to {arm.frame!r} with {spec!r}: {differing}. Build one that does: "
            "SeedBank.build(arm, ...)"
        )


def _differing(arm: Arm, spec: EllipsoidSpec, samples: Array, tips: Array, ellipsoids: Array) -> str:
    """What does not fit, in words; empty where all does."""
    if samples.shape[1] != arm.dof:
        return f"it is of {samples.shape[1]} joints, the arm has {arm.dof}"
    if not np.all(arm.within_limits(samples)):
        beyond = np.flatnonzero(((samples < arm.lower) | (samples > arm.upper)).any(axis=0))
        return f"it has samples beyond the limits of {', '.join(arm.joint_names[i] for i in beyond)}"
    for what, ours, theirs in (
        ("tip is elsewhere", arm.forward(samples)[:, :3, 3], tips),
        ("ellipsoids are others", arm.ellipsoids(samples, spec), ellipsoids),
    ):
        if ours.shape != theirs.shape or np.abs(ours - theirs).max() > 1e-6 * np.abs(theirs).max():
            return f"the {what} at the same joint positions"
    return ""
