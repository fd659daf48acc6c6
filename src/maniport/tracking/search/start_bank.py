"""A bank of configurations of an arm that proposes where a search for an ellipsoid shall start.

Reaching an ellipsoid is full of local minima: many postures make similar ellipsoids, and between them the way leads
uphill or against the joint limits. The samples of the joint space with the most similar ellipsoids are starts in
several basins, the right one mostly among them.
"""

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from maniport.bodies import Arm
from maniport.errors import FileFormatError, InvalidInputError
from maniport.files import load_arrays, save_arrays
from maniport.notebook import ShownInNotebooks
from maniport.spd.matrix_functions import apply, congruence, roots, to_vector
from maniport.validation import Array, as_count, as_finite, as_number, as_points, as_square

FILE_FORMAT = "maniport-start-bank-1"
RELATIVE_FLOOR = 0.01
POSITION_WEIGHT = 6.0
"""What a metre between hand positions counts for beside the distance between ellipsoids, when starts are chosen."""
CHECKED = 16
"""Number of samples that are computed anew to see that a bank belongs to an arm."""


class StartBank(ShownInNotebooks):
    """Sampled configurations of an arm with their hand positions and ellipsoids.

    Make one with `StartBank.build`, or read one with `StartBank.load`.

    Attributes
    ----------
    joint_positions : ndarray, shape (n, dof)
        The samples, within the joint limits [rad or m].
    hand_positions : ndarray, shape (n, 3)
        Where the arm's tip is, in the base frame [m].
    ellipsoids : ndarray, shape (n, d, d)
        The arm's own, without floor.
    floor : float
        What is added to all eigenvalues before ellipsoids are compared [unit of M].
    options : dict
        ``kind``, ``part`` and ``joint_weights`` of the ellipsoids, as in `Arm.manipulability`.
    """

    def __init__(self, arm: Arm, joint_positions: Array, floor: float | None, options: dict[str, Any]):
        self._arm_name = arm.name
        self.joint_positions = joint_positions
        self.hand_positions = np.ascontiguousarray(arm.forward(joint_positions)[:, :3, 3])
        self.ellipsoids = arm.manipulability(joint_positions, **options)
        weights = options["joint_weights"]
        self.options = {**options, "joint_weights": arm.velocity_limits if isinstance(weights, str) else weights}
        scale = float(np.trace(self.ellipsoids.mean(axis=0))) / self.ellipsoids.shape[-1]
        self.floor = RELATIVE_FLOOR * scale if floor is None else as_number(floor, "floor", above=0.0)
        # A congruence changes no affine-invariant distance; about the mean, log space agrees with it best.
        logs = apply(self._raised(self.ellipsoids), np.log)
        self._whitening = roots(apply(logs.mean(axis=0), np.exp))[1]
        self._vectors = self._log_vectors(self._raised(self.ellipsoids))
        self._trees: dict[float, cKDTree] = {}

    @classmethod
    def build(
        cls,
        arm: Arm,
        n: int = 40_000,
        random_state: Any = 0,
        *,
        kind: str = "velocity",
        part: str = "translation",
        joint_weights: ArrayLike | str | None = None,
        floor: float | None = None,
    ) -> "StartBank":
        """Sample the joint space of an arm; 40 000 samples of the Panda take half a second.

        Parameters
        ----------
        arm : Arm
        n : int
            Number of samples, from a scrambled Sobol sequence within the joint limits.
        random_state : None, int or numpy.random.Generator
            Same seed, same bank.
        kind, part, joint_weights
            Which ellipsoids, as in `Arm.manipulability`.
        floor : float, optional
            Added to all eigenvalues before ellipsoids are compared, so that flat ones can be [unit of M]. Default:
            a hundredth of the mean eigenvalue, 0.01 tr(mean M)/d.

        Raises
        ------
        InvalidInputError
            When an argument has a wrong value.
        """
        options = {"kind": kind, "part": part, "joint_weights": joint_weights}
        return cls(arm, arm.sample(as_count(n, "n"), random_state), floor, options)

    def __len__(self) -> int:
        return len(self.joint_positions)

    def __repr__(self) -> str:
        return f"StartBank({self._arm_name!r}, n={len(self)}, floor={self.floor:.3g})"

    def _facts(self) -> dict[str, object]:
        low, high = self.hand_positions.min(axis=0), self.hand_positions.max(axis=0)
        weights = self.options["joint_weights"]
        return {
            "arm": self._arm_name,
            "samples": len(self),
            "ellipsoids": f"{self.options['kind']}, {self.options['part']}, d = {self.ellipsoids.shape[-1]}",
            "joint weights": None if weights is None else ", ".join(f"{one:g}" for one in weights),
            "floor": f"{self.floor:.3g}",
            "hand": ", ".join(f"{axis} {a:.2f} to {b:.2f} m" for axis, a, b in zip("xyz", low, high, strict=True)),
        }

    def query(
        self,
        ellipsoids: ArrayLike,
        positions: ArrayLike | None = None,
        k: int = 5,
        position_weight: float = POSITION_WEIGHT,
    ) -> Array:
        """Configurations whose ellipsoids, and hand positions where wanted, are most similar to the wanted ones.

        Parameters
        ----------
        ellipsoids : array_like, shape (n, d, d)
            Wanted ellipsoids in the arm's base frame, without floor.
        positions : array_like, shape (n, 3), optional
            Wanted hand positions in the base frame [m].
        k : int
            How many configurations for each; a smaller bank gives all it has.
        position_weight : float
            What a metre counts for beside the distance between ellipsoids [1/m].

        Returns
        -------
        ndarray, shape (n, k, dof)
            Nearest first, by the logarithms of the ellipsoids relative to the bank's mean.

        Raises
        ------
        InvalidInputError
            When an argument has a wrong shape or value.
        NotSPDError
            When an ellipsoid is asymmetric or, with the bank's floor, not positive-definite.
        """
        raised = self._raised(as_square(ellipsoids, "ellipsoids", len(self._whitening)))
        vectors, weight = self._log_vectors(as_points(raised, "ellipsoids", minimum=1)), 0.0
        if positions is not None:
            weight = as_number(position_weight, "position_weight", above=0.0)
            vectors = np.concatenate([vectors, weight * as_hand_positions(positions, len(vectors))], axis=1)
        if weight not in self._trees:
            known = np.concatenate([self._vectors, weight * self.hand_positions], axis=1)
            self._trees[weight] = cKDTree(known if weight else self._vectors)
        count = min(as_count(k, "k"), len(self))
        _, nearest = self._trees[weight].query(vectors, k=[*range(1, count + 1)])
        return np.asarray(self.joint_positions[nearest])

    def require_fits(self, arm: Arm, **options: Any) -> None:
        """Raise InvalidInputError unless this bank holds the ellipsoids that `arm` makes with these options."""
        some, options = slice(CHECKED), self.options | options
        if not _fits(arm, options, self.joint_positions[some], self.hand_positions[some], self.ellipsoids[some]):
            raise InvalidInputError(
                f"the start bank was built for the arm {self._arm_name!r} with {self.options}; it does not fit "
                f"{arm.name!r} to {arm.frame!r} with {options}. Build one that does: StartBank.build(arm, ...)"
            )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the bank to an ``.npz`` file without pickled objects; `StartBank.load` reads it."""
        weights = self.options["joint_weights"]
        arrays = {
            "format": FILE_FORMAT,
            "arm": self._arm_name,
            "kind": self.options["kind"],
            "part": self.options["part"],
            "joint_weights": [] if weights is None else weights,
            "floor": self.floor,
            "joint_positions": self.joint_positions,
            "hand_positions": self.hand_positions[:CHECKED],  # the others are computed as fast as they are read
            "ellipsoids": self.ellipsoids[:CHECKED],
        }
        save_arrays(path, {name: np.asarray(array) for name, array in arrays.items()})

    @classmethod
    def load(cls, path: str | os.PathLike[str], arm: Arm) -> "StartBank":
        """Read a bank that was written by `save`, for the arm that it was built for.

        Raises
        ------
        FileFormatError
            When the file cannot be read or holds something else.
        InvalidInputError
            When the bank was built for an arm with other kinematics or wider limits.
        """
        arrays = load_arrays(path, "start bank file")
        if str(arrays.get("format")) != FILE_FORMAT:
            raise FileFormatError(f"{str(path)!r} is not a start bank of this version; it holds {sorted(arrays)}")
        weights, samples = arrays["joint_weights"], arrays["joint_positions"]
        options = {
            "kind": str(arrays["kind"]),
            "part": str(arrays["part"]),
            "joint_weights": weights if weights.size else None,
        }
        if not _fits(arm, options, samples[:CHECKED], arrays["hand_positions"], arrays["ellipsoids"]):
            raise InvalidInputError(
                f"the start bank {str(path)!r} was built for the arm {str(arrays['arm'])!r}; it does not fit "
                f"{arm.name!r} to {arm.frame!r}. Build one that does: StartBank.build(arm, ...)"
            )
        return cls(arm, samples, float(arrays["floor"]), options)

    def _raised(self, ellipsoids: Array) -> Array:
        return ellipsoids + self.floor * np.eye(ellipsoids.shape[-1])

    def _log_vectors(self, raised: Array) -> Array:
        return to_vector(apply(congruence(self._whitening, raised), np.log))


def as_hand_positions(value: ArrayLike, count: int) -> Array:
    """Convert to positions of the hand, shape (count, 3), one for each ellipsoid."""
    positions = as_finite(value, "positions")
    if positions.shape != (count, 3):
        raise InvalidInputError(
            f"positions must have shape ({count}, 3), one for each ellipsoid; found shape {positions.shape}"
        )
    return positions


def semidefinite(ellipsoids: Array) -> Array:
    """Ellipsoids (n, d, d) as a bank takes them: what is positive-definite with one floor may not be so with its own.

    Negative eigenvalues become zero.
    """
    return apply(ellipsoids, lambda values: np.maximum(values, 0.0))


def _fits(arm: Arm, options: dict[str, Any], samples: Array, hands: Array, ellipsoids: Array) -> bool:
    """Whether an arm has its hand at `hands` and makes these ellipsoids at these samples, all within its limits."""
    if samples.shape[1] != arm.dof or not np.all(arm.within_limits(samples)):
        return False
    found = arm.forward(samples)[:, :3, 3], arm.manipulability(samples, **options)
    for ours, theirs in zip(found, (hands, ellipsoids), strict=True):
        if ours.shape != theirs.shape or np.abs(ours - theirs).max() > 1e-6 * np.abs(theirs).max():
            return False
    return True
