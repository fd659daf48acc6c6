"""Where to begin: of the configurations that come near the first ellipsoid, the one that leads on best."""

import numpy as np

from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.matrix_functions import apply, roots, symmetrize
from maniport.tracking.descent import Target, descend
from maniport.tracking.follower import Follower, Schedule
from maniport.tracking.start_bank import StartBank
from maniport.validation import Array

SEARCHES = 96
"""Samples of the bank to descend from."""
CANDIDATES = 12
"""Distinct results that rehearse the motion."""
APART = 0.3
"""Configurations closer than this in every joint count as one [rad or m]."""
REHEARSAL_STEPS = 100


def best_start(follower: Follower, bank: StartBank, schedule: Schedule, floor: float) -> Array:
    """First configuration of a motion, shape (dof,).

    The ellipsoid and the hand position to begin with are searched for from many samples of the bank. The best few
    postures rehearse the motion at a coarse rate; the one with the least mean of d² + (position_cost · |error|)² is it.
    """
    candidates = _candidates(follower, bank, schedule, floor)
    rehearsal = _thinned(schedule)
    costs = [_following_cost(follower, q, rehearsal, floor) for q in candidates]
    return np.asarray(candidates[int(np.argmin(costs))])


def _candidates(follower: Follower, bank: StartBank, schedule: Schedule, floor: float) -> list[Array]:
    wanted = symmetrize(schedule.ellipsoids[:1] + floor * np.eye(schedule.ellipsoids.shape[-1]))
    hand = None if schedule.hands is None else schedule.hands[:1]
    # What is positive-definite with this floor may not be so with the bank's.
    own = apply(schedule.ellipsoids[:1], lambda values: np.maximum(values, 0.0))
    starts = bank.query(own, hand, SEARCHES)[0]
    count = len(starts)
    target = Target(
        arm=follower.arm,
        options={"part": follower.task.part, "joint_weights": follower.task.joint_weights},
        force=False,
        floor=floor,
        whitening=np.repeat(roots(wanted)[1], count, axis=0),
        hands=None if hand is None else np.repeat(hand, count, axis=0),
        weight=follower.position_cost,
    )
    found = descend(target, starts[:, None], 1e-6, 100)
    cost = target.evaluate(found)[0]
    distinct: list[Array] = []
    for q in found[np.argsort(cost, kind="stable")]:
        if all(np.abs(q - other).max() > APART for other in distinct):
            distinct.append(q)
        if len(distinct) == CANDIDATES:
            break
    return distinct


def _following_cost(follower: Follower, start: Array, schedule: Schedule, floor: float) -> float:
    arm, task = follower.arm, follower.task
    joints, _ = follower.follow(start, schedule)
    own = arm.manipulability(joints, part=task.part, joint_weights=task.joint_weights)
    lift = floor * np.eye(own.shape[-1])
    cost = distance_unchecked(symmetrize(schedule.ellipsoids + lift), symmetrize(own + lift)) ** 2
    if schedule.hands is not None:
        away = arm.forward(joints)[:, :3, 3] - schedule.hands
        cost += follower.position_cost**2 * np.sum(away**2, axis=1)
    return float(cost.mean())


def _thinned(schedule: Schedule) -> Schedule:
    """The same motion in fewer control steps."""
    each = max(1, (len(schedule.time) - 1) // REHEARSAL_STEPS)
    rows = slice(0, None, each)
    return Schedule(
        schedule.time[rows],
        schedule.ellipsoids[rows],
        None if schedule.hands is None else schedule.hands[rows],
        None if schedule.weights is None else schedule.weights[rows],
    )
