"""Where to begin: of the configurations that come near the motion somewhere, the one that leads through it best."""

import numpy as np
from numpy.typing import NDArray

from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.matrix_functions import roots, symmetrize
from maniport.steps import Part, between, counted, nobody
from maniport.tracking.follow.follower import Follower, Schedule
from maniport.tracking.search.descent import Target, descend
from maniport.tracking.search.postures import postures_along
from maniport.tracking.search.start_bank import StartBank, semidefinite
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
    follower: Follower, bank: StartBank, schedule: Schedule, floor: float, tell: Part = nobody
) -> tuple[Array, NDArray[np.bool_]]:
    """Follow a schedule from a start of its own choice; see `Follower.follow`.

    Ellipsoid and hand position are searched for from many samples of the bank, at the beginning, the middle and the
    end of the motion. The best few distinct postures rehearse the motion at a coarse rate, from their anchor back to
    the beginning and, after another search there, to the end; so does the beginning of the best motion from posture to
    posture. The best of them follow it in full, since some meet a
    dead end that they missed in rehearsal; the one with the least mean of d² + (position_cost · |error|)² is it.
    """
    rehearsal = _thinned(schedule)
    searched = search_steps(schedule) / (search_steps(schedule) + len(schedule.time))
    begun: list[Array] = []
    for anchor in counted(ANCHORS, len(ANCHORS), between(tell, 0.0, 0.4 * searched)):
        row = round(anchor * (len(rehearsal.time) - 1))
        way_back, wanted = _rows(rehearsal, slice(row, None, -1)), _rows(rehearsal, slice(row, row + 1))
        near = bank.query(semidefinite(wanted.ellipsoids), wanted.hands, SEARCHES)[0]
        postures = _distinct(*_descended(follower, near, wanted, floor))
        begun += [follower.follow(q, way_back)[0][-1] if row else q for q in postures[:CANDIDATES]]
    begun.append(_first_of_a_sweep(follower, bank, _rows(rehearsal, slice(None, None, SWEEP_EACH)), floor))
    starts = _distinct(*_descended(follower, np.array(begun), _rows(schedule, slice(0, 1)), floor))
    rehearsed = [
        _cost(follower, follower.follow(q, rehearsal)[0], rehearsal, floor)
        for q in counted(starts, len(starts), between(tell, 0.5 * searched, searched))
    ]
    best, least, told = None, np.inf, searched
    for i in np.argsort(rehearsed, kind="stable")[:FINALISTS]:
        if best is not None and least <= rehearsed[i]:
            break
        half_left = 0.5 * (told + 1.0)  # nobody knows how many will follow it in full
        followed = follower.follow(starts[i], schedule, between(tell, told, half_left))
        told = half_left
        cost = _cost(follower, followed[0], schedule, floor)
        if best is None or cost < least:
            best, least = followed, cost
    assert best is not None
    return best


def search_steps(schedule: Schedule) -> int:
    """How many control steps take as long as the search for a start, roughly."""
    return SEARCHING + REHEARSALS * min(len(schedule.time), REHEARSAL_STEPS)


def follow_more_briskly(
    follower: Follower,
    followed: tuple[Array, NDArray[np.bool_]],
    schedule: Schedule,
    floor: float,
    tell: Part = nobody,
) -> tuple[Array, NDArray[np.bool_]]:
    """Follow again with less damping, and keep what comes clearly nearer.

    Much damping lags behind what is within reach; little damping makes the arm restless beside what is not, and lose
    its path. Which of the two a motion is shows when it has been followed.
    """
    usual = follower.task.lm_damping
    follower.task.lm_damping = BRISK
    again = follower.follow(followed[0][0], schedule, tell)
    follower.task.lm_damping = usual
    costs = [_cost(follower, joints, schedule, floor) for joints in (again[0], followed[0])]
    return again if costs[0] < CLEARLY * costs[1] else followed


def _first_of_a_sweep(follower: Follower, bank: StartBank, motion: Schedule, floor: float) -> Array:
    """Where the best motion from posture to posture begins; see `postures_along`."""
    target = _target(follower, motion, floor, np.arange(len(motion.time)))
    own = semidefinite(motion.ellipsoids[:1])
    hands = None if motion.hands is None else motion.hands[:1]
    return np.asarray(postures_along(target, bank.query(own, hands, SEARCHES))[0][0, 0])


def _target(follower: Follower, motion: Schedule, floor: float, rows: NDArray[np.intp]) -> Target:
    """What is wanted at some rows of a schedule, ellipsoid and hand."""
    ellipsoids = motion.ellipsoids[rows]
    raised = symmetrize(ellipsoids + floor * np.eye(ellipsoids.shape[-1]))
    return Target(
        arm=follower.arm,
        options={"part": follower.task.part, "joint_weights": follower.task.joint_weights},
        force=False,
        floor=floor,
        whitening=roots(raised)[1],
        hands=None if motion.hands is None else motion.hands[rows],
        weight=follower.position_cost,
    )


def _descended(follower: Follower, starts: Array, wanted: Schedule, floor: float) -> tuple[Array, Array]:
    """Configurations (k, dof) near one ellipsoid and hand position from those given, and their costs (k,)."""
    target = _target(follower, wanted, floor, np.zeros(len(starts), np.intp))
    found = descend(target, starts[:, None], 1e-6, 100)
    return found, target.evaluate(found)[0]


def _distinct(configurations: Array, costs: Array) -> list[Array]:
    """Configurations without those that are close to a better one, best first."""
    distinct: list[Array] = []
    for q in configurations[np.argsort(costs, kind="stable")]:
        if all(np.abs(q - other).max() > APART for other in distinct):
            distinct.append(q)
    return distinct


def _cost(follower: Follower, joints: Array, schedule: Schedule, floor: float) -> float:
    arm, task = follower.arm, follower.task
    own = arm.manipulability(joints, part=task.part, joint_weights=task.joint_weights)
    lift = floor * np.eye(own.shape[-1])
    cost = distance_unchecked(symmetrize(schedule.ellipsoids + lift), symmetrize(own + lift)) ** 2
    if schedule.hands is not None:
        away = arm.forward(joints)[:, :3, 3] - schedule.hands
        cost += follower.position_cost**2 * np.sum(away**2, axis=1)
    return float(cost.mean())


def _thinned(schedule: Schedule) -> Schedule:
    """The same motion in fewer control steps, evenly spaced."""
    count = len(schedule.time)
    each = max(1, (count - 1) // REHEARSAL_STEPS)
    return _rows(schedule, slice((count - 1) % each, None, each))


def _rows(schedule: Schedule, rows: slice) -> Schedule:
    return Schedule(
        schedule.time[rows],
        schedule.ellipsoids[rows],
        None if schedule.hands is None else schedule.hands[rows],
        None if schedule.weights is None else schedule.weights[rows],
    )
