"""Maps of the live view: every method of transfer, fitted again when the base orientation changes."""

import threading
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from maniport.arms import VELOCITY, Arm
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.evaluation.comparison import with_feasible_set
from maniport.motion import SeedBank
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.util.validation import Array

LOADED = "adapter file"  # Name of an adapter that was given fitted


@dataclass(frozen=True, eq=False)
class LiveMap:
    """One method's map at one base orientation, for one ellipsoid at a time."""

    base_rotation: Array  # Rotation from the person's trunk frame to the robot's base frame, shape (3, 3)
    transform: Callable[[Array], Array]  # Maps one ellipsoid (3, 3); raises NotSPDError where it has no image
    turn: Array  # rotation of ellipsoids and of the hand's path, shape (3, 3)
    notes: tuple[str, ...] = ()  # Warnings of the fit


class Maps:
    """The newest map of each method; a thread fits them again when the base orientation changes."""

    def __init__(
        self,
        teacher: Array,  # domain (n, 3, 3) of the person's arm
        student: Array,  # domain (m, 3, 3) of the robot
        damping: float | None = 0.01,
        eigenvalue_floor: float | None = None,
        loaded: DomainAdapter | None = None,
        robot: Arm | None = None,
        bank: SeedBank | None = None,
        base_rotation: Array | None = None,
        first: Iterable[str] = (),  # methods that are fitted at once
    ):
        self._domains, self._robot, self._loaded = (teacher, student), (robot, VELOCITY, bank), loaded
        self._options = {"damping": damping, "eigenvalue_floor": eigenvalue_floor, "random_state": 0}
        self.names = (*([] if loaded is None else [LOADED]), *METHODS)
        self._wanted = np.eye(3) if base_rotation is None else base_rotation
        self._order = list(self.names)
        self._fitted = {name: self.fit(name, self._wanted) for name in first}
        self._error: Exception | None = None
        self._closed, self._changed = False, threading.Condition()
        self._thread = threading.Thread(target=self._work, name="fits of the live view", daemon=True)
        self.before: Callable[[], None] | None = None  # called by the thread before its first fit

    def fit(self, name: str, base_rotation: Array) -> LiveMap:
        """Fit a method at a base orientation, shape (3, 3)."""
        if name == LOADED and self._loaded is not None:
            note = "it keeps the base orientation of its fit"
            return LiveMap(base_rotation, self._loaded.compiled(), self._loaded.map_rotation_, (note,))
        adapter = with_feasible_set(method_of(name, **self._options, base_rotation=base_rotation), *self._robot)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            adapter.fit(*self._domains)
        notes = tuple(str(warning.message) for warning in caught if issubclass(warning.category, ManiportWarning))
        return LiveMap(base_rotation, adapter.compiled(), adapter.map_rotation_, notes)

    @property
    def fitted(self) -> dict[str, LiveMap]:
        """The newest map of each method; raises the error of a fit."""
        with self._changed:
            if self._error is not None:
                raise self._error
            return dict(self._fitted)

    def want(self, base_rotation: Array, first: str) -> None:
        """Request maps at a base orientation, that of the method `first` before the others; returns at once."""
        with self._changed:
            if np.array_equal(base_rotation, self._wanted):
                return
            self._wanted, self._order = base_rotation, [first, *(name for name in self.names if name != first)]
            self._changed.notify_all()
        self.begin()

    def begin(self) -> None:
        """Start the thread."""
        with self._changed:
            if self._thread.ident is None:
                self._thread.start()

    def settle(self, timeout: float = 60.0) -> bool:
        """Wait until all maps belong to the last base orientation; False when that took too long [s]."""
        with self._changed:
            return self._changed.wait_for(lambda: self._error is not None or self._next() is None, timeout)

    def close(self, timeout: float | None = None) -> None:
        """End the thread after the present fit; wait for that, at most so long [s]."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join(timeout)

    def _next(self) -> str | None:
        """Return a method without a map at the present base orientation."""
        for name in self._order:
            if name not in self._fitted or not np.array_equal(self._fitted[name].base_rotation, self._wanted):
                return name
        return None

    def _work(self) -> None:
        try:
            if self.before is not None:
                self.before()
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: self._closed or self._next() is not None)
                    name, rotation = self._next(), self._wanted
                    if self._closed or name is None:
                        return
                fitted = self.fit(name, rotation)
                with self._changed:
                    self._fitted[name] = fitted
                    self._changed.notify_all()
        except Exception as error:  # noqa: BLE001 - raised again by `fitted`
            with self._changed:
                self._error = error
                self._changed.notify_all()


def require_drawable(adapter: DomainAdapter) -> None:
    """Raise unless an adapter maps ellipsoids in space."""
    d = len(adapter.teacher_mean_)
    if d != 3:
        raise InvalidInputError(f"the adapter maps {d}×{d} ellipsoids; the live view shows 3×3 ones")
