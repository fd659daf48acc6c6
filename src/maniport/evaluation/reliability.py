"""How far a fitted map can be trusted: whether it leaves alone what needs no change, and comes out the same again."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import IdentifiabilityWarning, InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.mean import mean
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.rotation_group import rotation_angle
from maniport.validation import Array, as_finite


@dataclass(frozen=True)
class Stability:
    """Spread of a fitted map over independent draws of the same two domains.

    Attributes
    ----------
    rotation_largest, rotation_rms : float
        Angle between a draw's ``rotation_`` and the mean one [degrees]: the largest, and the root mean square.
    map_spread : float
        Root mean squared distance of an ellipsoid's images to their Fréchet mean; median over the probes.
    n_draws : int

    See Also
    --------
    stability : makes it.
    """

    rotation_largest: float
    rotation_rms: float
    map_spread: float
    n_draws: int


def identity_test(adapter: DomainAdapter, first: ArrayLike, second: ArrayLike, most: int | None = None) -> float:
    """Fit a clone of the adapter from a domain to itself; the truth is to change nothing.

    Parameters
    ----------
    adapter : DomainAdapter
        Any, fitted or not; only its parameters are used. A known mounting becomes the identity, which is the truth
        here, and known pairs are left out.
    first, second : array_like, shapes (n, d, d) and (m, d, d)
        Two disjoint draws of the student's domain: teacher and student of the test.
    most : int, optional
        Samples that a method with a parameter `n_samples` is fitted to at most. Default: as many as it takes.

    Returns
    -------
    float
        Root mean squared distance from each of `first` to its image, undivided; zero would be perfect. What two
        draws differ by keeps it above zero.

    See Also
    --------
    stability : the other test of a fit without truth.
    """
    same: Any = adapter.silent()
    parameters = same.get_params(deep=False)
    if parameters.get("mounting") is not None:
        same.set_params(mounting=np.eye(as_finite(first, "first").shape[-1]))
    if most is not None and "n_samples" in parameters:
        same.set_params(n_samples=min(most, parameters["n_samples"]))
    if parameters.get("pairs") is not None:
        same.set_params(pairs=None)
    changes = _refitted(same, first, second).errors(first, first)
    return float(np.sqrt(np.mean(changes**2)))


def stability(
    adapter: DomainAdapter,
    teacher_draws: Sequence[ArrayLike],
    student_draws: Sequence[ArrayLike],
    probe: ArrayLike,
    **options: Any,
) -> Stability:
    """Refit clones of the adapter on independent draws of both domains, and compare what comes out.

    Parameters
    ----------
    adapter : DomainAdapter
        Any, fitted or not; only its parameters are used.
    teacher_draws, student_draws : sequence of array_like, shapes (n, d, d) and (m, d, d)
        Draw i of the one belongs to draw i of the other; at least two.
    probe : array_like, shape (k, d, d)
        The teacher's ellipsoids that every fitted map is tried on.
    **options
        Passed on to the adapter's `fit`, such as known pairs.

    Raises
    ------
    InvalidInputError
        When there are fewer than two draws, or not equally many.

    See Also
    --------
    Stability : what comes out.
    identity_test : the other test of a fit without truth.
    """
    if len(teacher_draws) != len(student_draws) or len(teacher_draws) < 2:
        raise InvalidInputError(
            "teacher_draws and student_draws must be equally many, at least 2; "
            f"found {len(teacher_draws)} and {len(student_draws)}"
        )
    both = zip(teacher_draws, student_draws, strict=True)
    fitted = [_refitted(adapter.silent(), teacher, student, **options) for teacher, student in both]
    angles = _angles_from_mean([one.rotation_ for one in fitted])
    images = np.stack([one.student_side(one.transform(probe)) for one in fitted], axis=1)
    if images.ndim != 4:
        raise InvalidInputError(f"probe must have shape (k, d, d); found {np.shape(probe)}")
    spread = [np.sqrt(np.mean(distance_unchecked(mean(own), own) ** 2)) for own in images]
    return Stability(
        float(np.degrees(np.max(angles))),
        float(np.degrees(np.sqrt(np.mean(angles**2)))),
        float(np.median(spread)),
        len(fitted),
    )


def _refitted(adapter: DomainAdapter, teacher: ArrayLike, student: ArrayLike, **options: Any) -> DomainAdapter:
    """Fit without a warning that the rotation is not determined: how far that goes is what is measured here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        return adapter.fit(teacher, student, **options)


def _angles_from_mean(rotations: list[Array]) -> Array:
    """Angles [rad] from the chordal mean, the rotation nearest to the sum (Hartley et al., IJCV 103, 2013, § 5.3)."""
    left, _, right = np.linalg.svd(np.sum(rotations, axis=0))
    if np.linalg.det(left @ right) * np.linalg.det(rotations[0]) < 0:
        left[:, -1] *= -1.0
    return np.array([rotation_angle(left @ right, one) for one in rotations])
