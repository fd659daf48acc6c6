"""How far adapted ellipsoids are from what they should be, where that is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.mean import mean
from maniport.validation import Array, as_points


@dataclass(frozen=True)
class RMSE:
    """Root mean squared distance between the truth and the mapped ellipsoids, in three forms.

    Attributes
    ----------
    undivided : float
        sqrt(mean d²), dimensionless.
    per_dispersion : float
        Divided by the mean distance of the mapped ellipsoids to their Fréchet mean (Reithmeir et al. 2022, § V).
    per_squared_dispersion : float
        Divided by their mean squared distance to it, which is what the authors' published code computes.
    """

    undivided: float
    per_dispersion: float
    per_squared_dispersion: float


def rmse(truth: ArrayLike, mapped: ArrayLike) -> RMSE:
    """Root mean squared affine-invariant distance between ellipsoids and what they should be.

    Parameters
    ----------
    truth, mapped : array_like, shape (n, d, d)
        SPD, in the same order; both with the same regularisation, else the distances mean nothing.

    Returns
    -------
    RMSE

    Raises
    ------
    NotSPDError, InvalidInputError
        When a matrix is not SPD, the two are not equally many, or the mapped ellipsoids do not differ, so that
        there is no dispersion to divide by.
    """
    wanted, found = as_pair(truth, mapped, "truth", "mapped", minimum=2)
    undivided = float(np.sqrt(np.mean(distance_unchecked(wanted, found) ** 2)))
    apart = distance_unchecked(mean(found), found)
    if np.max(apart) <= 1e-9:
        raise InvalidInputError(f"mapped has no dispersion to divide by: all {len(found)} ellipsoids are equal")
    return RMSE(undivided, float(undivided / np.mean(apart)), float(undivided / np.mean(apart**2)))


def as_pair(first: ArrayLike, other: ArrayLike, name: str, other_name: str, minimum: int) -> tuple[Array, Array]:
    """Check two sets of SPD matrices, both of shape (n, d, d), that belong together one by one."""
    a = as_points(first, name, minimum=minimum, copy=False)
    b = as_points(other, other_name, a.shape[-1], minimum=minimum, copy=False)
    if len(a) != len(b):
        raise InvalidInputError(f"{name} and {other_name} must be equally many; found {len(a)} and {len(b)}")
    return a, b
