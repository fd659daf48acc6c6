"""The rule by which methods are chosen and recommended, with its thresholds: the least that does the job.

1. A method is *sound* that has none of the weaknesses below but that it mixes up near and far: where the robot cannot
   make what would keep the order of distances, following loses it in any case, so that this is told and not forbidden.
2. A sound method *does the job* where the feasibility gap, of the profile and of held-out samples, is at most
   `FEASIBLE` in the mean and `FEASIBLE_AT_95` at 95 %: the robot can make what it is asked for.
3. Of those that do the job the first in the order of `maniport.transfer.METHODS` is taken, which changes least.
4. Where none does, the first of the sound ones that no other undercuts by more than 5 % in the mean gap of the profile.
Where the truth is known, the root mean squared error decides alone, as in 4.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from maniport.evaluation.measures import STILL
from maniport.evaluation.rows import LOOKUP, TRANSPORT, Row
from maniport.transfer import METHODS

FEASIBLE, FEASIBLE_AT_95 = 0.05, 0.25
"""Feasibility gaps, mean and 95 %, up to which the robot counts as able: one axis by 2.5 % and by 13 % off."""

WORTH_WHILE = 0.95
"""A measure must fall below this fraction of another's to count as better."""

EQUAL = 1e-9
"""Relative difference up to which two methods do the same."""

ROUGH = 1.5
"""A largest step of more than this times the teacher's own is a weakness."""

SHUFFLED = 0.95
"""A rank correlation of pairwise distances below this is one."""

TURNED = 10.0
"""A median turn of the longest axes [degrees] above this is one."""

RESTLESS = 0.15
"""Root mean squared change of the student's own ellipsoids above which the identity test is failed."""

UNSTEADY = 5.0
"""Spread of the rotation over draws [degrees, root mean square] above which the domains do not determine it."""

DOES_THE_JOB, LEAST_GAP = "does-the-job", "least-gap"
"""Why a method is taken: by 3 or by 4 above."""


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
    Choice : says of which methods there were any.
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
    if kept is not None and kept.spearman < SHUFFLED:
        found.append(Weakness("shuffled", kept.spearman, SHUFFLED))
    if kept is not None and kept.major_turn is not None and kept.major_turn > TURNED:
        found.append(Weakness("turned", kept.major_turn, TURNED))
    if row.identity is not None and row.identity > RESTLESS:
        other = next((one.identity for one in beside if one.name == TRANSPORT and one is not row), None)
        found.append(Weakness("restless", row.identity, RESTLESS, other))
    if row.stability is not None and row.stability.rotation_rms > UNSTEADY:
        found.append(Weakness("unsteady", row.stability.rotation_rms, UNSTEADY))
    return found


def sound(row: Row) -> bool:
    """Whether a method has no weakness that forbids it."""
    return all(one.code == "shuffled" for one in weaknesses(row))


def does_the_job(row: Row) -> bool:
    """Whether the robot can make what a sound method asks of it; False where that was not measured."""
    measured = [gaps for gaps in (row.feasibility_gap, row.domain_feasibility_gap) if gaps is not None]
    able = all(gaps.mean <= FEASIBLE and gaps.p95 <= FEASIBLE_AT_95 for gaps in measured)
    return bool(measured) and able and sound(row)


def recommended(rows: Sequence[Row], values: Mapping[str, float], measure: str) -> tuple[str, str]:
    """Name the method to take by the rule, and why; both empty where nothing is compared.

    Parameters
    ----------
    rows : sequence of Row
        The adapter that is asked about first. It may be any; of the others only methods in `METHODS` are offered.
    values : mapping of str to float
        The measure of every row that takes part. A lookup is never recommended for its gaps, which are none by
        construction.
    measure : {"rmse", "feasibility_gap", ""}
    """
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
        return "", ""
    ranked = sorted(offered, key=lambda name: order.index(name) if name in order else len(order))
    if measure != "rmse":
        able = [name for name in ranked if does_the_job(offered[name])]
        if able:
            return able[0], DOES_THE_JOB
        ranked = [name for name in ranked if sound(offered[name])] or ranked
    reached = {name: values[offered[name].name] for name in ranked}
    best = min(reached.values())
    return next(name for name, value in reached.items() if WORTH_WHILE * value <= best or equal(value, best)), LEAST_GAP


def equal(value: float, other: float) -> bool:
    """Whether two measures are the same but for rounding."""
    return abs(value - other) <= EQUAL * max(abs(value), abs(other))
