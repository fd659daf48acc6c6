"""Motions of two arms: each planned by itself, both refined together where they meet, and timed as one."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, ArmGroup, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.both.planned_arms import PlannedArms
from maniport.motion.both.planner import ArmsPlanner, as_arms, two
from maniport.motion.both.together import PLACED, RELATIVE, BothTargets, floors_of, together
from maniport.motion.follow.joint_motion import JointMotion
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import EXACT_WEIGHT, Damping, Objective
from maniport.motion.plan.home_motion import with_approach
from maniport.motion.plan.plan_control import PlanControl
from maniport.motion.plan.plan_motion import (
    POINTWISE_POINTS,
    PlanRequest,
    TimedPath,
    evaluated,
    pointwise_improved,
)
from maniport.motion.plan.planned_motion import Room
from maniport.motion.plan.time_parameterization import Timed
from maniport.motion.search.pointwise import interpolated_distance
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step, between, pieces
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array, as_choice, as_generator


def plan_arms(
    arms: ArmGroup,
    profiles: Sequence[ArrayLike],
    *,
    time: ArrayLike,
    paths: Sequence[ArrayLike] | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    rotations: Sequence[ArrayLike] | None = None,
    tips: str = PLACED,
    planner: ArmsPlanner | None = None,
    pointwise_bests: Sequence[ArrayLike] | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> PlannedArms:
    """Plan a motion of two arms whose velocity ellipsoids come near to target ones, with their end effectors on paths.

    Each arm is planned as by `plan_motion`, as if joints that move both were its alone. Where there are such joints, or
    the arms come within 15 mm of one another, the postures are then refined for both at once, apart from one another;
    else they stay those of each arm alone. One time is found for both, as by `plan_motion` for one.

    Parameters
    ----------
    arms : ArmGroup
    profiles : two of array_like, shape (n, d, d)
        Target velocity ellipsoids of the left and of the right arm in their common frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Demonstrated times, increasing [s].
    paths : two of array_like, shape (n, 3), optional
        Target positions of the end effectors in that frame [m].
    spec, damping, random_state, progress
        As in `plan_motion`, for each arm.
    rotations : two of array_like, shape (n, 3, 3), optional
        Target orientations, as in `plan_motion`.
    tips : {"placed", "relative"}
        Whether the end effectors follow their paths, or only keep the vector between them; the arms of the result then
        have no paths.
    planner : ArmsPlanner, optional
        A planner of these arms, ellipsoids and limits. Default: a new one.
    pointwise_bests : two of array_like, shape (n,), optional
        The pointwise optima, where they are known. Default: they are searched.
    **control
        As in `plan_motion`; limits, collisions and the home configuration are for the joints of both arms.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong shape or value.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.
    """
    settings, generator, pair = PlanControl(**control), as_generator(random_state), as_arms(arms)
    if planner is not None:
        planner.require_fits(pair, spec)
    settings = settings.resolved(pair, planner)
    given = {"profiles": profiles, "paths": paths, "rotations": rotations, "pointwise_bests": pointwise_bests}
    requests = _requests(pair, settings, time, spec, damping, given)
    relative = _relative(tips, paths)
    step = Step(progress, "Plan trajectory of both arms")
    if planner is None:
        assert isinstance(settings.motion_limits, MotionLimits)
        planner = ArmsPlanner.of(settings.motion_limits, spec, settings.collisions, deepcopy(generator))
    parts = pieces(between(step, 0.2, 0.7), 1.0, 1.0)
    courses = [
        request.planned(own, deepcopy(generator), part)
        for request, own, part in zip(requests, planner.each, parts, strict=True)
    ]
    timed, joined = together(planner, requests, courses, relative, generator, between(step, 0.7, 0.9))
    timed = replace(timed, at=timed.at[requests[0].finer(planner.limits)[3]])
    if settings.home is not None:
        timed = with_approach(timed, planner.limits, settings.home)
    step.end(requests[0].duration_text(timed))
    step = Step(progress, "Evaluate trajectory of both arms")
    result = _judged(planner, requests, courses, timed, joined, relative)
    step.end()
    return result


def _relative(tips: str, paths: Sequence[ArrayLike] | None) -> bool:
    """Whether the way from tip to tip is kept alone."""
    found = as_choice(tips, "tips", (PLACED, RELATIVE)) == RELATIVE
    if found and paths is None:
        raise InvalidInputError("tips='relative' keeps the way from path to path; give the paths of both arms")
    return found


def _requests(
    pair: ArmGroup, settings: PlanControl, time: ArrayLike, spec: EllipsoidSpec, damping: Damping, given: dict[str, Any]
) -> list[PlanRequest]:
    """What is asked of each arm, checked."""
    requests = []
    columns = [two(value, name) for name, value in given.items()]
    for arm, meant, (profile, path, turned, floor) in zip(
        pair.each, pair.specs(spec), zip(*columns, strict=True), strict=True
    ):
        objective = Objective.of(arm, meant, damping, EXACT_WEIGHT, positive=True)
        objective = objective.keeping(settings.orientation_axes, settings.orientation_weight)
        requests.append(PlanRequest.of(settings, objective, profile, time, path, None, turned, floor))
    if (requests[0].asked.positions is None) != (requests[1].asked.positions is None):
        raise InvalidInputError("paths must be of both arms or of none")
    return requests


def _judged(
    planner: ArmsPlanner,
    requests: list[PlanRequest],
    courses: list[TimedPath],
    timed: Timed,
    joined: bool,
    relative: bool,
) -> PlannedArms:
    """What became of it."""
    arms, sides, way, beside = planner.arms, [], None, None
    if relative:
        requests, courses, way, beside = _released(planner, requests, courses, timed.waypoints())
    for request, course, own, columns in zip(requests, courses, planner.each, arms.columns, strict=True):
        mine = replace(
            timed,
            positions=timed.positions[:, columns],
            velocities=timed.velocities[:, columns],
            accelerations=timed.accelerations[:, columns],
            deviation=timed.deviation[columns],
        )
        pointwise = course.pointwise
        if joined and request.pointwise is None:
            pointwise = pointwise_improved(request.targets(own.limits), mine.waypoints(), pointwise)
        sides.append(evaluated(request, mine, own.limits, own.collisions, pointwise))
    motion = JointMotion(
        arms.joint_names,
        arms.joint_units,
        timed.at,
        timed.waypoints(),
        timed.time,
        timed.positions,
        timed.velocities,
        timed.accelerations,
    )
    return PlannedArms(
        **{one.name: getattr(motion, one.name) for one in fields(JointMotion)},
        arms=arms,
        left=sides[0],
        right=sides[1],
        limits=planner.limits,
        limit_use=planner.limits.use(timed.time, timed.positions),
        room=Room.of(planner.collisions, motion),
        together=joined,
        way=way,
        beside_way=beside,
    )


def _released(
    planner: ArmsPlanner, requests: list[PlanRequest], courses: list[TimedPath], q: Array
) -> tuple[list[PlanRequest], list[TimedPath], Array, Array]:
    """What was asked for without paths, floors of both in sum, the way from tip to tip."""
    left, right = (one.targets(own.limits) for one, own in zip(requests, planner.each, strict=True))
    both = BothTargets.relative(planner.arms, (left, right))
    assert both.way is not None
    rows = evenly_spaced(len(both), POINTWISE_POINTS)
    unturned = (replace(both.each[0][rows], rotations=None), replace(both.each[1][rows], rotations=None))
    lowest = replace(both[rows], each=unturned)
    floors = [
        interpolated_distance(rows, one, len(both))
        for one in floors_of(lowest, [one.bank for one in planner.each], [q[rows]])
    ]
    return (
        [
            replace(one, asked=replace(one.asked, positions=None), pointwise=floor)
            for one, floor in zip(requests, floors, strict=True)
        ],
        [replace(one, pointwise=floor) for one, floor in zip(courses, floors, strict=True)],
        both.way,
        np.linalg.norm(both.beside(q), axis=1),
    )
