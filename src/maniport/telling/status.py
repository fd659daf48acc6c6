"""Status of a result, and the thresholds of its warnings."""

from collections.abc import Collection

from maniport.tracking.plan import giving_way

GREEN, AMBER, RED = "green", "amber", "red"
"""No warning; warnings to read before the motion runs; a motion that must not run."""

RED_WARNINGS = frozenset({"collision", "limits-exceeded", "held", "constraints-violated"})
"""Keys of the warnings that make a result red. Every other warning makes it amber."""

POSITION_FACTOR = giving_way.FAR
"""The largest position error may be this many times the tolerance, which is for the 95th percentile."""

AXIS_ANGLE = 30.0
"""Largest median angle between the longest axes of target and achieved ellipsoids [degrees]."""

# The thresholds for limits of the human model are in `maniport.demonstrations.data_quality`, those for single
# ellipsoids in `maniport.tracking.follow.status`, because the fit and the tracker need them, too.


def status_of(keys: Collection[str]) -> str:
    """Return the status of a result whose warnings have these keys."""
    if RED_WARNINGS & set(keys):
        return RED
    return AMBER if keys else GREEN
