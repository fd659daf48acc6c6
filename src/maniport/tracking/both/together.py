"""One motion of both arms, from what each does alone: refined in slow time, then timed."""

from collections.abc import Callable, Iterator

import numpy as np

from maniport.steps import Part
from maniport.tracking.both.mirror import Apart, Image
from maniport.tracking.both.parting import parted
from maniport.tracking.both.planner import ArmsPlanner
from maniport.tracking.both.targets import BothTargets
from maniport.tracking.effort import as_effort
from maniport.tracking.motion_limits import MotionLimits
from maniport.tracking.plan.control import PlanControl
from maniport.tracking.plan.pace import SHARE_OF_SPEED, near_enough, paced
from maniport.tracking.plan.plan import Course, Request, slowness
from maniport.tracking.plan.planner import QUICKEST, ROUGH_WEIGHTS, SLOW
from maniport.tracking.plan.refinement import CLEAR, Asked, KeptApart, PosturesOnPaths, motion_cost, refine
from maniport.tracking.plan.retiming import Timed, retime
from maniport.validation import Array

SHARE = 0.1
"""Of the usual smoothness of motions in slow time."""
AWAY = (1.0, 3.0, np.inf)
"""How many times farther than allowed tips may be from their paths, in turn, until nothing collides."""


def together(
    planner: ArmsPlanner,
    requests: list[Request],
    courses: list[Course],
    image: Image | None,
    relative: bool,
    random: np.random.Generator,
    tell: Part,
) -> tuple[Timed, bool]:
    """One motion of both, and whether it was refined as one."""
    settings, limits, apart = requests[0].settings, planner.limits, planner.collisions
    ways = [one.q for one in courses]
    (left, since, _), (right, *_) = (one.finer(own.limits) for one, own in zip(requests, planner.each, strict=True))

    def others() -> list[Array]:
        """What else may be begun with, where all else collides."""
        if planner.arms.shared or apart is None or left.positions is None:
            return []
        return parted(planner, (left, right), slowness(settings) * since, ways, random)

    if relative:  # images stay images by themselves
        tell(0.1)
        between = BothTargets.relative(planner.arms, (left, right))
        return _refined(limits, between, apart, since, _starts(planner, ways), settings, others), True
    if image is None:
        starts = _starts(planner, ways)
    else:
        alone = image.within(planner.each[1].limits)
        starts = [image.pair(np.clip(ways[1], alone.lower, alone.upper))]
    near = apart is not None and apart.between.known and bool(np.any(apart.between.clearance(starts[0]) < CLEAR))
    if not (planner.arms.shared or near):
        fineness = as_effort(settings.effort).fineness
        return retime(limits, since / settings.tempo, starts[0], rate=settings.rate, fineness=fineness), False
    tell(0.1)
    if image is None:
        both = BothTargets(planner.arms, (left, right))
        return _refined(limits, both, apart, since, starts, settings, others), True
    targets = requests[1].finer(alone)[0]
    own = None if apart is None else Apart(image, apart)
    only = [q[:, planner.arms.columns[1]] for q in starts]
    timed = image.both(_refined(alone, targets, own, since, only, settings))
    if apart is not None and apart.collides(timed.positions).any():  # one of them has to make way
        return together(planner, requests, courses, None, relative, random, tell)
    return timed, True


def _refined(
    limits: MotionLimits,
    targets: PosturesOnPaths,
    apart: KeptApart | None,
    since: Array,
    starts: list[Array],
    settings: PlanControl,
    others: Callable[[], list[Array]] = list,
) -> Timed:
    """Refine the best of some motions and time it; where it collides, of others, too, and then with tips off paths."""
    slow, effort = slowness(settings) * since, as_effort(settings.effort)
    most = np.minimum(SHARE_OF_SPEED * limits.velocity, [QUICKEST[unit] for unit in limits.arm.joint_units])
    asked = Asked(SLOW.times(SHARE), velocity=most, collisions=apart, enough=effort.enough)
    begun: list[Array] = []
    for farther, more in _tries(starts, others):
        begun += [refine(targets, slow, q, asked, ROUGH_WEIGHTS[:1]) for q in more]
        best = min(begun, key=lambda q: motion_cost(targets, slow, q, asked))
        tolerance = farther * settings.tip_tolerance
        q = near_enough(targets, slow, best, asked, tolerance).q
        timed = paced(
            limits, apart, targets, since / settings.tempo, q, tolerance, settings.rate, effort.fineness
        ).timed
        if apart is None or not apart.collides(timed.positions).any():
            break
    return timed


def _tries(starts: list[Array], others: Callable[[], list[Array]]) -> Iterator[tuple[float, list[Array]]]:
    """How many times farther than allowed tips may be from their paths, and from what else to begin, in turn."""
    yield AWAY[0], starts
    if more := others():
        yield AWAY[0], more
    for farther in AWAY[1:]:
        yield farther, []


def _starts(planner: ArmsPlanner, courses: list[Array]) -> list[Array]:
    """Postures of both as each arm has them by itself; shared joints amid both, as the left has them, or the right."""
    arms = planner.arms
    q = np.empty((len(courses[0]), arms.dof))
    for course, columns in zip(courses, arms.columns, strict=True):
        q[:, columns] = course
    if not arms.shared:
        return [q]
    shared = np.intersect1d(*arms.columns)
    of_left, of_right = (
        course[:, [int(np.flatnonzero(columns == i)[0]) for i in shared]]
        for course, columns in zip(courses, arms.columns, strict=True)
    )
    found = []
    for share in (0.5, 1.0, 0.0):
        found.append(q.copy())
        found[-1][:, shared] = share * of_left + (1.0 - share) * of_right
    return found
