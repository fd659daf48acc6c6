"""Whom a fit asks what the student can make: a callable, or one that also remembers and tells where it can move."""

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from maniport.errors import InvalidInputError
from maniport.spd.kernels import symmetrize
from maniport.spd.neighbors import NeighborIndex
from maniport.validation import Array, as_finite, as_points, require_shape

Projector = Callable[[Array], Any]
"""Takes ellipsoids with the student's damping, shape (n, d, d), and returns the nearest that the student can make, in
the same order and shape, damped alike. How it knows of the damping is its own affair. It may have an attribute `axis`,
a direction (3,) in the student's frame: whatever the student can make it can also make turned about it. It may have an
attribute `damping`, relative to the mean eigenvalue of a domain, that a field without damping takes over."""


WAYS = "the second of projector.search(damping).nearest(points)"


class ProjectorSearch(Protocol):
    """A search that remembers what it found for each point."""

    def nearest(self, points: Array, neighbors: NDArray[np.intp] | None = None) -> tuple[Array, Array]:
        """Return the nearest ellipsoids (n, d, d), and how the way there changes with each joint, (n, k, d, d)."""
        ...


@runtime_checkable
class SpreadingSearch(ProjectorSearch, Protocol):
    """A search that helps others, too; one that does not is begun anew for other points."""

    def beside(self, alike: NDArray[np.intp]) -> ProjectorSearch:
        """Begin a search for other points from what was found last for points `alike`, their indices (n,)."""
        ...


@runtime_checkable
class SearchingProjector(Protocol):
    """A projector that is faster, and whose fit is better, since it tells where the student can move."""

    def search(self, damping: float) -> ProjectorSearch:
        """Begin a search among ellipsoids that carry this damping ε [unit of M]."""
        ...


class NearestSamples:
    """The projector where nothing is known of the student but samples of its domain, damped, shape (m, d, d)."""

    def __init__(self, student: Array):
        self._index = NeighborIndex(student)

    def __call__(self, points: Array) -> Array:
        """Return the nearest sample to each point."""
        return np.asarray(self._index.points[self._index.query(points)[0]])


class Asking:
    """Asks a projector again and again for the same points, and checks what it says.

    Parameters
    ----------
    projector : Projector or SearchingProjector
    damping : float
        ε of the student.
    """

    def __init__(self, projector: Any, damping: float):
        self._projector, self._damping = projector, damping
        self._search = projector.search(damping) if isinstance(projector, SearchingProjector) else None

    def beside(self, alike: NDArray[np.intp]) -> "Asking":
        """Ask for other points, which are like some of these, indices (n,)."""
        other = Asking(self._projector, self._damping)
        if isinstance(self._search, SpreadingSearch):
            other._search = self._search.beside(alike)
        return other

    def nearest(self, points: Array, neighbors: NDArray[np.intp] | None = None) -> tuple[Array, Array | None]:
        """Return the nearest ellipsoids (n, d, d); and the ways (n, k, d, d), where the projector tells them."""
        found: Any
        if self._search is None:
            found, ways = self._projector(points.copy()), None
        else:
            found, ways = self._search.nearest(points, neighbors)
            ways = as_finite(ways, WAYS)
            require_shape(ways, WAYS, (len(points), "k", *points.shape[1:]))
        array = as_finite(found, "projector(points)")
        require_shape(array, "projector(points)", points.shape, ", as the points")
        nearest = as_points(array, "projector(points)", minimum=1)
        few = isinstance(self._projector, NearestSamples)  # samples may happen to lie so
        if not few and _alike(nearest) and not _alike(points):
            raise InvalidInputError(
                f"projector(points) is the same ellipsoid for all {len(points)} points; it must be the nearest to each"
            )
        return nearest, None if ways is None else symmetrize(ways)


def as_projector(projector: Any) -> Any:
    """Check that a projector is callable or can search."""
    if not callable(projector) and not isinstance(projector, SearchingProjector):
        raise InvalidInputError(
            f"projector must be callable, such as maniport.FeasibleProjector(arm); found {projector!r}"
        )
    return projector


def _alike(points: Array) -> bool:
    return bool(np.abs(points - points[0]).max() <= 1e-12 * np.abs(points[0]).max())
