"""One frame in, joint positions out: a person's arm leads a robot's while it moves."""

import math
import os
from collections.abc import Callable, Mapping
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.bodies.collisions import Collisions
from maniport.defaults import DAMPING
from maniport.demonstrations import ArmFit
from maniport.errors import InvalidInputError, NotSPDError
from maniport.live.clock import MotionClock
from maniport.live.frame import as_frame
from maniport.live.moment import HOLDING, Moment
from maniport.live.person import Person, Posture
from maniport.live.preparation import require_kinds, require_size, warm_up
from maniport.live.robot import Robot, suiting
from maniport.live.standing import Standing
from maniport.pipeline import TransferResult
from maniport.steps import Progress, Step
from maniport.tracking import MotionLimits, PlacedPath, PlanControl
from maniport.tracking.plan.plan_control import require_free
from maniport.transfer import DomainAdapter
from maniport.validation import LATEST, Array, as_count, as_number, require_shape

LONGEST_STEP = 0.01
"""A longer time between two frames is shared among several control steps [s]."""
UNSEEN, LONGEST_HOLD = 0.1, 10.0
"""After so long without a frame that can be used the robot brakes; the longest that may be asked for [s]."""
LEAN_AFTER = 0.05
"""How often the posture to stay near is looked up [s]."""
CATCHING_UP = 0.3
"""Share of the velocity limits that is used to get to where the person's arm is."""
Target = tuple[Array, Array | None]
"""Ellipsoid (d, d) and place of the tip (3,) [m]."""


class Live:
    """A robot that follows a person, frame by frame.

    `step` finds the person's arm in a frame, maps its ellipsoid with a fitted adapter, and moves the robot towards that
    ellipsoid, and its tip towards where the hand is in the placed path, within the limits of the joints and without
    collisions, whatever the frames say. Where the person is not seen or leaps, the robot brakes and rests; it gets back
    when the person is seen again. Threads may each use an instance of their own, but must not share one.

    The robot moves for the time that passes on this machine between two steps, whatever times the frames have: its
    commands keep the limits when they are sent as they are returned. With ``clock=None`` it moves for the time between
    two frames: simulated time, for recordings. The same frames then give the same motion.

    Parameters
    ----------
    person : ArmFit
        Of a recording of this person with these points (`maniport.fit_arm`): lengths, side, roles.
    adapter : DomainAdapter
        Fitted.
    robot : Arm
    path : PlacedPath, optional
        Where the path of a hand was placed before the robot; `maniport.tracking.place_path`, or that of a result.
        Without it the robot follows the ellipsoids alone.
    spec : EllipsoidSpec
        Which ellipsoids the adapter maps.
    motion_limits, collisions
        As in `maniport.tracking.PlanControl`.
    start : array_like, shape (dof,), optional
        Where the robot is, at rest. Default: a posture that suits the first frame of `person`.
    reference : array_like, shape (n, dof), optional
        Postures of the robot that suit the person's, such as those of a plan: it stays near the one that suits best.
        Without them it may get lost at limits of its joints.
    hold_after : float
        After so many seconds without a frame that can be used the robot brakes, at most 10 [s]; it must be longer than
        the time between two frames.
    clock : callable or None
        Returns the time on this machine [s]. None: simulated time; commands keep the limits only when they are sent at
        the times of their frames.
    random_state : int
        Seed of the search for a start.
    progress : callable, optional
        Called as ``progress(step, fraction)``; `maniport.progress` prints bars.

    Attributes
    ----------
    points : tuple of str
        Names of the points that a frame has, in their order.
    robot : Arm
        Within its limits.

    Raises
    ------
    InvalidInputError
        When an argument does not fit another, or the start is beyond limits or collides.
    NotFittedError
        When the adapter is not fitted.

    See Also
    --------
    Moment, STATES, maniport.pipeline.transfer_recording
    """

    def __init__(
        self,
        person: ArmFit,
        adapter: DomainAdapter,
        robot: Arm,
        *,
        path: PlacedPath | None = None,
        spec: EllipsoidSpec = VELOCITY,
        motion_limits: MotionLimits | str | os.PathLike[str] | Mapping[str, Any] | None = None,
        collisions: Collisions | bool = True,
        start: ArrayLike | None = None,
        reference: ArrayLike | None = None,
        hold_after: float = UNSEEN,
        clock: Callable[[], float] | None = monotonic,
        random_state: int = 0,
        progress: Progress | None = None,
    ):
        require_kinds(person, adapter, robot, spec, path)
        as_count(random_state, "random_state", minimum=0)
        self._hold_after = as_number(hold_after, "hold_after [s]", above=0.0, maximum=LONGEST_HOLD)
        own_clock, prepare = MotionClock(clock), Step(progress, "prepare live control")
        self._person, self._map, self._spec, self._path = Person(person), adapter.compiled(), spec, path
        require_size(adapter, spec)
        if path is not None:  # an affine map is known by where it takes zero and the axes
            self._turn, self._origin = spec.rotation(path.rotation), path.apply(np.zeros(3))
            self._axes = path.apply(np.eye(3)) - self._origin
        ready = PlanControl(motion_limits=motion_limits, collisions=collisions).resolved(robot)
        limits, apart = ready.motion_limits, ready.collisions
        assert isinstance(limits, MotionLimits)
        self._apart = apart if isinstance(apart, Collisions) else None
        own = adapter.student_regularization
        damping = own if own.epsilon > 0.0 and spec.kind != "force" else DAMPING
        self.points, self.robot = self._person.points, limits.arm
        if start is None:
            first = self._aimed(person.joint_angles[0])[1]
            start = suiting(limits.arm, spec.velocity, damping, *first, self._apart, random_state)
        q = np.clip(require_free(start, "start", limits, self._apart), limits.lower, limits.upper)
        near = None if reference is None else limits.arm.require_within_limits(reference, "reference")
        if near is not None:
            require_shape(near, "reference", ("n", limits.arm.dof), " with n ≥ 1")
        self._robot = Robot(limits, self._apart, spec.velocity, damping, q, path is not None, near)
        self._reset(MotionClock(None))
        warm_up(self.step, len(self.points), self._hold_after, prepare)
        self._reset(own_clock)
        self._robot.rest(q)
        prepare.end()

    def _reset(self, clock: MotionClock) -> None:
        """Forget all frames."""
        self._clock = clock
        self._time: float | None = None
        self._last_seen, self._seen_at = -np.inf, -np.inf
        self._posture: Posture | None = None
        self._target: Target | None = None
        self._demonstrated: Array | None = None
        self._standing, self._leant = Standing(), -np.inf

    @classmethod
    def of(cls, result: TransferResult, **options: Any) -> "Live":
        """Let the person of a result lead its robot: with its adapter, placement, limits and first posture.

        Parameters
        ----------
        result : TransferResult
        **options
            As of `Live`, instead of what the result has.
        """
        if not isinstance(result, TransferResult):
            raise InvalidInputError(f"result must be a TransferResult; found {type(result).__name__}")
        known: dict[str, Any] = {"spec": result.spec, "random_state": result.random_state}
        if (execution := result.execution) is not None:
            known |= {"path": execution.placement, "motion_limits": execution.plan.limits}
            known |= {"collisions": execution.collisions or False, "reference": execution.plan.joint_positions}
            known |= {"start": execution.plan.joint_positions[0]}
        return cls(result.fit, result.adapter, result.robot, **{**known, **options})

    def __repr__(self) -> str:
        apart = "" if self._apart is None else ", kept from collisions"
        who = f"{self._person.arm.name!r} leads {self.robot.name!r}"
        return f"Live({who}, {len(self.points)} points, {self._standing.state}{apart})"

    @property
    def joint_positions(self) -> Array:
        """Where the robot is, before the first frame too, shape (dof,) [rad or m]."""
        return self._robot.q.copy()

    def step(self, points: ArrayLike | Mapping[str, ArrayLike] | None, time: float | None = None) -> Moment:
        """Take a frame, and move the robot for the time since the last step.

        Parameters
        ----------
        points : array_like, shape (n, 3), mapping or None
            Where `Live.points` are, in any unit and right-handed axes, since directions count alone; nan for a point
            that is not seen. A mapping by name may lack some. None: no frame came.
        time : float, optional
            When the points were measured, by any clock; later than in all frames before [s]. Default: now.

        Raises
        ------
        InvalidInputError
            When a name is not in `points`, shapes are wrong, values infinite, or the time is not later, or missing in
            simulated time. Nothing has moved then.
        """
        positions = as_frame(points, self.points)
        if time is not None:
            time = as_number(time, "time [s]", minimum=-LATEST, maximum=LATEST)
        elif positions is not None:
            time = self._clock.read()
        if self._time is not None and time is not None and not time > self._time:
            raise InvalidInputError(f"time must be later than {self._time!r} s, the last frame's; found {time!r}")
        elapsed, rested = self._clock.begin_step(time), self._robot.resting
        self._time = self._time if time is None else time
        before, seen = self._target, positions is not None and time is not None and self._saw(positions, time)
        self._move(before, seen, elapsed)
        self._clock.end_step(rested and self._robot.resting)
        return self._moment()

    def _saw(self, positions: Array, now: float) -> bool:
        """Whether the person's arm is seen in a frame and does not leap; then it leads."""
        targets, before, dt = self._person.seen(positions), self._posture, now - self._last_seen
        if targets is None or (before is not None and self._person.leaps(before, targets, dt)):
            return False
        if before is None or self._standing.state == HOLDING or dt > self._hold_after:
            found = self._person.begin(targets, None if before is None else before.q)
        else:
            found = self._person.follow(before, targets, dt)
            if self._person.hurries(before, found, dt):
                return False
        try:
            self._demonstrated, self._target = self._aimed(found.q)
        except NotSPDError:  # a flat ellipsoid, which an adapter without damping does not map
            return False
        self._posture, self._last_seen, self._seen_at = found, now, self._clock.now
        return True

    def _aimed(self, angles: Array) -> tuple[Array, Target]:
        """Demonstrated ellipsoid, and what the robot is asked for, for joint angles of the person."""
        demonstrated, hand = self._person.hand(angles, self._spec)
        target = self._map(demonstrated)
        if self._spec.kind == "force":
            target = np.asarray(np.linalg.inv(target))
        if self._path is None:
            return demonstrated, (target, None)
        turned = self._turn @ target @ self._turn.T
        return demonstrated, (0.5 * (turned + turned.T), hand @ self._axes + self._origin)

    def _move(self, before: Target | None, seen: bool, elapsed: float) -> None:
        """Move the robot for the time that has elapsed [s], at the end of which a frame was `seen` or not."""
        if elapsed == 0.0:
            return
        if self._target is None:
            self._robot.brake(elapsed)
            return
        lost = elapsed > self._hold_after or self._clock.now - self._seen_at > self._hold_after
        if lost or (self._standing.state == HOLDING and not seen):
            self._brake(elapsed)
            return
        self._standing.go()
        self._follow(before or self._target, elapsed)
        self._standing.judge(self._clock.now, self._off_path(), self._distance)

    def _brake(self, elapsed: float) -> None:
        self._standing.hold()
        for _ in range(count := _steps(elapsed)):
            self._robot.brake(elapsed / count)
            if self._robot.resting:
                break

    def _follow(self, before: Target, elapsed: float) -> None:
        """Share the way from the target before to the new one among control steps."""
        assert self._target is not None
        (first, there), (last, place) = before, self._target
        if self._clock.now - self._leant > LEAN_AFTER:
            self._robot.lean(last, place)
            self._leant = self._clock.now
        count, share = _steps(elapsed), CATCHING_UP if self._standing.approaching else 1.0
        for i in range(1, count + 1):
            part, was, here = i / count, there, place
            if place is not None and before[1] is not None:
                here = before[1] + part * (place - before[1])
            ellipsoid = last if i == count else first + part * (last - first)
            self._robot.follow(ellipsoid, here, was, elapsed / count, share)
            there = here

    def _off_path(self) -> float | None:
        """How far the tip is from its place [m]; None where it has none."""
        if self._target is None or self._target[1] is None:
            return None
        way = self._robot.makes()[0] - self._target[1]
        return math.sqrt(way @ way)

    def _distance(self) -> float:
        """How far the ellipsoid is from its target."""
        assert self._target is not None
        return self._robot.distance(self._target[0], self._robot.makes()[1])

    def _moment(self) -> Moment:
        robot, (tip, achieved) = self._robot, self._robot.makes()
        return Moment(
            time=self._clock.state_time,
            state=self._standing.state,
            joint_positions=robot.q.copy(),
            joint_velocities=robot.velocity.copy(),
            achieved=achieved,
            tip=tip,
            person=None if self._posture is None else self._posture.q,
            demonstrated=self._demonstrated,
            target=None if self._target is None else self._target[0],
            distance=None if self._target is None else self._distance(),
            tip_error=self._off_path(),
        )


def _steps(elapsed: float) -> int:
    """Control steps that share a time [s]."""
    return max(1, int(np.ceil(elapsed / LONGEST_STEP - 1e-9)))
