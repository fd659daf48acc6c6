"""What a fitted adapter is, in a line for its prompt."""

from typing import Any

import numpy as np

from maniport.transfer.rotation_group import rotation_angle


def is_fitted(adapter: Any) -> bool:
    """Whether a fit has come to its end; its last attribute tells."""
    return hasattr(adapter, "released_damping_")


def in_a_line(adapter: Any) -> str:
    """Tell how the fit went: rotation, scale, why it ended, and what the clouds know."""
    found = getattr(adapter, "identifiability_", None)
    return "; ".join(
        [
            f"turns by {_degrees(adapter.turn_)}, s = {adapter.dispersion_ratio_:.3g}",
            adapter.stop_reason_,
            *([] if found is None else [found.in_words()]),
        ]
    )


def _degrees(rotation: np.typing.NDArray[np.float64]) -> str:
    return f"{np.degrees(rotation_angle(np.eye(len(rotation)), rotation)):.1f}°"
