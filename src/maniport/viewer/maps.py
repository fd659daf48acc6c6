"""Maps of the live view: every method of transfer, fitted again when the base orientation changes."""

import threading
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from maniport.arms import VELOCITY, Arm
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.feasibility import knowing
from maniport.motion import SeedBank
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.util.validation import Array, as_choice, as_rotation

GIVEN = "adapter file"  # Name of an adapter that was given fitted


@dataclass(frozen=True, eq=False)
class LiveMap:
    """One method's map at one base orientation, for one ellipsoid at a time."""

    name: str
    base_rotation: Array  # Rotation from the person's trunk frame to the robot's base frame, shape (3, 3)
    transform: Callable[[Array], Array]  # Maps one ellipsoid (3, 3); raises NotSPDError where it has no image
    turn: Array  # rotation of ellipsoids and of the hand's path, shape (3, 3)
    notes: tuple[str, ...] = ()  # Warnings of the fit


class Methods:
    """Fits every method to a pair of domains (n, 3, 3) and (m, 3, 3), at any base orientation."""

    def __init__(
        self,
        teacher: Array,
        student: Array,
        damping: float | None = 0.01,
        eigenvalue_floor: float | None = None,
        given: DomainAdapter | None = None,
        robot: Arm | None = None,
        bank: SeedBank | None = None,
    ):
        self._teacher, self._student = teacher, student
        self._robot = robot, VELOCITY, bank
        self._options = {"damping": damping, "eigenvalue_floor": eigenvalue_floor, "random_state": 0}
        if given is not None:
            require_drawable(given)
        self._given = given
        self.names = (*([] if given is None else [GIVEN]), *METHODS)

    def fit(self, name: str, base_rotation: Array) -> LiveMap:
        """Fit a method at a base orientation, shape (3, 3)."""
        as_choice(name, "method", self.names)
        rotation = as_rotation(base_rotation, "base_rotation", 3)
        if name == GIVEN and self._given is not None:
            note = "it keeps the base orientation of its fit"
            return LiveMap(name, rotation, self._given.compiled(), self._given.map_rotation_, (note,))
        adapter = knowing(method_of(name, **self._options, base_rotation=rotation), *self._robot)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            adapter.fit(self._teacher, self._student)
        notes = tuple(str(warning.message) for warning in caught if issubclass(warning.category, ManiportWarning))
        return LiveMap(name, rotation, adapter.compiled(), adapter.map_rotation_, notes)


def require_drawable(adapter: DomainAdapter) -> None:
    """Raise unless an adapter maps ellipsoids in space."""
    d = len(adapter.teacher_mean_)
    if d != 3:
        raise InvalidInputError(f"the adapter maps {d}×{d} ellipsoids; the live view shows 3×3 ones")


class Refitting:
    """Keeps a map of each method, and fits them again, in a thread, when the base orientation changes."""

    def __init__(self, methods: Methods, base_rotation: Array, first: Sequence[str] | None = None):
        self.methods = methods
        self._base_rotation = as_rotation(base_rotation, "base_rotation", 3)
        now = methods.names if first is None else first
        self._maps = {name: methods.fit(name, self._base_rotation) for name in now}
        self._todo: list[str] = [name for name in methods.names if name not in now]
        self._fits = self._closed = False
        self._error: Exception | None = None
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._work, name="refitting", daemon=True)
        self.before: Callable[[], None] | None = None

    @property
    def maps(self) -> Mapping[str, LiveMap]:
        """The newest map of each method; raises the error of a fit."""
        with self._changed:
            if self._error is not None:
                raise self._error
            return dict(self._maps)

    @property
    def busy(self) -> bool:
        """Whether methods are to be fitted."""
        with self._changed:
            return self._fits or bool(self._todo)

    def begin(self) -> None:
        """Start the thread."""
        with self._changed:
            if self._thread.ident is None:
                self._thread.start()

    def want(self, base_rotation: Array, first: str) -> None:
        """Request maps at a base orientation, that of the method `first` before the others; returns at once."""
        rotation = as_rotation(base_rotation, "base_rotation", 3)
        as_choice(first, "first", self.methods.names)
        with self._changed:
            if np.array_equal(rotation, self._base_rotation):
                return
            self._base_rotation = rotation
            self._todo = [first, *(name for name in self.methods.names if name != first)]
            self._changed.notify_all()
        self.begin()

    def settle(self, timeout: float = 60.0) -> bool:
        """Wait until all maps belong to the last base orientation; False when that took too long [s]."""
        with self._changed:
            return self._changed.wait_for(lambda: self._error is not None or not (self._fits or self._todo), timeout)

    def close(self, timeout: float | None = None) -> None:
        """End the thread after the present fit; wait for that, at most so long [s]."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join(timeout)

    def _work(self) -> None:
        try:
            if self.before is not None:
                self.before()
            while (name := self._next()) is not None:
                fitted = self.methods.fit(name, self._base_rotation)
                with self._changed:
                    self._maps[name], self._fits = fitted, False
                    self._changed.notify_all()
        except Exception as error:  # noqa: BLE001 - raised again by `maps`
            with self._changed:
                self._error, self._fits = error, False
                self._changed.notify_all()

    def _next(self) -> str | None:
        """Wait for a method to fit; None when closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or bool(self._todo))
            if self._closed:
                return None
            self._fits = True
            return self._todo.pop(0)
