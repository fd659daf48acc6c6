"""The maps that the live view switches between: a raw copy, and every method of transfer at the mounting of the day."""

import time as clock
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from maniport.errors import InvalidInputError, ManiportWarning
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.validation import Array, as_choice, as_rotation

GIVEN = "adapter file"
"""The adapter that was given ready fitted."""
KEEPS = "it keeps the mounting that it was fitted with"

AS_FOUND = "icp, as found"
"""What ICP finds, whether or not it clearly is better than its start, which ``"icp"`` keeps otherwise."""

VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {AS_FOUND: ("icp", {"compete": False})}
"""Methods with other settings than usual."""


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
    seconds: float = 0.0
    ending: str = ""
    notes: tuple[str, ...] = ()


class Methods:
    """Fits every method to one pair of domains, at any mounting.

    Parameters
    ----------
    teacher, student : ndarray, shape (n, 3, 3) and (m, 3, 3)
        Both domains, each in its own base frame.
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
        damping: float | None = 0.01,
        floor: float | None = None,
        given: DomainAdapter | None = None,
    ):
        self._teacher, self._student = teacher, student
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
            return LiveMap(name, rotation, self._given.compiled(), self._given.turn_, ending=KEEPS)
        method, variation = VARIANTS.get(name, (name, {}))
        adapter = method_of(method, **self._options | variation, mounting=rotation)
        started = clock.perf_counter()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            adapter.fit(self._teacher, self._student)
        seconds = clock.perf_counter() - started
        notes = tuple(str(one.message) for one in caught if issubclass(one.category, ManiportWarning))
        return LiveMap(name, rotation, adapter.compiled(), adapter.turn_, seconds, adapter.stop_reason_, notes)


def require_drawable(adapter: DomainAdapter) -> None:
    """Raise unless an adapter maps ellipsoids in space."""
    d = len(adapter.teacher_mean_)
    if d != 3:
        raise InvalidInputError(f"the adapter maps {d}×{d} ellipsoids; the live view shows 3×3 ones")
