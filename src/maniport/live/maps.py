"""The maps that the live view switches between: a raw copy, and every method of transfer at the mounting of the day."""

import time as clock
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.errors import InvalidInputError, ManiportWarning
from maniport.spd.neighbors import NeighborIndex
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.validation import Array, as_choice, as_rotation

GIVEN = "adapter file"
"""The adapter that was given ready fitted."""
KEEPS = "it keeps the mounting that it was fitted with"

AS_FOUND = "icp, as found"
"""What ICP finds, whether or not it clearly is better than its start, which ``"icp"`` keeps otherwise."""

VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {AS_FOUND: ("icp", {"compete": False})}
"""Methods with other settings than usual."""

PROBES = 256
"""How many of the teacher's samples a map is tried on."""


@dataclass(frozen=True, eq=False)
class LiveMap:
    """One method's map at one mounting, for one ellipsoid at a time.

    Attributes
    ----------
    name : str
    mounting : ndarray, shape (3, 3)
        Rotation from the person's trunk frame to the robot's base frame that it was fitted with.
    transform : callable
        Takes and returns one ellipsoid, shape (3, 3); raises NotSPDError where it has no image.
    turn : ndarray, shape (3, 3)
        How it turns ellipsoids, and with them the motion of the hand.
    gap : float
        Median distance from the images of the teacher's samples to the nearest of the student's.
    seconds : float
        That the fit took; zero where nothing was fitted.
    ending : str
        How the fit ended.
    notes : tuple of str
        What the fit warned of.
    """

    name: str
    mounting: Array
    transform: Callable[[Array], Array]
    turn: Array
    gap: float
    seconds: float = 0.0
    ending: str = ""
    notes: tuple[str, ...] = ()


class Methods:
    """Fits every method to one pair of domains, at any mounting.

    Parameters
    ----------
    teacher, student : ndarray, shape (n, 3, 3) and (m, 3, 3)
        Both domains, each in its own base frame.
    lift : float
        Added to the eigenvalues of all ellipsoids before distances between them are measured [unit of M]; the same for
        all methods, so that their gaps can be compared.
    damping, floor : float, optional
        Regularisation of the methods, see `maniport.spd.regularization`.
    given : DomainAdapter, optional
        A fitted adapter that is offered beside the methods.

    Attributes
    ----------
    names : tuple of str
        What there is to choose from.
    """

    def __init__(
        self,
        teacher: Array,
        student: Array,
        lift: float,
        damping: float | None = 0.01,
        floor: float | None = None,
        given: DomainAdapter | None = None,
    ):
        self._teacher, self._student, self._lift = teacher, student, lift
        self._probes = teacher[np.unique(np.linspace(0, len(teacher) - 1, PROBES).round().astype(int))]
        self._index = NeighborIndex(self._raised(student))
        self._options = {"damping": damping, "floor": floor, "random_state": 0, "n_resamples": 0}
        if given is not None:
            require_drawable(given)
        self._given = given
        self.names = (*([] if given is None else [GIVEN]), *METHODS, *VARIANTS)

    def fit(self, name: str, mounting: Array) -> LiveMap:
        """Fit a method at a mounting, shape (3, 3)."""
        as_choice(name, "method", self.names)
        rotation = as_rotation(mounting, "mounting", 3)
        if name == GIVEN and self._given is not None:
            transform = self._given.compiled()
            return LiveMap(name, rotation, transform, self._given.turn_, self._typical_gap(transform), ending=KEEPS)
        method, variation = VARIANTS.get(name, (name, {}))
        adapter = method_of(method, **self._options | variation, mounting=rotation)
        started = clock.perf_counter()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            adapter.fit(self._teacher, self._student)
        seconds = clock.perf_counter() - started
        notes = tuple(str(one.message) for one in caught if issubclass(one.category, ManiportWarning))
        transform = adapter.compiled()
        gap = self._typical_gap(transform)
        return LiveMap(name, rotation, transform, adapter.turn_, gap, seconds, adapter.stop_reason_, notes)

    def gaps(self, ellipsoids: Array) -> Array:
        """Distance from ellipsoids (n, 3, 3) to the nearest of the student's samples, shape (n,)."""
        return self._index.query(self._raised(ellipsoids))[1]

    def _typical_gap(self, transform: Callable[[Array], Array]) -> float:
        return float(np.median(self.gaps(np.array([transform(probe) for probe in self._probes]))))

    def _raised(self, ellipsoids: Array) -> Array:
        return np.asarray(ellipsoids + self._lift * np.eye(3))


def require_drawable(adapter: DomainAdapter) -> None:
    """Raise unless an adapter maps ellipsoids in space."""
    d = len(adapter.teacher_mean_)
    if d != 3:
        raise InvalidInputError(f"the adapter maps {d}×{d} ellipsoids; the live view shows 3×3 ones")
