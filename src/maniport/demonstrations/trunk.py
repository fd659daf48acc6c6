"""The trunk frame: the base in which the arm is fitted (x forward, y left, z up of the trunk, not of the room)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.demonstrations.recording import Recording
from maniport.demonstrations.roles import role_position
from maniport.errors import RecordingError

Array = NDArray[np.float64]


def trunk_rotation(recording: Recording, roles: dict[str, Any]) -> Array:
    """Rotation from the trunk frame to the axes of the recording, in every frame.

    z is ``trunk_up`` (from low to high on the spine). Where points at the front are there, x is ``trunk_front`` (from
    the back to the front) made orthogonal to z, so that the plane of symmetry is that of spine and breastbone and
    shrugging one shoulder does not turn it. Otherwise y is ``trunk_left`` (from right to left shoulder) made orthogonal
    to z. The third axis is the cross product.

    Returns
    -------
    ndarray, shape (n_frames, 3, 3)
        Columns x, y, z; nan where one of the points is missing.

    Raises
    ------
    RecordingError
        When the two directions are parallel in every frame.
    """
    up = _unit(_direction(recording, roles["trunk_up"]))
    second = "trunk_front" if "trunk_front" in roles else "trunk_left"
    across = _direction(recording, roles[second])
    across = across - np.sum(across * up, axis=-1, keepdims=True) * up
    across = _unit(across)
    columns = (across, np.cross(up, across), up) if second == "trunk_front" else (np.cross(across, up), across, up)
    rotation = np.stack(columns, axis=-1)
    if np.isnan(rotation).any(axis=(1, 2)).all():
        raise RecordingError(
            f"no trunk frame in {recording.source!r}: in no frame are the points of trunk_up {roles['trunk_up']} and "
            f"{second} {roles[second]} all seen, apart from each other and not in one line"
        )
    return rotation


def _direction(recording: Recording, pair: Any) -> Array:
    return role_position(recording, pair[1]) - role_position(recording, pair[0])


def _unit(vector: Array) -> Array:
    """Scale to length one; nan where the length is below a tenth of a millimetre."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector / np.where(length > 1e-4, length, np.nan))
