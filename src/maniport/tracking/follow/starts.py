"""Where to begin: of the configurations that come near the motion somewhere, the one that leads through it best."""

import numpy as np
from numpy.typing import NDArray

from maniport.steps import Part, between, counted, nobody
from maniport.tracking.follow.follower import Follower
from maniport.tracking.objective import Targets
from maniport.tracking.schedule import Schedule
from maniport.tracking.search.descent import descend, postures_along
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array

ANCHORS = (0.0, 0.5, 1.0)
"""Where on the motion postures are searched for: one that suits its end may begin it far from the best one there."""
SEARCHES = 96
"""Samples of the bank to descend from, at each anchor."""
CANDIDATES = 8
"""Distinct results that rehearse the motion, of each anchor."""
APART = 0.3
"""Configurations closer than this in every joint count as one [rad or m]."""
REHEARSAL_STEPS = 200
SWEEP_EACH = 5
"""Every so many steps of the rehearsal are points of the sweep from posture to posture."""
SEARCHING, REHEARSALS = 3000, 36
"""Control steps and rehearsals that take as long as the search for starts and their rehearsal, roughly."""
BRISK, CLEARLY = 3.0, 0.95
"""The smaller damping of the ellipsoid task that is tried too, and the share of the cost it must fall below."""
FINALISTS = 8
"""At most so many follow the motion in full: until none is left that did better in rehearsal than the best in full."""


def follow_from_best_start(
    follower: Follower, bank: StartBank, schedule: Schedule, tell: Part = nobody
) -> tuple[Array, NDArray[np.bool_]]:
    """Follow a schedule from a start of its own choice; see `Follower.follow`.

    Ellipsoid and position are searched for from many samples of the bank, at the beginning, the middle and the end of
    the motion. The best few distinct postures rehearse the motion at a coarse rate, from their anchor back to the
    beginning and, after another search there, to the end; so does the beginning of the best motion from posture to
    posture. The best of them follow it in full, since some meet a dead end that they missed in rehearsal; the one with
    the least mean of the follower's objective is it.
    """
    objective, rehearsal = follower.objective, schedule.thinned(REHEARSAL_STEPS)
    targets, rehearsed = schedule.targets(objective), rehearsal.targets(objective)
    searched = search_steps(schedule) / (search_steps(schedule) + len(schedule))
    begun: list[Array] = []
    for anchor in counted(ANCHORS, len(ANCHORS), between(tell, 0.0, 0.4 * searched)):
        row = round(anchor * (len(rehearsal) - 1))
        here = rehearsal[row : row + 1]
        near = bank.starts(here.ellipsoids, here.positions, SEARCHES)[0]
        postures = _distinct(*_descended(rehearsed[row : row + 1], near))
        way_back = rehearsal[slice(row, None, -1)]
        begun += [follower.follow(q, way_back)[0][-1] if row else q for q in postures[:CANDIDATES]]
    sweep = rehearsal[::SWEEP_EACH]
    first = bank.starts(sweep.ellipsoids[:1], None if sweep.positions is None else sweep.positions[:1], SEARCHES)
    begun.append(postures_along(sweep.targets(objective), first)[0][0, 0])
    starts = _distinct(*_descended(targets[:1], np.array(begun)))
    costs = [
        _mean_cost(rehearsed, follower.follow(q, rehearsal)[0])
        for q in counted(starts, len(starts), between(tell, 0.5 * searched, searched))
    ]
    best, least, told = None, np.inf, searched
    for i in np.argsort(costs, kind="stable")[:FINALISTS]:
        if best is not None and least <= costs[i]:
            break
        half_left = 0.5 * (told + 1.0)  # nobody knows how many will follow it in full
        followed = follower.follow(starts[i], schedule, between(tell, told, half_left))
        told = half_left
        cost = _mean_cost(targets, followed[0])
        if best is None or cost < least:
            best, least = followed, cost
    assert best is not None
    return best


def search_steps(schedule: Schedule) -> int:
    """How many control steps take as long as the search for a start, roughly."""
    return SEARCHING + REHEARSALS * min(len(schedule), REHEARSAL_STEPS)


def follow_more_briskly(
    follower: Follower, followed: tuple[Array, NDArray[np.bool_]], schedule: Schedule, tell: Part = nobody
) -> tuple[Array, NDArray[np.bool_]]:
    """Follow again with less damping, and keep what comes clearly nearer.

    Much damping lags behind what is within reach; little damping makes the arm restless beside what is not, and lose
    its path. Which of the two a motion is shows when it has been followed.
    """
    usual, targets = follower.task.lm_damping, schedule.targets(follower.objective)
    follower.task.lm_damping = BRISK
    again = follower.follow(followed[0][0], schedule, tell)
    follower.task.lm_damping = usual
    return again if _mean_cost(targets, again[0]) < CLEARLY * _mean_cost(targets, followed[0]) else followed


def _mean_cost(targets: Targets, q: Array) -> float:
    return float(targets.cost(q).mean())


def _descended(target: Targets, starts: Array) -> tuple[Array, Array]:
    """Configurations (k, dof) near one target from those given, and the roots of their costs (k,)."""
    targets = target[np.zeros(len(starts), np.intp)]
    found = descend(targets, starts[:, None], 1e-6, 100)
    return found, targets.evaluate(found)[0]


def _distinct(configurations: Array, costs: Array) -> list[Array]:
    """Configurations without those that are close to a better one, best first."""
    distinct: list[Array] = []
    for q in configurations[np.argsort(costs, kind="stable")]:
        if all(np.abs(q - other).max() > APART for other in distinct):
            distinct.append(q)
    return distinct
