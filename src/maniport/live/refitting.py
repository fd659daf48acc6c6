"""Maps of all methods at the mounting that is wanted last, fitted beside the loop that draws."""

import threading
from collections.abc import Mapping

import numpy as np

from maniport.live.maps import LiveMap, Methods
from maniport.validation import Array, as_choice, as_rotation


class Refitting:
    """Keeps a map of each method, and fits them anew when the mounting changes.

    A thread of its own does the work: first the method that is looked at, then the others. A mounting that is no
    longer wanted is dropped; while the mounting is dragged, the method that is looked at keeps up.

    Parameters
    ----------
    methods : Methods
    mounting : ndarray, shape (3, 3)
        The first one; all methods are fitted with it before the object is there.
    """

    def __init__(self, methods: Methods, mounting: Array):
        self.methods = methods
        self._mounting = as_rotation(mounting, "mounting", 3)
        self._maps = {name: methods.fit(name, self._mounting) for name in methods.names}
        self._todo: list[str] = []
        self._busy = self._closed = False
        self._error: Exception | None = None
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

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
                self._thread = threading.Thread(target=self._work, name="refitting", daemon=True)
                self._thread.start()
            self._changed.notify_all()

    def settle(self, timeout: float = 60.0) -> bool:
        """Wait until all maps belong to the mounting that is wanted; False when that took too long [s]."""
        with self._changed:
            return self._changed.wait_for(lambda: self._error is not None or not (self._busy or self._todo), timeout)

    def close(self) -> None:
        """End the thread, after the fit that it is at."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join()

    def _work(self) -> None:
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
