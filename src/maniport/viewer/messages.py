"""Messages of browsers: those that the page itself sends, with numbers that can be used.

viser prints tracebacks of other ones, and any program of this machine can connect to the page.
"""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeGuard

from maniport.util.optional import optional_package

if TYPE_CHECKING:
    from viser import GuiInputHandle

VECTORS = {"wxyz": 4, "position": 3, "look_at": 3, "up_direction": 3}
"""Numbers of a camera message, and how many each has."""
SCALARS = "fov", "near", "far", "image_height", "image_width"
LARGEST = 1e9
"""Largest number of a camera message [m, pixels]; far clipping planes are at 1000 m by default."""


def accepted(message: object, controls: Mapping[str, "GuiInputHandle"]) -> bool:
    """Return whether a message is of the page: its camera, or a value that a control can have.

    Parameters
    ----------
    message : bytes or str
        As it was received.
    controls : mapping
        viser's handles of the controls by their identifiers.
    """
    if not isinstance(message, bytes):
        return False
    msgpack = optional_package("msgspec.msgpack", "view", "the live view")
    try:
        content = msgpack.decode(message)
    except (ValueError, RecursionError):  # msgspec's errors are `ValueError`
        return False
    if not isinstance(content, dict):
        return False
    kind = content.pop("type", None)
    if kind == "ViewerCameraMessage":
        return _is_camera(content)
    if kind == "GuiUpdateMessage":
        return _is_update(content, controls)
    return False


def _is_camera(content: Mapping[str, object]) -> bool:
    """Return whether the view has a size, a direction and an angle; a window may have no height for a moment."""
    if content.keys() != {*VECTORS, *SCALARS}:
        return False
    for name, size in VECTORS.items():
        vector = content[name]
        if not isinstance(vector, list) or len(vector) != size:
            return False
        if not all(_is_number(value) for value in vector):
            return False
    for name in SCALARS:
        value = content[name]
        if not _is_number(value) or value <= 0:
            return False
    return content["wxyz"] != [0, 0, 0, 0]


def _is_update(content: Mapping[str, object], controls: Mapping[str, "GuiInputHandle"]) -> bool:
    """Return whether the control exists, and can have the value."""
    if content.keys() != {"uuid", "updates"}:
        return False
    identifier = content["uuid"]
    updates = content["updates"]
    if not isinstance(identifier, str) or identifier not in controls:
        return False
    if not isinstance(updates, dict) or updates.keys() != {"value"}:
        return False
    control = controls[identifier]
    value = updates["value"]
    if isinstance(control.value, bool):  # check boxes and buttons
        return isinstance(value, bool)
    if hasattr(control, "options"):
        return isinstance(value, str) and value in control.options
    if hasattr(control, "step"):
        return (
            _is_number(value) and control.min - control.step <= value <= control.max + control.step
        )
    return False


def _is_number(value: object) -> TypeGuard[float]:
    """Return whether a value is a finite number of usual size."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) and abs(value) <= LARGEST
