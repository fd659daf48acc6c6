"""Thresholds of what a transfer method does badly, and the recommendation among compared methods.

A method is *sound* without any of the weaknesses below. Of the sound methods (of all, where none is) the first in the
order of `maniport.transfer.METHODS` is recommended whose mean feasibility gap of the profile no other undercuts by more
than 5 %. Where the truth is known, the root mean squared error decides alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from maniport.evaluation.measures import STILL
from maniport.evaluation.rows import LOOKUP, TRANSPORT, Row
from maniport.transfer import METHODS
from maniport.transfer.lengths.report import AXIS_MOVED, LEAST_STRUCTURE

WORTH_WHILE = 0.95
"""A measure must fall below this fraction of another's to count as better."""

EQUAL = 1e-9
"""Relative difference up to which two methods do the same."""

ROUGH = 1.5
"""A largest step of more than this times the teacher's own is a weakness."""

RESTLESS = 0.15
"""Root mean squared change of the student's own ellipsoids above which the identity test is failed."""

UNSTEADY = 5.0
"""Spread of the rotation over draws [degrees, root mean square] above which the domains do not determine it."""


@dataclass(frozen=True)
class Weakness:
    """Something that an adapter does badly, whatever its gaps.

    Attributes
    ----------
    code : {"rough", "staircase", "shuffled", "turned", "restless", "unsteady"}
        Largest step over the teacher's own; median step where the teacher moves; rank correlation of distances; turn of
        the longest axes [degrees]; change in the identity test; spread of the rotation over draws [degrees].
    value, threshold : float
        What was measured, and from where on it is a weakness.
    beside : float or None
        The same of parallel transport, for the identity test.

    See Also
    --------
    Verdict : lists those of an adapter.
    """

    code: str
    value: float
    threshold: float
    beside: float | None = None


def weaknesses(row: Row, beside: Sequence[Row] = ()) -> list[Weakness]:
    """List what a method does badly, whatever its gaps; parallel transport is looked up among the rows `beside`."""
    found, steps, kept = [], row.smoothness, row.structure
    if steps is not None and steps.largest_ratio > ROUGH:
        found.append(Weakness("rough", steps.largest_ratio, ROUGH))
    if steps is not None and steps.median <= STILL:
        found.append(Weakness("staircase", steps.median, STILL))
    if kept is not None and kept.spearman < LEAST_STRUCTURE:
        found.append(Weakness("shuffled", kept.spearman, LEAST_STRUCTURE))
    if kept is not None and kept.major_turn is not None and kept.major_turn > AXIS_MOVED:
        found.append(Weakness("turned", kept.major_turn, AXIS_MOVED))
    if row.identity is not None and row.identity > RESTLESS:
        other = next((one.identity for one in beside if one.name == TRANSPORT and one is not row), None)
        found.append(Weakness("restless", row.identity, RESTLESS, other))
    if row.stability is not None and row.stability.rotation_rms > UNSTEADY:
        found.append(Weakness("unsteady", row.stability.rotation_rms, UNSTEADY))
    return found


def sound(row: Row) -> bool:
    """Whether a method has no weakness and fails no check of its fit."""
    return not (weaknesses(row) or row.failures)


def recommended(rows: Sequence[Row], values: Mapping[str, float], measure: str) -> str:
    """Return the name of the method to take; empty where nothing is compared."""
    names = {row.name: row.method if row.method in METHODS else row.name for row in rows if row.name in values}
    own, order = names.get(rows[0].name), list(METHODS)
    offered = {
        names[row.name]: row
        for row in reversed(rows)
        if row.name in names and (names[row.name] in METHODS or names[row.name] == own)
    }
    if measure != "rmse":
        offered.pop(LOOKUP, None)
    if not offered:
        return ""
    ranked = sorted(offered, key=lambda name: order.index(name) if name in order else len(order))
    if measure != "rmse":
        ranked = [name for name in ranked if sound(offered[name])] or ranked
    reached = {name: values[offered[name].name] for name in ranked}
    best = min(reached.values())
    return next(name for name, value in reached.items() if WORTH_WHILE * value <= best or equal(value, best))


def equal(value: float, other: float) -> bool:
    """Whether two measures are the same but for rounding."""
    return abs(value - other) <= EQUAL * max(abs(value), abs(other))
