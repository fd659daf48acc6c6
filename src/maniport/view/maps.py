"""The maps that the live view switches between: every method of transfer, fitted anew when the mounting changes."""

import threading
import time as clock
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.bodies import VELOCITY, Arm
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.feasibility import knowing
from maniport.tracking import StartBank
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
    robot : Arm, optional
        The student, for methods that ask what it can make.
    bank : StartBank, optional
        Its samples. Default: some that are drawn for each fit.

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
        robot: Arm | None = None,
        bank: StartBank | None = None,
    ):
        self._teacher, self._student = teacher, student
        self._robot = robot, VELOCITY, bank
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
        adapter = knowing(method_of(method, **self._options | variation, mounting=rotation), *self._robot)
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


class Refitting:
    """Keeps a map of each method, and fits them anew when the mounting changes.

    A thread of its own does the work: first the method that is looked at, then the others. A mounting that is no
    longer wanted is dropped; while the mounting is dragged, the method that is looked at keeps up.

    Parameters
    ----------
    methods : Methods
    mounting : ndarray, shape (3, 3)
        The first one.
    first : sequence of str, optional
        Methods that are fitted before the object is there; the thread fits the others, from `begin` on. Default: all.
    """

    def __init__(self, methods: Methods, mounting: Array, first: Sequence[str] | None = None):
        self.methods = methods
        self._mounting = as_rotation(mounting, "mounting", 3)
        at_once = methods.names if first is None else first
        self._maps = {name: methods.fit(name, self._mounting) for name in at_once}
        self._todo: list[str] = [name for name in methods.names if name not in at_once]
        self._busy = self._closed = False
        self._error: Exception | None = None
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self.before: Callable[[], None] | None = None

    @property
    def maps(self) -> Mapping[str, LiveMap]:
        """The newest map of each method; raises what a fit raised."""
        with self._changed:
            if self._error is not None:
                raise self._error
            return dict(self._maps)

    @property
    def busy(self) -> bool:
        """Whether a fit is under way."""
        with self._changed:
            return self._busy or bool(self._todo)

    def begin(self) -> None:
        """Let the thread do what is left: `before`, where it is set, then the methods that are not fitted yet."""
        with self._changed:
            if self._thread is None and (self._todo or self.before):
                self._start()

    def want(self, mounting: Array, first: str) -> None:
        """Ask for maps at a mounting, that of `first` before the others; returns at once."""
        rotation = as_rotation(mounting, "mounting", 3)
        as_choice(first, "first", self.methods.names)
        with self._changed:
            if np.array_equal(rotation, self._mounting):
                return
            self._mounting = rotation
            self._todo = [first, *(name for name in self.methods.names if name != first)]
            if self._thread is None:
                self._start()
            self._changed.notify_all()

    def settle(self, timeout: float = 60.0) -> bool:
        """Wait until all maps belong to the mounting that is wanted; False when that took too long [s]."""
        with self._changed:
            return self._changed.wait_for(lambda: self._error is not None or not (self._busy or self._todo), timeout)

    def close(self, timeout: float | None = None) -> None:
        """End the thread after the fit that it is at; wait for that, at most so long [s]."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join(timeout)

    def _start(self) -> None:
        self._thread = threading.Thread(target=self._work, name="refitting", daemon=True)
        self._thread.start()

    def _work(self) -> None:
        try:
            if self.before is not None:
                self.before()
        except Exception as error:  # noqa: BLE001 - raised again where the maps are asked for
            self._error = error
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or bool(self._todo))
                if self._closed:
                    return
                name, mounting, self._busy = self._todo.pop(0), self._mounting, True
            found: LiveMap | None = None
            try:
                found = self.methods.fit(name, mounting)
            except Exception as error:  # noqa: BLE001 - raised again where the maps are asked for
                self._error = error
            with self._changed:
                self._busy = False
                if found is not None:
                    self._maps[name] = found
                self._changed.notify_all()
