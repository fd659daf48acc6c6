"""A robot that follows live: the result of a step, its state machine, and the time for which it moves."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

from maniport.errors import InvalidInputError
from maniport.util.validation import LATEST, Array, as_number

State = Literal[
    "holding",  # brakes and rests: the person is not visible
    "waiting",  # brakes and rests: the person is visible, and `engage` is awaited
    "approaching",  # moves to the target at a share of the velocity limits
    "following",
    "lagging",  # follows as fast as it can, with an end effector far from its path
    "displaced",  # brakes and rests: measured joints are far from the commands
]
STATES: tuple[State, ...] = get_args(State)
MOVING: tuple[State, ...] = ("approaching", "following", "lagging")
LOSS = 0.25
"""The robot brakes and awaits `engage` after this time without a step or a visible person; `engage` waits for a visible
person as long [s]. Shorter gaps of recorded markers are frequent."""
NEAR = 0.01  # The robot is at its target when its end effector is so near to it [m]
FAR = 0.03  # The robot lags once its end effector is farther away than this, until it is near again [m]


@dataclass(frozen=True, slots=True, eq=False)
class LiveArm:
    """One arm of the robot in a step, and of the person who leads it.

    Attributes
    ----------
    achieved : ndarray, shape (d, d)
        Velocity ellipsoid of the robot's arm in the base frame.
    position : ndarray, shape (3,)
        Position of its end effector in the base frame [m].
    person : ndarray, shape (7,), or None
        The last estimate of the joint angles [rad]; None, as the rest, before the arm is seen first.
    demonstrated, target : ndarray, shape (d, d), or None
        The person's last ellipsoid in the trunk frame, and the target in the robot's base frame after the delay of
        `Live`; that of velocity also where forces were transferred.
    target_position : ndarray, shape (3,), or None
        Target of the end effector in the base frame [m], after the delay; None without a path.
    distance : float or None
        Affine-invariant distance of target and achieved ellipsoid, with the damping.
    position_error : float or None
        Distance of the end effector from that target [m]; None without a path.
    """

    achieved: Array
    position: Array
    person: Array | None = None
    demonstrated: Array | None = None
    target: Array | None = None
    target_position: Array | None = None
    distance: float | None = None
    position_error: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LiveState:
    """The robot after a step of `Live`.

    Attributes
    ----------
    time : float
        Of the robot's state [s]. It begins with the time of the first frame and advances by the clock of `Live`; while
        the robot moves, it falls behind by the part of steps beyond 2 ms, and makes up for that by 5 % of later time,
        so that joint positions keep the limits over it. Simulated: the frame's time.
    state : str
        One of `STATES`.
    joint_positions, joint_velocities : ndarray, shape (dof,)
        Of all joints of the robot [rad or m, and per second].
    arms : tuple of LiveArm
    """

    time: float
    state: State
    joint_positions: Array
    joint_velocities: Array
    arms: tuple[LiveArm, ...]

    @property
    def arm(self) -> LiveArm:
        """The only arm; `InvalidInputError` when there are several."""
        if len(self.arms) != 1:
            raise InvalidInputError(
                f"arm is for robots of one arm; found {len(self.arms)}; use arms"
            )
        return self.arms[0]

    @property
    def distance(self) -> float | None:
        """Largest distance of all arms."""
        return largest(arm.distance for arm in self.arms)

    @property
    def position_error(self) -> float | None:
        """Largest position error of all arms [m]."""
        return largest(arm.position_error for arm in self.arms)


def largest(values: Iterable[float | None]) -> float | None:
    """Return the largest number, None where there is none."""
    return max((value for value in values if value is not None), default=None)


def errors_text(errors: Sequence[float]) -> str:
    """Return statistics of position errors [m] as text."""
    median, high, most = 1e3 * np.quantile(errors, [0.5, 0.95, 1.0])
    return (
        f"position error: median {median:.1f} mm, 95th percentile {high:.0f} mm, max {most:.0f} mm"
    )


class StateMachine:
    """The states of a robot that follows a person.

    ::

                person visible          engage               near the target
        holding ─────────────▶ waiting ────────▶ approaching ──────────────▶ following ⇄ lagging

    From each state the robot goes to ``holding`` where the person was not visible for `LOSS` or `hold` is called, and
    to ``displaced`` where its measured joints are far from its commands. From there it goes to ``holding`` or
    ``waiting`` when they agree again. It moves in the states of `MOVING` only, and comes there by `engage` only, which
    with `auto_engage` is implied.
    """

    def __init__(self, auto_engage: bool = False):
        self.state: State = "holding"
        self._auto_engage = auto_engage
        self._seen_at = -math.inf  # when the person was visible last [s]
        self._asked_at = -math.inf  # when `engage` was called, until the robot is engaged [s]
        self._least_error = math.inf  # of this approach
        self._least_error_at = 0.0  # [s]

    @property
    def moves(self) -> bool:
        """Whether the robot moves toward its targets."""
        return self.state in MOVING

    def engage(self, now: float) -> None:
        """Let the robot approach the person who is visible, or becomes visible within `LOSS`; at a time [s]."""
        if not self.moves:
            self._asked_at = now

    def hold(self) -> None:
        """Let the robot brake, until the person is visible and `engage` is called."""
        self.state = "holding"
        self._seen_at = -math.inf
        self._asked_at = -math.inf

    def begin_step(self, now: float, elapsed: float, seen: bool, displaced: bool) -> None:
        """Update the state before the robot moves for the time that has elapsed until now [s].

        `seen` is whether the person is visible in the frame of this step.
        """
        if seen:
            self._seen_at = now
        self._asked_at = min(self._asked_at, now)
        visible = now - self._seen_at <= LOSS
        if displaced:
            self.state = "displaced"
            return
        if not visible:
            self.state = "holding"
            return
        if self.moves and elapsed <= LOSS:
            return

        self.state = "waiting"
        if self._auto_engage or now - self._asked_at <= LOSS:
            self.state = "approaching"
            self._asked_at = -math.inf
            self._least_error = math.inf

    def end_step(self, now: float, position_error: float | None, distance: float | None) -> None:
        """Update the state after a motion, at a time [s].

        An approach ends near the target, or after 0.5 s without coming nearer.
        """
        if self.state == "approaching":
            error = distance or 0.0
            near = 0.1
            if position_error is not None:
                error = position_error
                near = NEAR
            if error < 0.98 * self._least_error:
                self._least_error = error
                self._least_error_at = now
            if error > near and now - self._least_error_at <= 0.5:
                return
            self.state = "following"
        if position_error is None:
            return
        if position_error <= NEAR:
            self.state = "following"
        elif position_error > FAR:
            self.state = "lagging"


class MeasuredJoints:
    """Measured joints of the robot, in comparison with commands.

    A robot that executes commands lags behind them while it moves, and is near them 0.5 s after a motion. Where it is
    not, the last command is no longer the configuration from which it can move. Small errors at rest are those of its
    servos: commands that were corrected by them continuously would let the robot sink.

    Parameters
    ----------
    units : sequence of str
        Of the joints, "rad" or "m".
    """

    TOLERANCE: ClassVar[dict[str, float]] = {"rad": 0.1, "m": 0.02}  # at rest
    AGREEMENT = 0.05  # share of the tolerance within which an approach begins from the command
    MOVING_FACTOR = 3.0  # 0.3 rad are 0.15 s at 2 rad/s, the lag of slow position servos
    SETTLING = 0.5  # [s]

    def __init__(self, units: Sequence[str]):
        self._tolerance = np.array([self.TOLERANCE[unit] for unit in units])
        self._moved_at = -math.inf
        self._last: Array | None = None  # (dof,)
        self._measured_at = -math.inf
        self.are_first = True  # whether neither joints were measured nor the robot moved before

    def moved(self, now: float) -> None:
        """Remember that the commands moved at a time [s]."""
        self._moved_at = now
        self.are_first = False

    def remember(self, measured: Array, now: float) -> None:
        """Take the joints (dof,) that were measured at a time [s]."""
        self._last = measured
        self._measured_at = now
        self.are_first = False

    def recent(self, now: float) -> Array | None:
        """Return the last joints, if they are not older than `LOSS` at a time [s]."""
        if now - self._measured_at <= LOSS:
            return self._last
        return None

    def settled(self, now: float) -> bool:
        """Whether the commands have been at rest for long enough, at a time [s]."""
        return now - self._moved_at >= self.SETTLING

    def far(self, measured: Array, command: Array, now: float) -> bool:
        """Whether measured joints (dof,) are far from a command at a time [s]."""
        if self.settled(now):
            factor = 1.0
        else:
            factor = self.MOVING_FACTOR
        return bool((np.abs(measured - command) > factor * self._tolerance).any())

    def agree(self, measured: Array, command: Array) -> bool:
        """Whether measured joints (dof,) are those of a command, but for noise."""
        return bool((np.abs(measured - command) <= self.AGREEMENT * self._tolerance).all())


class MotionClock:
    """Measure the time for which the robot may move, by this machine's clock or, without one, in simulated time.

    `state_time` begins with the time of the first frame and advances by the clock. While the robot moves, it falls
    behind by the computing time of a step beyond 2 ms, for which the robot does not move, and makes up for that by 5 %
    of later time.
    """

    COMPUTING_TIME = 0.002  # Of most steps; the median is 0.3 ms [s]
    MAKING_UP = 0.05

    def __init__(self, read: Callable[[], float] | None):
        if read is not None and not callable(read):
            raise InvalidInputError(
                f"clock must be a function without arguments, or None; found {read!r:.80}"
            )
        self._read = read
        self.now = -math.inf
        self.state_time = 0.0
        self._offset = 0.0  # of the state time to the clock, at the beginning [s]
        self._moved = -math.inf  # until when the robot has moved, by the clock [s]
        self._was_long = False  # whether the last step took longer than usual
        self._lost_at_rest = 0.0  # by how much the last step took longer, if the robot rested [s]

    def read(self) -> float:
        """Read this machine's clock [s]; raise InvalidInputError where it is simulated or returns no finite number."""
        if self._read is None:
            raise InvalidInputError(
                "time is required where clock is None: the times of frames count"
            )
        return as_number(
            self._read(), "the time that clock returns [s]", minimum=-LATEST, maximum=LATEST
        )

    def latest(self) -> float:
        """Return the present [s]; in simulated time that of the last step, infinite before the first one."""
        if self._read is not None:
            return max(self.read(), self.now)
        if self.now == -math.inf:
            return math.inf
        return self.now

    def begin_step(self, frame_time: float | None) -> float:
        """Begin a step; return the time since the last one for which the robot may move [s]."""
        simulated = self._read is None
        if frame_time is not None and simulated:
            now = frame_time
        else:
            now = self.read()
        if self.now == -math.inf:
            self._moved = now
            self.state_time = now if frame_time is None else frame_time
            self._offset = self.state_time - now
        self.now = max(self.now, now)
        elapsed = max(self.now - self._moved, 0.0)
        self._moved = max(self._moved, self.now)
        if simulated:
            self.state_time = now
            return elapsed
        behind = self.now + self._offset - (self.state_time + elapsed)
        if behind > 1e-9 and not self._was_long:
            elapsed += min(behind, self.MAKING_UP * elapsed)
        self.state_time += elapsed
        return elapsed

    def end_step(self, rested: bool) -> None:
        """End a step in which the robot moved or rested, and whose command leaves now.

        After a long step two commands may leave at almost the same time, and the robot must not move in between for the
        whole time between the beginnings of both steps. The next step of a robot that rests, too, catches up with that.
        """
        if self._read is None:
            return
        end = self.read()
        if rested:
            self.state_time += self._lost_at_rest
        moved = max(self._moved, end - self.COMPUTING_TIME)
        self._was_long = moved > self._moved
        if rested:
            self._lost_at_rest = moved - self._moved
        else:
            self._lost_at_rest = 0.0
        self._moved = moved
