"""The joint coordinates of an arm: their names and limits, and samples within them."""

import inspect
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import qmc

from maniport.errors import InvalidInputError
from maniport.validation import Array, as_choice, as_count, as_finite, as_generator

LIMIT_TOLERANCE = 1e-6
"""How far outside its limits a coordinate may lie and still count as inside [rad] or [m]."""

# SciPy 1.15 renamed the argument; the older name is to disappear.
_SEED = "rng" if "rng" in inspect.signature(qmc.Sobol).parameters else "seed"

VELOCITY_LIMITS = "velocity-limits"
"""The word for ``joint_weights`` that stands for the arm's own velocity limits."""


class JointSpace:
    """Configurations of an arm, shape (..., dof).

    Attributes
    ----------
    name : str
        Name of the arm.
    dof : int
        Number of degrees of freedom.
    joint_names : tuple of str
        Their names.
    lower, upper : ndarray, shape (dof,)
        Their limits [rad] or [m], read-only.
    velocity_limits : ndarray, shape (dof,), or None
        Their largest speeds [rad/s] or [m/s], read-only; infinite where unknown, None when none is known.
    """

    def __init__(
        self, name: str, joint_names: tuple[str, ...], lower: Array, upper: Array, velocity_limits: Array | None
    ):
        self.name = name
        self.dof = len(joint_names)
        self.joint_names = joint_names
        self.lower = _read_only(lower)
        self.upper = _read_only(upper)
        self.velocity_limits = None if velocity_limits is None else _read_only(velocity_limits)

    def sample(self, n: int, random_state: Any = None, sequence: str = "sobol") -> Array:
        """Draw configurations that fill the joint limits.

        Parameters
        ----------
        n : int
            How many. Powers of two keep the balance of a Sobol sequence and are the best choice; other numbers take
            the first n points of the sequence.
        random_state : None, int or numpy.random.Generator
            Seed: the same seed gives the same bits, and the first points are the same for every n.
        sequence : {"sobol", "uniform"}
            Scrambled Sobol points, which cover the limits more evenly, or independent uniform ones.

        Returns
        -------
        ndarray, shape (n, dof)

        Raises
        ------
        InvalidInputError
            When an argument has a wrong value.
        """
        count = as_count(n, "n")
        as_choice(sequence, "sequence", ("sobol", "uniform"))
        generator = as_generator(random_state)
        if sequence == "uniform":
            unit = generator.random((count, self.dof))
        else:
            sobol = qmc.Sobol(self.dof, scramble=True, **{_SEED: generator})
            unit = sobol.random_base2((count - 1).bit_length())[:count]
        return np.clip(self.lower + unit * (self.upper - self.lower), self.lower, self.upper)

    def within_limits(self, q: ArrayLike) -> Any:
        """Whether configurations respect all joint limits (to 1e-6 rad or m), bool of shape (...)."""
        array = self._configurations(q, "q")
        inside = (array >= self.lower - LIMIT_TOLERANCE) & (array <= self.upper + LIMIT_TOLERANCE)
        return inside.all(axis=-1)

    def require_within_limits(self, q: ArrayLike, name: str = "q") -> Array:
        """Check configurations against the joint limits (to 1e-6 rad or m).

        Parameters
        ----------
        q : array_like, shape (..., dof)
            Configurations.
        name : str
            What to call them in the message.

        Returns
        -------
        ndarray, shape (..., dof)
            The configurations, unchanged.

        Raises
        ------
        InvalidInputError
            Naming the first joint outside, its index, value and limits.
        """
        array = self._configurations(q, name)
        outside = (array < self.lower - LIMIT_TOLERANCE) | (array > self.upper + LIMIT_TOLERANCE)
        if np.any(outside):
            index = tuple(int(i) for i in np.argwhere(outside)[0])
            j = index[-1]
            raise InvalidInputError(
                f"{name}[{', '.join(map(str, index))}] = {array[index]:.6g} lies outside the limits "
                f"{self.lower[j]:.6g} to {self.upper[j]:.6g} of joint {self.joint_names[j]!r} of {self.name!r} "
                f"({int(outside.sum())} of {outside.size} values lie outside)"
            )
        return array

    def _configurations(self, q: ArrayLike, name: str) -> Array:
        array = as_finite(q, name)
        if array.ndim < 1 or array.shape[-1] != self.dof:
            raise InvalidInputError(
                f"{name} must have shape (..., {self.dof}), one value for each joint of {self.name!r} "
                f"({', '.join(self.joint_names)}); found shape {array.shape}"
            )
        return array

    def _weights(self, joint_weights: ArrayLike | str | None) -> ArrayLike | None:
        if not isinstance(joint_weights, str):
            return joint_weights
        as_choice(joint_weights, "joint_weights", (VELOCITY_LIMITS,))
        speeds = self.velocity_limits
        if speeds is None or not np.all(np.isfinite(speeds)):
            unknown = [n for i, n in enumerate(self.joint_names) if speeds is None or not np.isfinite(speeds[i])]
            raise InvalidInputError(
                f"joint_weights: {self.name!r} has no velocity limits for {', '.join(unknown)}; give numbers instead"
            )
        return speeds


def _read_only(array: Array) -> Array:
    copy = np.array(array, dtype=np.float64)
    copy.flags.writeable = False
    return copy
