"""One frame in, joint positions out: a person's arm leads a robot while it moves."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError, NotSPDError
from maniport.live.clock import MotionClock
from maniport.live.frames import as_frame
from maniport.live.person import ArmEstimate, Person
from maniport.live.robot import Robot, best_start
from maniport.live.state import HOLDING, FollowState, Moment
from maniport.mocap import ArmFit
from maniport.motion import Cost, Limit, MotionLimits, Placement, PlanControl
from maniport.motion.costs.cost import as_costs
from maniport.motion.plan.plan_control import require_free
from maniport.pipeline import TransferResult
from maniport.transfer import DomainAdapter
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step
from maniport.util.validation import LATEST, Array, as_count, as_number, require_shape

CONTROL_STEP = 0.01  # A longer time between two frames is shared among several control steps [s]
Target = tuple[Array, Array | None]  # Ellipsoid (d, d) and position of the end effector (3,) [m]


class Live:
    """A robot that follows a person, frame by frame.

    `step` estimates the person's arm in a frame, maps its ellipsoid with a fitted adapter, and moves the robot towards
    that ellipsoid and the position of the hand in the placed path, within joint limits and without collisions, whatever
    the frames are. Where the person is not seen or jumps, the robot brakes and rests until the person is seen again.
    Each thread needs its own instance.

    The robot moves for the time that passes on this machine between two steps, whatever times the frames have: its
    commands keep the limits when they are sent as they are returned. With ``clock=None`` it moves for the time between
    two frames (simulated time), and the same frames give the same motion.

    Parameters
    ----------
    person : ArmFit
        Of a recording of this person with these points (`maniport.fit_arm`): lengths, side, roles.
    adapter : DomainAdapter
        Fitted.
    robot : Arm
    path : Placement, optional
        Placement of the hand's path. Without it the robot follows the ellipsoids alone.
    spec : EllipsoidSpec
        Ellipsoids of the adapter.
    motion_limits, collisions
        As in `maniport.motion.PlanControl`.
    start : array_like, shape (dof,), optional
        Configuration of the robot, at rest. Default: one that suits the first frame of `person`.
    reference : array_like, shape (n, dof), optional
        Configurations that suit the motion, such as a plan's: the robot stays near the best one. Without them it may
        get stuck at joint limits.
    hold_after : float
        Time without a usable frame after which the robot brakes, longer than that between two frames, at most 10 [s].
    clock : callable or None
        Returns the time on this machine [s]. None: simulated time; commands keep the limits at the times of frames.
    costs, limits
        As in `maniport.motion.Control`; the time of costs is that of the robot's clock.
    random_state, progress : optional
        Seed of the search for a start; as in `maniport.transfer_recording`.

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
    """

    def __init__(
        self,
        person: ArmFit,
        adapter: DomainAdapter,
        robot: Arm,
        *,
        path: Placement | None = None,
        spec: EllipsoidSpec = VELOCITY,
        motion_limits: MotionLimits | str | os.PathLike[str] | Mapping[str, Any] | None = None,
        collisions: Collisions | bool = True,
        start: ArrayLike | None = None,
        reference: ArrayLike | None = None,
        hold_after: float = 0.1,
        clock: Callable[[], float] | None = monotonic,
        costs: Sequence[Cost] = (),
        limits: Sequence[Limit] = (),
        random_state: int = 0,
        progress: Progress | None = None,
    ):
        _require_types(person=(person, ArmFit), adapter=(adapter, DomainAdapter), robot=(robot, Arm))
        _require_types(spec=(spec, EllipsoidSpec), **{} if path is None else {"path": (path, Placement)})
        as_count(random_state, "random_state", minimum=0)
        self._hold_after = as_number(hold_after, "hold_after [s]", above=0.0, maximum=10.0)
        own_clock, preparation = MotionClock(clock), Step(progress, "Prepare live control")
        self._person, self._map, self._spec, self._path = Person(person), adapter.compiled(), spec, path
        if (size := len(adapter.teacher_mean_)) != spec.size:
            raise InvalidInputError(f"adapter must map {spec.size}×{spec.size} ellipsoids; found {size}×{size}")
        if path is not None:  # an affine map is determined by its images of zero and of the axes
            self._turn, self._origin = spec.rotation(path.rotation), path.apply(np.zeros(3))
            self._axes = path.apply(np.eye(3)) - self._origin
        control = PlanControl(motion_limits=motion_limits, collisions=collisions).resolved(robot)
        bounds = control.motion_limits
        assert isinstance(bounds, MotionLimits)
        self._collisions = control.collisions if isinstance(control.collisions, Collisions) else None
        own = adapter.student_regularization
        damping = own if own.epsilon > 0.0 and spec.kind != "force" else DAMPING
        self.points, self.robot = self._person.points, bounds.arm
        if start is None:
            first = self._target_of(person.joint_angles[0])[1]
            start = best_start(bounds.arm, spec.velocity, damping, *first, self._collisions, random_state)
        q = np.clip(require_free(start, "start", bounds, self._collisions), bounds.lower, bounds.upper)
        near = None if reference is None else bounds.arm.require_within_limits(reference, "reference")
        if near is not None:
            require_shape(near, "reference", ("n", bounds.arm.dof), " with n ≥ 1")
        self._robot = Robot(
            bounds, self._collisions, spec.velocity, damping, q, near, as_costs(costs, robot, np.zeros(2)), limits
        )
        self._reset(MotionClock(None))
        self._warm_up(preparation)
        self._reset(own_clock)
        self._robot.rest(q)
        preparation.end()

    def _warm_up(self, progress: Step) -> None:
        """Step through synthetic frames of a person who moves, is partly hidden, jumps, leaves and returns.

        All code is compiled then, and no frame of the person waits for that.
        """
        frame = np.random.default_rng(0).normal(size=(len(self.points), 3))
        hidden = frame.copy()
        hidden[-1] = np.nan
        frames, time = (frame, 1.001 * frame, hidden, -frame, None, frame, frame), 0.0
        for i, points in enumerate(frames):
            time += CONTROL_STEP if points is not None else 2.0 * self._hold_after
            self.step(points, time)
            progress((i + 1) / len(frames))

    def _reset(self, clock: MotionClock) -> None:
        """Forget all frames."""
        self._clock = clock
        self._time: float | None = None
        self._last_seen, self._seen_at, self._reference_at = -np.inf, -np.inf, -np.inf
        self._estimate: ArmEstimate | None = None
        self._target: Target | None = None
        self._demonstrated: Array | None = None
        self._state = FollowState()

    @classmethod
    def of(cls, result: TransferResult, **options: Any) -> "Live":
        """Let the person of a result lead its robot: with its adapter, placement, limits and first configuration.

        Parameters
        ----------
        result : TransferResult
            Of one arm.
        **options
            As of `Live`, instead of those of the result.
        """
        _require_types(result=(result, TransferResult))
        defaults: dict[str, Any] = {"spec": result.spec, "random_state": result.random_state}
        arm = result.arm
        if (motion := arm.motion) is not None:
            defaults |= {"path": arm.placement, "motion_limits": motion.limits, "collisions": arm.collisions or False}
            defaults |= {"reference": motion.joint_positions, "start": motion.joint_positions[0]}
        return cls(arm.fit, arm.adapter, arm.robot, **{**defaults, **options})

    def __repr__(self) -> str:
        return f"Live({self._person.arm.name!r} leads {self.robot.name!r}, {self._state.state})"

    @property
    def joint_positions(self) -> Array:
        """Configuration of the robot, before the first frame too, shape (dof,) [rad or m]."""
        return self._robot.q.copy()

    def step(self, points: ArrayLike | Mapping[str, ArrayLike] | None, time: float | None = None) -> Moment:
        """Take a frame, and move the robot for the time since the last step.

        Parameters
        ----------
        points : array_like, shape (n, 3), mapping or None
            Positions of `Live.points`, in any unit and right-handed axes, since directions count alone; nan for a point
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
        before, seen = self._target, positions is not None and time is not None and self._update(positions, time)
        self._move(before, seen, elapsed)
        self._clock.end_step(rested and self._robot.resting)
        return self._moment()

    def _update(self, positions: Array, now: float) -> bool:
        """Update estimate and target with a frame; False where the arm is not seen in it, or jumps."""
        targets, before, dt = self._person.directions(positions), self._estimate, now - self._last_seen
        if targets is None or (before is not None and self._person.jumps(before, targets, dt)):
            return False
        if before is None or self._state.state == HOLDING or dt > self._hold_after:
            estimate = self._person.begin(targets, None if before is None else before.q)
        else:
            estimate = self._person.follow(before, targets, dt)
            if self._person.too_fast(before, estimate, dt):
                return False
        try:
            self._demonstrated, self._target = self._target_of(estimate.q)
        except NotSPDError:  # a flat ellipsoid, which an adapter without damping does not map
            return False
        self._estimate, self._last_seen, self._seen_at = estimate, now, self._clock.now
        return True

    def _target_of(self, angles: Array) -> tuple[Array, Target]:
        """Demonstrated ellipsoid, and the target of the robot, for joint angles of the person."""
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
        steps, target = max(1, math.ceil(elapsed / CONTROL_STEP - 1e-9)), self._target
        if target is None:
            self._robot.brake(elapsed)
            return
        lost = elapsed > self._hold_after or self._clock.now - self._seen_at > self._hold_after
        if lost or (self._state.state == HOLDING and not seen):
            self._state.hold()
            for _ in range(steps):
                self._robot.brake(elapsed / steps)
                if self._robot.resting:
                    break
            return
        self._state.resume()
        self._follow(before or target, target, elapsed / steps, steps)
        self._state.update(self._clock.now, self._position_error(), lambda: self._robot.distance(target[0]))

    def _follow(self, before: Target, target: Target, dt: float, steps: int, approach_share: float = 0.3) -> None:
        """Share the way from the target before to the new one among control steps of dt [s].

        An approach uses a share of the velocity limits. The reference is looked up every 50 ms.
        """
        if self._clock.now - self._reference_at > 0.05:
            self._robot.choose_reference(*target)
            self._reference_at = self._clock.now
        share = approach_share if self._state.approaching else 1.0
        (first, last_position), (last, position) = before, target
        start = last_position
        for i in range(1, steps + 1):
            part, next_position = i / steps, position
            if position is not None and start is not None:
                next_position = start + part * (position - start)
            ellipsoid = last if i == steps else first + part * (last - first)
            self._robot.follow(ellipsoid, next_position, last_position, dt, share, self._clock.now)
            last_position = next_position

    def _position_error(self) -> float | None:
        """Distance of the end effector from its target [m]; None without a target position."""
        if self._target is None or self._target[1] is None:
            return None
        return math.dist(self._robot.tip, self._target[1])

    def _moment(self) -> Moment:
        robot, target = self._robot, None if self._target is None else self._target[0]
        return Moment(
            time=self._clock.state_time,
            state=self._state.state,
            joint_positions=robot.q.copy(),
            joint_velocities=robot.velocity.copy(),
            achieved=robot.achieved,
            tip=robot.tip,
            person=None if self._estimate is None else self._estimate.q,
            demonstrated=self._demonstrated,
            target=target,
            distance=None if target is None else robot.distance(target),
            tip_error=self._position_error(),
        )


def _require_types(**arguments: tuple[Any, type]) -> None:
    for name, (value, kind) in arguments.items():
        if not isinstance(value, kind):
            raise InvalidInputError(f"{name} must be of type {kind.__name__}; found {type(value).__name__}")
