"""What counts of how an arm's tip is turned."""

import math

from maniport.validation import as_choice

POINTING, WHOLE = "pointing", "whole"
"""What is kept of the tip's orientation: where its z axis points, along a gripper's fingers mostly, or all of it."""
ORIENTATION_WEIGHT = 10.0
"""What a radian counts for: 6° as much as a distance of 1 between ellipsoids [1/rad]."""


def axis_weights(keep: str, weight: float = ORIENTATION_WEIGHT) -> tuple[float, float, float]:
    """What a radian between each axis of the tip and where it shall point counts for [1/rad]."""
    if as_choice(keep, "keep", (POINTING, WHOLE)) == POINTING:
        return 0.0, 0.0, weight
    return (weight / math.sqrt(2.0),) * 3
