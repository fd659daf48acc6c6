"""A robot that follows live: the result of a step, its state machine, and the time for which it moves."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from maniport.errors import InvalidInputError
from maniport.util.validation import LATEST, Array, as_number

State = Literal[
    "reaching",  # goes from its start to the target
    "following",
    "lagging",  # follows as fast as it can, with an end effector far from its path
    "holding",  # brakes and rests, since the person is not seen or jumps
    "recovering",  # returns to the target after that
]
STATES: tuple[State, ...] = get_args(State)
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
        Of the robot's state [s]. It begins with the time of the first frame and advances by the clock of `Live`, less
        the part of steps beyond 2 ms, so that joint positions keep the limits over it. Simulated: the frame's time.
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


class FollowState:
    """The state machine of a robot, from its start on; `state` is one of `STATES`."""

    def __init__(self) -> None:
        self.state: State = "reaching"
        self._least, self._least_at = np.inf, 0.0

    @property
    def approaching(self) -> bool:
        """Whether the robot moves to the target from afar."""
        return self.state in ("reaching", "recovering")

    def resume(self) -> None:
        """End the rest."""
        if self.state == "holding":
            self.state, self._least = "recovering", np.inf

    def update(self, now: float, position_error: float | None, distance: float | None) -> None:
        """Update the state at a time [s]; an approach ends near the target, or after 0.5 s without coming nearer."""
        if self.approaching:
            error, enough = (
                (distance or 0.0, 0.1) if position_error is None else (position_error, NEAR)
            )
            if error < 0.98 * self._least:
                self._least, self._least_at = error, now
            if error > enough and now - self._least_at <= 0.5:
                return
            self.state = "following"
        if position_error is not None and not NEAR < position_error <= FAR:
            self.state = "following" if position_error <= NEAR else "lagging"


class MotionClock:
    """Measure the time for which the robot may move, by this machine's clock or, without one, in simulated time."""

    def __init__(self, read: Callable[[], float] | None):
        if read is not None and not callable(read):
            raise InvalidInputError(
                f"clock must be a function without arguments, or None; found {read!r:.80}"
            )
        self._read = read
        self.now, self._moved = -float("inf"), -float("inf")
        self.state_time, self._offset = 0.0, 0.0

    def read(self) -> float:
        """Read this machine's clock [s]; raise InvalidInputError where it is simulated or returns no finite number."""
        if self._read is None:
            raise InvalidInputError(
                "time is required where clock is None: the times of frames count"
            )
        return as_number(
            self._read(), "the time that clock returns [s]", minimum=-LATEST, maximum=LATEST
        )

    def begin_step(self, frame_time: float | None) -> float:
        """Begin a step; return the time since the last one for which the robot may move [s]."""
        simulated = self._read is None
        now = frame_time if frame_time is not None and simulated else self.read()
        if self.now == -float("inf"):
            self._moved, self.state_time = now, now if frame_time is None else frame_time
            self._offset = self.state_time - now
        self.now = max(self.now, now)
        elapsed = max(self.now - self._moved, 0.0)
        self._moved = max(self._moved, self.now)
        self.state_time = now if simulated else self.state_time + elapsed
        return elapsed

    def end_step(self, rested: bool, computing_time: float = 0.002) -> None:
        """End a step in which the robot moved or rested, and whose command leaves now.

        After a step longer than `computing_time` (the median is 0.3 ms) two commands may leave at almost the same time,
        and the robot must not move in between for the whole time between the beginnings of both steps.
        """
        if rested:  # the time that long steps took from the motion does not matter at rest
            self.state_time = max(self.state_time, self.now + self._offset)
        if self._read is not None:
            self._moved = max(self._moved, self.read() - computing_time)
