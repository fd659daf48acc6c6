"""An arm follows a profile of ellipsoids, and a path where there is one.

A loop over control steps: in each, Pink's inverse kinematics weighs a `ManipulabilityEllipsoidTask`, a `PositionTask`,
a weak pull to the starting posture and what tasks the user adds, within limits of position, velocity and acceleration.
The tip goes before the ellipsoid, as the costs have it.

On one core of a shared 2-core machine the loop ran at 6 kHz for the Panda with path and limits, BLAS restricted to one
thread while it runs (by threadpoolctl); the search for a start took about two seconds for six seconds of motion.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.defaults import DAMPING
from maniport.errors import InvalidInputError
from maniport.steps import Part, Progress, Step, between, counted, nobody, pieces
from maniport.tracking.arm_model import require_trackable
from maniport.tracking.follow.follower import Control, Follower
from maniport.tracking.follow.track_result import TrackResult, in_words
from maniport.tracking.objective import Damping, Objective, Targets
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


def track(
    arm: Arm,
    profile: ArrayLike,
    *,
    time: ArrayLike,
    path: ArrayLike | None = None,
    start: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    weights: ArrayLike | None = None,
    rotations: ArrayLike | None = None,
    bank: StartBank | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> TrackResult:
    """Move an arm so that its velocity ellipsoids follow target ones, and its tip a target path.

    A profile or path that the arm cannot follow is no error: the result says where and by how much. Where a step has
    no answer, the arm is brought to rest and tries again. How it works: `maniport.tracking.follow.tracker`.

    Parameters
    ----------
    arm : Arm
        With at least three joints, and a joint for each degree of freedom.
    profile : array_like, shape (n, d, d)
        Target velocity ellipsoids in the arm's base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Increasing [s].
    path : array_like, shape (n, 3), optional
        Target positions of the tip in the base frame [m].
    start : array_like, shape (dof,), optional
        First configuration. Default: the first of the reference, or else the best of several, found by rehearsals.
    reference : array_like, shape (n, dof), optional
        Joint positions to stay near [rad or m], such as a plan's, in what the path and the ellipsoids leave open.
    spec : EllipsoidSpec
        Which ellipsoids, of velocity.
    damping : float or Regularization
        Added to the eigenvalues of all ellipsoids before they are compared; more than nothing, since an arm passes
        singular postures. A number is relative to the arm's mean eigenvalue: `maniport.tracking.objective.as_damping`.
    weights : array_like, shape (n, m, m), optional
        How much each direction of the ellipsoids counts, see `ManipulabilityEllipsoidTask`; m = d (d + 1) / 2.
    rotations : array_like, shape (n, 3, 3), optional
        How the tip shall be turned in the base frame; see `keep` and `orientation_weight`.
    bank : StartBank, optional
        To find the start with, made for this arm and these ellipsoids. Default: one of 16 384 samples (0.1 s).
    random_state, progress : optional
        Seed of the bank; called with the name of a step and the fraction done.
    **control
        How: rate, interpolation, velocity_limits, acceleration_limits, gain, lm_damping, position_cost, keep,
        orientation_weight, and tasks and limits of Pink's own; see `maniport.tracking.Control`.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong shape or value, the start lies outside the limits, the arm has fewer than three
        joints or coupled ones, or the bank was made for another arm.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.

    See Also
    --------
    TrackResult : what comes out.
    """
    settings = Control(**control)
    require_trackable(arm, spec)
    objective = Objective.of(arm, spec, damping, settings.position_cost, positive=True)
    objective = objective.keeping(settings.keep, settings.orientation_weight)
    asked = Schedule.checked(objective, profile, time, path, weights, rotations, reference)
    begin = _as_start(arm, asked.postures[0] if start is None and asked.postures is not None else start)
    follower = Follower(objective, settings)
    if begin is None:
        bank = StartBank.given_or_built(bank, arm, spec, random_state)
    step = Step(progress, "move the robot")
    schedule = asked.sampled(objective, settings.rate, settings.interpolation)
    joints, held = _followed(follower, schedule, begin, bank, step)
    result = _judged(follower, asked, schedule, joints, held)
    step.end(in_words(result))
    return result


def _followed(
    follower: Follower, schedule: Schedule, begin: Array | None, bank: StartBank | None, step: Part
) -> tuple[Array, NDArray[np.bool_]]:
    """Joint positions and where the arm was held: from a start, or the best one; with less damping too, as it pays."""
    steps, chooses = len(schedule), follower.control.lm_damping is None
    first, again = pieces(step, steps + (begin is None) * _search_steps(schedule), chooses * steps)
    if begin is not None:
        followed = follower.follow(begin, schedule, first)
    else:
        assert bank is not None
        followed = _follow_from_best_start(follower, bank, schedule, first)
    return _follow_more_briskly(follower, followed, schedule, again) if chooses else followed


def _judged(
    follower: Follower, asked: Schedule, schedule: Schedule, joints: Array, held: NDArray[np.bool_]
) -> TrackResult:
    """What became of what was asked."""
    objective = follower.objective
    result = TrackResult.of_motion(
        objective.arm, asked.time, asked.ellipsoids, schedule.time, joints, spec=objective.spec,
        damping=objective.damping, path=asked.positions, velocity_limits=follower.velocity_limits, held=held,
    )  # fmt: skip
    return replace(result, orientation_error=asked.targets(objective).axis_angles(result.joint_positions))


def _as_start(arm: Arm, start: ArrayLike | None) -> Array | None:
    if start is None:
        return None
    q = arm.require_within_limits(start, "start")
    if q.ndim != 1:
        raise InvalidInputError(f"start must be one configuration, shape ({arm.dof},); found shape {q.shape}")
    return np.clip(q, arm.lower, arm.upper)


def _follow_from_best_start(
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
    searched = _search_steps(schedule) / (_search_steps(schedule) + len(schedule))
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


def _search_steps(schedule: Schedule) -> int:
    """How many control steps take as long as the search for a start, roughly."""
    return SEARCHING + REHEARSALS * min(len(schedule), REHEARSAL_STEPS)


def _follow_more_briskly(
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
