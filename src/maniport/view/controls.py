"""A control's value, taken only when it is one that the control can have: what a browser sends may be anything."""

from collections.abc import Callable, Sequence
from typing import Any

from maniport.view.door import Door


class Control:
    """A control of the page whose value can be relied on.

    Parameters
    ----------
    handle : viser.GuiInputHandle
        Of the control.
    allowed : callable
        Says whether a value is one that the control can have.
    door : Door
        Logs what is refused.
    """

    def __init__(self, handle: Any, allowed: Callable[[Any], bool], door: Door):
        self.handle, self._allowed, self._door = handle, allowed, door
        self._good = handle.value

    @property
    def value(self) -> Any:
        """The newest value that the control can have; others are taken back on the page."""
        value = self.handle.value
        if self._allowed(value):
            self._good = value
        else:
            self._door.refuse("a value was", f"{str(value)[:80]!r} is nothing that this control has")
            self.handle.value = self._good
        return self._good

    @value.setter
    def value(self, value: Any) -> None:
        self._good = value
        self.handle.value = value


def choice(handle: Any, options: Sequence[str], door: Door) -> Control:
    """A control that takes one of some names."""
    return Control(handle, lambda value: value in options, door)


def switch(handle: Any, door: Door) -> Control:
    """A control that is on or off."""
    return Control(handle, lambda value: isinstance(value, bool), door)


def slider(handle: Any, low: float, high: float, door: Door) -> Control:
    """A control that takes numbers within bounds."""
    return Control(handle, lambda value: isinstance(value, (int, float)) and low <= value <= high, door)
