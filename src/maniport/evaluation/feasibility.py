"""How far adapted ellipsoids are from what the student can make."""

from typing import Any

from numpy.typing import ArrayLike

from maniport.bodies import Arm
from maniport.spd.neighbors import nearest
from maniport.tracking.search.feasible import nearest_feasible
from maniport.validation import Array, as_points


def true_gap(arm: Arm, ellipsoids: ArrayLike, *, floor: float = 0.0, **options: Any) -> Array:
    """Distance from each ellipsoid to the nearest one that the arm can make, min over q of d(M, M(q)), within limits.

    Reports of a motion call it the feasibility gap. It tells what the arm can do, which `sample_gap` does not: near
    singular shapes the nearest of N samples is far away although the arm could make the ellipsoid exactly. It is an
    upper bound, found by descent from several starts; see `maniport.tracking.search.feasible.nearest_feasible`.

    Parameters
    ----------
    arm : Arm
        The student.
    ellipsoids : array_like, shape (n, d, d)
        What an adapter gives; positive semidefinite where there is a `floor`.
    floor : float
        ε I is added on both sides, in the unit of M: an adapter's ``student_damping_``, so that distances are
        measured as they were in its fit.
    **options
        Passed on to `nearest_feasible`: part, kind, joint_weights, n_starts, random_state, n_jobs.

    Returns
    -------
    ndarray, shape (n,)
        Affine-invariant distances; zero where the arm can make the ellipsoid.
    """
    return nearest_feasible(arm, ellipsoids, floor=floor, **options).distance


def sample_gap(ellipsoids: ArrayLike, cloud: ArrayLike) -> Array:
    """Distance from each ellipsoid to the nearest of N samples of the student.

    Read it beside the student's own sampling noise, ``sample_gap(fresh, cloud)`` with fresh samples of the student:
    a gap of that size is none. Where the kinematics is known, `true_gap` says more.

    Parameters
    ----------
    ellipsoids : array_like, shape (n, d, d)
        SPD, with the student's regularisation.
    cloud : array_like, shape (N, d, d)
        SPD, with the same.

    Returns
    -------
    ndarray, shape (n,)
    """
    asked = as_points(ellipsoids, "ellipsoids", minimum=1, copy=False)
    return nearest(asked, as_points(cloud, "cloud", asked.shape[-1], minimum=1, copy=False))[1]
