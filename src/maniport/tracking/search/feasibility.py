"""How much of what is wanted an arm can make at all."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm
from maniport.errors import InvalidInputError
from maniport.steps import Progress
from maniport.tracking.follow.tracker import default_floor
from maniport.tracking.search.feasible import nearest_feasible
from maniport.validation import Array, as_count, as_positive_semidefinite

POINTS = 250
"""So many points tell a gap over time: of a profile of 1128 ellipsoids they take 2 s instead of 7 s."""


def feasibility_gap(
    arm: Arm,
    profile: ArrayLike,
    *,
    floor: float | None = None,
    part: str = "translation",
    n_points: int = POINTS,
    progress: Progress | None = None,
) -> Array:
    """Distance from each wanted ellipsoid to the nearest that an arm can make, wherever its hand is.

    The distances are upper bounds, as those of
    `nearest_feasible`: a motion may happen to come nearer than what the search found.

    Parameters
    ----------
    arm : Arm
    profile : array_like, shape (n, d, d)
        Wanted velocity ellipsoids in the arm's base frame, in the order of time.
    floor : float, optional
        Added to all eigenvalues before ellipsoids are compared [unit of M]. Default: a hundredth of the arm's mean.
    part : str
        Which ellipsoids, as in `Arm.manipulability`.
    n_points : int
        Most ellipsoids that are searched for, evenly spread; between them the gap is linear in their number.
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    NotSPDError, InvalidInputError
        As `nearest_feasible`.
    """
    wanted, most = as_positive_semidefinite(profile, "profile"), as_count(n_points, "n_points")
    if wanted.ndim != 3 or not len(wanted):
        raise InvalidInputError(f"profile must have shape (n, d, d) with n ≥ 1; found {wanted.shape}")
    chosen = np.unique(np.linspace(0, len(wanted) - 1, min(most, len(wanted))).round().astype(int))
    lift = default_floor(arm, {"part": part}) if floor is None else floor
    found = nearest_feasible(arm, wanted[chosen], floor=lift, part=part, progress=progress)
    return np.interp(np.arange(len(wanted)), chosen, found.distance)
