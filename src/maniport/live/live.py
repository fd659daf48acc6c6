"""One frame in, joint positions out: the arms of a person lead those of a robot while they move."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from time import monotonic
from types import UnionType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.live.person import LedArm, Person
from maniport.live.robot import CONTROL_STEP, Robot
from maniport.live.state import (
    LiveArm,
    LiveState,
    MeasuredJoints,
    MotionClock,
    StateMachine,
    largest,
)
from maniport.live.targets import Target, TargetQueue
from maniport.live.transport import as_frame, as_joints
from maniport.mocap import ArmFit, HumanMotion
from maniport.motion import Cost, Limit, MotionLimits, Placement, PlanOptions
from maniport.motion.costs.cost import as_costs
from maniport.motion.plan.plan_options import require_free
from maniport.motion.targets import Damping
from maniport.pipeline import TransferResult
from maniport.transfer import DomainAdapter
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step
from maniport.util.validation import LATEST, Array, as_flag, as_number, require_shape


class Live:
    """A robot that follows a person, frame by frame, with one or several arms.

    `step` maps the ellipsoids of the person's arms in a frame with fitted adapters, and moves the robot toward these
    ellipsoids and the positions of the hands in the placed paths, within joint limits and without collisions. The robot
    rests until `engage`, at the start, after `hold`, and after 0.25 s in which an arm of the person was not seen or
    jumped. Then it approaches from its present configuration.

    The robot moves for the time that passes on this machine between two steps, whatever times the frames have: its
    commands keep the limits over the times of its states. With ``clock=None`` it moves for the time between
    two frames (simulated time), and the same frames give the same motion. Each thread needs its own instance.

    Parameters
    ----------
    person : ArmFit or HumanMotion
        Of a recording of this person with these points (`maniport.fit_arm`, `maniport.mocap.fit_arms`): lengths, side,
        roles. One arm for each of the robot.
    adapter : DomainAdapter
        Fitted; for a group of arms, as `path`, a sequence with an item for each arm.
    robot : Arm or ArmGroup
    path : Placement, optional
        Placement of the hand's path. Without it the robot follows the ellipsoids alone.
    spec : EllipsoidSpec
        Ellipsoids of the adapter.
    motion_limits, collisions
        As in `maniport.motion.PlanOptions`.
    start : array_like, shape (dof,)
        Configuration of the robot, at rest, such as the first of a plan. It may be within the margin of joint limits,
        from where the robot moves inward only.
    reference : array_like, shape (n, dof), optional
        Configurations that suit the motion, such as a plan's: the robot stays near the best one. Without them it may
        get stuck at joint limits.
    delay : float
        Time after which the robot follows, at most 0.5 [s]. It plans with the targets of that time: errors become
        smaller where the person is fast, but the latency grows. Short gaps between frames are closed.
    auto_engage : bool
        Engage whenever the person is visible, without `engage`; for simulated robots only.
    clock : callable or None
        Returns the time on this machine [s]. None: simulated time; commands keep the limits at the times of frames.
    costs, limits
        As in `maniport.motion.TrackOptions`; the time of costs is that of the robot's clock.
    progress : optional
        As in `maniport.transfer_recording`.

    Attributes
    ----------
    points : tuple of str
        Names of the points that a frame has, in their order.
    robot : Arm or ArmGroup
        Within its limits.

    Raises
    ------
    InvalidInputError
        When an argument does not fit another, or the start is beyond limits or collides.
    NotFittedError
        When an adapter is not fitted.
    """

    def __init__(
        self,
        person: ArmFit | HumanMotion,
        adapter: DomainAdapter | Sequence[DomainAdapter],
        robot: Arm | ArmGroup,
        *,
        path: Placement | Sequence[Placement] | None = None,
        spec: EllipsoidSpec = VELOCITY,
        motion_limits: MotionLimits | str | os.PathLike[str] | Mapping[str, object] | None = None,
        collisions: Collisions | bool = True,
        start: ArrayLike,
        reference: ArrayLike | None = None,
        delay: float = 0.15,
        auto_engage: bool = False,
        clock: Callable[[], float] | None = monotonic,
        costs: Sequence[Cost] = (),
        limits: Sequence[Limit] = (),
        progress: Progress | None = None,
    ):
        _require_each("robot", (robot,), Arm | ArmGroup, 1)
        _require_each("spec", (spec,), EllipsoidSpec, 1)
        count = len(as_group(robot))
        if isinstance(person, HumanMotion):
            fits = person.arms
            bases = person.bases
        else:
            fits = _as_tuple(person)
            bases = np.zeros((1, 3))
        _require_each("person", fits, ArmFit, count)
        adapters = _as_tuple(adapter)
        _require_each("adapter", adapters, DomainAdapter, count)
        paths: tuple[Placement | None, ...] = (None,) * count
        if path is not None:
            paths = _as_tuple(path)
            _require_each("path", paths, Placement, count)
        self._delay = as_delay(delay)
        auto_engage = as_flag(auto_engage, "auto_engage")
        motion_clock = MotionClock(clock)
        preparation = Step(progress, "Prepare live control")

        persons = [Person(fit) for fit in fits]
        points = dict[str, None]()
        for arm_of_person in persons:
            points |= dict.fromkeys(arm_of_person.points)
        self.points = tuple(points)
        self._arms = []
        for arm_of_person, fitted, base, placement in zip(
            persons, adapters, bases, paths, strict=True
        ):
            rows = [self.points.index(name) for name in arm_of_person.points]
            self._arms.append(LedArm(arm_of_person, rows, fitted, base, placement, spec))

        control = PlanOptions(motion_limits=motion_limits, collisions=collisions).resolved(robot)
        bounds = control.motion_limits
        assert isinstance(bounds, MotionLimits)
        self.robot = bounds.arm
        collision_model = control.collisions or None
        assert not isinstance(collision_model, bool)
        self._own_limits = replace(bounds, arm=robot)  # without the margin
        self._collisions = collision_model
        q = require_free(start, "start", self._own_limits, collision_model)
        q = np.clip(q, robot.lower, robot.upper)
        references = None
        if reference is not None:
            references = bounds.arm.require_within_limits(reference, "reference")
            require_shape(references, "reference", ("n", bounds.arm.dof), " with n ≥ 1")
        self._robot = Robot(
            bounds,
            collision_model,
            spec.bounded,
            _strongest_damping(adapters, spec),
            q,
            references,
            as_costs(costs, robot, np.zeros(2)),
            limits,
        )
        self._warm_up(preparation)
        self._reset(motion_clock, auto_engage)
        self._robot.rest(q)
        preparation.end()

    def _warm_up(self, progress: Step) -> None:
        """Step through synthetic frames of a person who moves, is partly hidden, jumps, leaves and returns.

        All code is compiled then, and no frame of the person waits for that.
        """
        self._reset(MotionClock(None), auto_engage=True)
        frame = np.random.default_rng(0).normal(size=(len(self.points), 3))
        hidden = frame.copy()
        hidden[-1] = np.nan
        frames = (frame, 1.001 * frame, hidden, -frame, None, frame, frame)
        time = 0.0
        for i, points in enumerate(frames):
            time += CONTROL_STEP if points is not None else 0.2
            self.step(points, time)
            progress((i + 1) / len(frames))

    def _reset(self, clock: MotionClock, auto_engage: bool) -> None:
        """Forget all frames."""
        self._clock = clock
        self._machine = StateMachine(auto_engage)
        self._measured = MeasuredJoints(self.robot.joint_units)
        self._time: float | None = None
        for arm in self._arms:
            arm.forget()
        self._queues = [TargetQueue(self._delay) for _ in self._arms]

    @classmethod
    def of(cls, result: TransferResult, **options: Any) -> "Live":
        """Let the person of a result lead its robot: with its adapters, placements, limits and first configuration.

        Parameters
        ----------
        result : TransferResult
        **options
            As of `Live`, instead of those of the result.
        """
        _require_each("result", (result,), TransferResult, 1)
        person = HumanMotion(
            tuple(arm.fit for arm in result.arms),
            np.stack([arm.person_base for arm in result.arms]),
        )
        if len(result.arms) > 1:
            robot: Arm | ArmGroup = result.robot
        else:
            robot = result.arm.robot
        if result.motion is None:
            raise InvalidInputError("result has no motion; transfer the recording with move=True")
        plan = result.fitted.settings.plan
        assert plan is not None  # with a motion
        paths = [arm.placement for arm in result.arms if arm.placement is not None]
        joints = result.motion.trajectory.joint_positions
        defaults: dict[str, Any] = {
            "motion_limits": plan.motion_limits,
            "collisions": plan.collisions,
        }
        defaults |= {
            "spec": result.config.spec,
            "path": paths or None,
            "start": joints[0],
            "reference": joints,
        }
        return cls(person, [arm.adapter for arm in result.arms], robot, **{**defaults, **options})

    def __repr__(self) -> str:
        persons = " and ".join(repr(arm.person.arm.name) for arm in self._arms)
        return f"Live({persons} leads {self.robot.name!r}, {self._machine.state})"

    @property
    def joint_positions(self) -> Array:
        """Configuration of the robot, before the first frame too, shape (dof,) [rad or m]."""
        return self._robot.q.copy()

    def step(
        self,
        points: ArrayLike | Mapping[str, ArrayLike] | None,
        time: float | None = None,
        *,
        joints: ArrayLike | Mapping[str, float] | None = None,
    ) -> LiveState:
        """Take a frame, and move the robot for the time since the last step.

        Parameters
        ----------
        points : array_like, shape (n, 3), mapping or None
            Positions of `Live.points`, in any unit and right-handed axes, since directions count alone; nan for a point
            that is not seen. A mapping by name may lack some. None: no frame came.
        time : float, optional
            When the points were measured, by any clock; later than in all frames before [s]. Default: now.
        joints : array_like, shape (dof,), or mapping by name, optional
            Measured configuration of the robot [rad or m]. The first one replaces the start, and the last one is where
            an approach begins after 0.5 s at rest. One that is more than 0.1 rad or 0.02 m from the command, or three
            times as far within 0.5 s after a motion, disengages the robot: its state is ``displaced``. After 0.5 s at
            rest it replaces the command.

        Raises
        ------
        InvalidInputError
            When a name is not in `points`, shapes are wrong, values infinite, or the time is not later, or missing in
            simulated time; when joints are missing, not finite, beyond the robot's limits, or collide where they
            replace the command. Nothing has moved then.
        """
        positions = as_frame(points, self.points)
        measured = None
        if joints is not None:
            measured = as_joints(joints, self.robot.joint_names)
            self._own_limits.arm.require_within_limits(measured, "joints", single=True)
        time = self._time_of_frame(time, positions is not None)
        elapsed = self._clock.begin_step(time)
        now = self._clock.now
        rested = self._robot.resting
        if time is not None:
            self._time = time

        displaced = self._is_displaced(measured, now)
        seen = self._update_targets(positions, time)
        moves = self._machine.moves
        self._machine.begin_step(now, elapsed, seen, displaced)
        if self._machine.moves and not moves:
            self._start_from_measured(now)
        targets = [queue.at(now) for queue in self._queues]
        moved = elapsed > 0.0 and self._move(targets, elapsed)
        if not self._robot.resting:
            self._measured.moved(now)
        self._clock.end_step(rested and self._robot.resting)

        arms = tuple(map(self._arm_state, range(len(targets)), targets))
        if moved:
            position_error = largest(arm.position_error for arm in arms)
            self._machine.end_step(now, position_error, largest(arm.distance for arm in arms))
        q = self._robot.q.copy()
        velocity = self._robot.velocity.copy()
        return LiveState(self._clock.state_time, self._machine.state, q, velocity, arms)

    def engage(self) -> None:
        """Let the robot follow the person: call it when everybody near the robot is ready for its motion.

        The robot approaches from its present configuration at half of its velocity limits. The person must be visible,
        or become so within 0.25 s. Later, the robot awaits another call (state ``waiting``).
        """
        self._machine.engage(self._clock.latest())

    def hold(self) -> None:
        """Let the robot brake in the following steps, until the person is visible and `engage` is called."""
        self._machine.hold()

    def _time_of_frame(self, time: float | None, has_points: bool) -> float | None:
        """Return the time of a frame [s], by the clock where it is not given; None for no frame without a time."""
        if time is not None:
            time = as_number(time, "time [s]", minimum=-LATEST, maximum=LATEST)
        elif has_points:
            time = self._clock.read()
        if self._time is not None and time is not None and not time > self._time:
            raise InvalidInputError(
                f"time must be later than {self._time!r} s, the last frame's; found {time!r}"
            )
        return time

    def _is_displaced(self, measured: Array | None, now: float) -> bool:
        """Return whether the robot is displaced, by measured joints (dof,) or, without any, as before."""
        if measured is None:
            return self._machine.state == "displaced"
        return self._compare(measured, now)

    def _compare(self, measured: Array, now: float) -> bool:
        """Compare measured joints (dof,) with the command at a time [s], and let them replace it where they should.

        Return whether the robot is displaced.
        """
        is_first = self._measured.are_first and not self._measured.agree(measured, self._robot.q)
        far = self._measured.far(measured, self._robot.q, now)
        settled = self._robot.resting and self._measured.settled(now)
        if settled and (is_first or far):
            require_free(measured, "joints", self._own_limits, self._collisions)
            self._robot.rest(measured)
            far = self._machine.moves and not is_first
        self._measured.remember(measured, now)
        if self._machine.state == "displaced" and not settled:
            return True
        return far

    def _start_from_measured(self, now: float) -> None:
        """Begin an approach at a time [s] from the measured joints, where there are recent ones and the robot rests."""
        measured = self._measured.recent(now)
        if measured is None or not self._robot.resting or not self._measured.settled(now):
            return
        if self._measured.agree(measured, self._robot.q):
            return
        if self._collisions is None or not self._collisions.collides(measured):
            self._robot.rest(measured)

    def _update_targets(self, positions: Array | None, time: float | None) -> bool:
        """Update the targets with a frame; return whether all arms of the person are visible in it."""
        if positions is None or time is None:
            return False
        now = self._clock.now
        anew = self._machine.state == "holding"
        updated = [arm.update(positions, time, anew) for arm in self._arms]
        for arm, queue, success in zip(self._arms, self._queues, updated, strict=True):
            if success and arm.target is not None:
                queue.add(arm.target, now, anew)
        return all(updated)

    def _move(
        self, targets: Sequence[Target | None], elapsed: float, approach_share: float = 0.5
    ) -> bool:
        """Move the robot for the time that has elapsed [s], and return whether it follows.

        An approach uses a share of the velocity limits.
        """
        present = [target for target in targets if target is not None]
        if not self._machine.moves or len(present) < len(targets):
            self._robot.brake(elapsed)
            return False
        if self._machine.state == "approaching":
            share = approach_share
        else:
            share = 1.0
        self._robot.follow(present, self._queues, elapsed, share, self._clock.now)
        return True

    def _arm_state(self, index: int, delayed: Target | None) -> LiveArm:
        arm = self._arms[index]
        achieved = self._robot.achieved[index]
        position = self._robot.positions[index]
        if arm.estimate is None or delayed is None:
            return LiveArm(achieved, position)
        target, wanted = delayed
        error = None if wanted is None else math.dist(position, wanted)
        distance = self._robot.distance(index, target)
        return LiveArm(
            achieved, position, arm.estimate.q, arm.demonstrated, target, wanted, distance, error
        )


def as_delay(delay: float) -> float:
    """Convert to the delay of a robot [s]."""
    return as_number(delay, "delay [s]", minimum=0.0, maximum=0.5)


def _strongest_damping(adapters: Sequence[DomainAdapter], spec: EllipsoidSpec) -> Damping:
    """Return the largest damping of the images of adapters, or the default where none has any."""
    dampings = [adapter.student_regularization for adapter in adapters]
    strongest = max(dampings, key=lambda damping: damping.epsilon)
    if strongest.epsilon > 0.0 and spec.kind != "force":
        return strongest
    return DAMPING


T = TypeVar("T")


def _as_tuple(value: T | Sequence[T]) -> tuple[T, ...]:
    """Return the values of all arms; one that is no sequence is that of the only arm."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(value)
    return (value,)


def _require_each(name: str, values: Sequence[object], kind: type | UnionType, count: int) -> None:
    """Raise InvalidInputError unless there is a value of a type for each arm."""
    if len(values) == count and all(isinstance(value, kind) for value in values):
        return
    number = ""
    if count != 1:
        number = f", {count} of them, one for each arm of the robot"
    kinds = ", ".join(type(value).__name__ for value in values)
    raise InvalidInputError(
        f"{name} must be of type {getattr(kind, '__name__', kind)}{number}; found {kinds}"
    )
