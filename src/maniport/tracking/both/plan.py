"""Motions of two arms: each planned by itself, both refined together where they meet, and timed as one."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arms, EllipsoidSpec
from maniport.defaults import DAMPING
from maniport.errors import InvalidInputError
from maniport.steps import Part, Progress, Step, between, pieces
from maniport.subsample import evenly_spaced
from maniport.tracking.both.mirror import Image
from maniport.tracking.both.planned_arms import PlannedArms
from maniport.tracking.both.planner import ArmsPlanner, as_arms, two
from maniport.tracking.both.targets import PLACED, RELATIVE, BothTargets, floors_of
from maniport.tracking.both.together import together
from maniport.tracking.follow.joint_motion import JointMotion
from maniport.tracking.follow.track_result import in_words
from maniport.tracking.motion_limits import MotionLimits
from maniport.tracking.objective import EXACT_WEIGHT, Damping, Objective
from maniport.tracking.plan.approach import with_approach
from maniport.tracking.plan.control import PlanControl
from maniport.tracking.plan.plan import FLOOR_POINTS, Course, Request, floor_below, joints_at, judged
from maniport.tracking.plan.refinement import CLEAR
from maniport.tracking.plan.retiming import Timed
from maniport.tracking.plan.room import Room
from maniport.tracking.search.node_floor import floor_between
from maniport.validation import Array, as_choice, as_generator

AS_CLEAR = 1e-4
"""An image comes as near to what is around it where it comes nearer by no more than this [m]."""


def plan_arms(
    arms: Arms,
    profiles: Sequence[ArrayLike],
    *,
    time: ArrayLike,
    paths: Sequence[ArrayLike] | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    rotations: Sequence[ArrayLike] | None = None,
    tips: str = PLACED,
    planner: ArmsPlanner | None = None,
    node_floors: Sequence[ArrayLike] | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> PlannedArms:
    """Plan a motion of two arms whose velocity ellipsoids come near to target ones, with their tips on paths.

    Each arm is planned as by `plan_motion`, as if joints that move both were its alone. Where there are such joints, or
    the arms come within 15 mm of one another, the postures are then refined for both at once, apart from one another;
    else they stay those of each arm alone. One time is found for both, as by `plan_motion` for one. Where the arms are
    images of one another in the plane of x and z, and so is what they are asked for, one is planned and the other moves
    as its image, unless something is in its way alone or both would collide.

    Parameters
    ----------
    arms : Arms
    profiles : two of array_like, shape (n, d, d)
        Target velocity ellipsoids of the left and of the right arm in their common frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        The person's, increasing [s].
    paths : two of array_like, shape (n, 3), optional
        Target positions of the tips in that frame [m].
    spec, damping, random_state, progress
        As in `plan_motion`, for each arm.
    rotations : two of array_like, shape (n, 3, 3), optional
        How the tips shall be turned, as in `plan_motion`.
    tips : {"placed", "relative"}
        Whether both tips are on their paths, or have the same way between them as these, and go where the arms make the
        ellipsoids better; the arms of the result then have no paths.
    planner : ArmsPlanner, optional
        One that was made for these arms, ellipsoids and limits. Default: a new one.
    node_floors : two of array_like, shape (n,), optional
        Where they are known already. Default: they are searched for.
    **control
        As in `plan_motion`; limits, collisions and the home posture are for the joints of both arms.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong shape or value.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.

    See Also
    --------
    PlannedArms : what comes out.
    """
    settings, generator, pair = PlanControl(**control), as_generator(random_state), as_arms(arms)
    if planner is not None:
        planner.require_fits(pair, spec)
    settings = settings.resolved(pair, planner)
    given = {"profiles": profiles, "paths": paths, "rotations": rotations, "node_floors": node_floors}
    requests = _requests(pair, settings, time, spec, damping, given)
    relative = _relative(tips, paths)
    step = Step(progress, "plan the motion of both arms")
    if planner is None:
        assert isinstance(settings.motion_limits, MotionLimits)
        planner = ArmsPlanner.of(settings.motion_limits, spec, settings.collisions, deepcopy(generator))
    image = Image.of(planner.limits, requests[0].asked, requests[1].asked, spec)
    courses, image = _courses(planner, requests, image, generator, between(step, 0.2, 0.7))
    timed, joined = together(planner, requests, courses, image, relative, generator, between(step, 0.7, 0.9))
    timed = replace(timed, at=timed.at[requests[0].finer(planner.limits)[2]])
    if settings.home is not None:
        timed = with_approach(timed, planner.limits, settings.home)
    step.end(requests[0].lasting(timed))
    step = Step(progress, "measure the motion of both arms")
    result = _judged(planner, requests, courses, timed, joined, relative)
    step.end("; ".join(f"{side}: {in_words(one)}" for side, one in zip(("left", "right"), result.each, strict=True)))
    return result


def _relative(tips: str, paths: Sequence[ArrayLike] | None) -> bool:
    """Whether the way from tip to tip is kept alone."""
    found = as_choice(tips, "tips", (PLACED, RELATIVE)) == RELATIVE
    if found and paths is None:
        raise InvalidInputError("tips='relative' keeps the way from path to path; give the paths of both arms")
    return found


def _requests(
    pair: Arms, settings: PlanControl, time: ArrayLike, spec: EllipsoidSpec, damping: Damping, given: dict[str, Any]
) -> list[Request]:
    """What is asked of each arm, checked."""
    requests = []
    columns = [two(value, name) for name, value in given.items()]
    for arm, meant, (profile, path, turned, floor) in zip(
        pair.each, pair.specs(spec), zip(*columns, strict=True), strict=True
    ):
        objective = Objective.of(arm, meant, damping, EXACT_WEIGHT, positive=True)
        objective = objective.keeping(settings.keep, settings.orientation_weight)
        requests.append(Request.of(settings, objective, profile, time, path, None, turned, floor))
    if (requests[0].asked.positions is None) != (requests[1].asked.positions is None):
        raise InvalidInputError("paths must be of both arms or of none")
    return requests


def _courses(
    planner: ArmsPlanner, requests: list[Request], image: Image | None, generator: np.random.Generator, tell: Part
) -> tuple[list[Course], Image | None]:
    """The motion of each arm by itself, and the image, where nothing that the right arm avoids less is in its way."""
    tells = pieces(tell, 1.0, 1.0)
    right = requests[1].course(planner.each[1], deepcopy(generator), tells[1])
    if image is not None:
        left = image.signs * right.q
        clear = [
            np.inf if own.collisions is None else own.collisions.clearance(q).min()
            for own, q in zip(planner.each, (left, right.q), strict=True)
        ]
        if clear[0] >= min(clear[1], CLEAR) - AS_CLEAR:
            return [replace(right, q=left), right], image
    return [requests[0].course(planner.each[0], deepcopy(generator), tells[0]), right], None


def _judged(
    planner: ArmsPlanner, requests: list[Request], courses: list[Course], timed: Timed, joined: bool, relative: bool
) -> PlannedArms:
    """What became of it."""
    arms, sides, way, beside = planner.arms, [], None, None
    if relative:
        requests, courses, way, beside = _released(planner, requests, courses, joints_at(timed))
    for request, course, own, columns in zip(requests, courses, planner.each, arms.columns, strict=True):
        mine = replace(
            timed,
            positions=timed.positions[:, columns],
            velocities=timed.velocities[:, columns],
            accelerations=timed.accelerations[:, columns],
            deviation=timed.deviation[columns],
        )
        floor = course.floor
        if joined and request.floor is None:
            floor = floor_below(request.targets(own.limits), joints_at(mine), floor)
        sides.append(judged(request, mine, own.limits, own.collisions, floor))
    motion = JointMotion(
        arms.joint_names,
        arms.joint_units,
        timed.at,
        joints_at(timed),
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
    planner: ArmsPlanner, requests: list[Request], courses: list[Course], q: Array
) -> tuple[list[Request], list[Course], Array, Array]:
    """What was asked for without paths, floors of both in sum, the way from tip to tip."""
    left, right = (one.targets(own.limits) for one, own in zip(requests, planner.each, strict=True))
    both = BothTargets.relative(planner.arms, (left, right))
    assert both.way is not None
    rows = evenly_spaced(len(both), FLOOR_POINTS)
    unturned = (replace(both.each[0][rows], rotations=None), replace(both.each[1][rows], rotations=None))
    lowest = replace(both[rows], each=unturned)
    floors = [
        floor_between(rows, one, len(both)) for one in floors_of(lowest, [one.bank for one in planner.each], [q[rows]])
    ]
    return (
        [
            replace(one, asked=replace(one.asked, positions=None), floor=floor)
            for one, floor in zip(requests, floors, strict=True)
        ],
        [replace(one, floor=floor) for one, floor in zip(courses, floors, strict=True)],
        both.way,
        np.linalg.norm(both.beside(q), axis=1),
    )
