"""The state of a robot that follows live: which state it is in, and what one step of `maniport.Live` returns."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from maniport.util.validation import Array

REACHING = "reaching"
FOLLOWING = "following"
LAGGING = "lagging"
HOLDING = "holding"
RECOVERING = "recovering"
STATES = (REACHING, FOLLOWING, LAGGING, HOLDING, RECOVERING)
"""`reaching`: goes from its start to the target. `following`. `lagging`: follows as fast as it can, with the end
effector far from its path. `holding`: brakes and rests, since the person is not seen or jumps. `recovering`: returns to
the target after that."""

NEAR = 0.01  # The robot is at its target when its end effector is so near to it [m]
FAR = 0.03  # The robot lags once its end effector is farther away than this, until it is near again [m]


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The robot at one time, and its targets, as a step of `Live` returns them.

    Attributes
    ----------
    time : float
        Of the robot's state [s]. It begins with the time of the first frame and advances by the clock of `Live`, less
        the part of steps beyond 2 ms, so that joint positions keep the limits over it. Simulated: the frame's time.
    state : str
        One of `STATES`.
    joint_positions, joint_velocities : ndarray, shape (dof,)
        Of the robot [rad or m, and per second].
    achieved : ndarray, shape (d, d)
        Its velocity ellipsoid in its base frame.
    tip : ndarray, shape (3,)
        Position of its end effector in its base frame [m].
    person : ndarray, shape (7,), or None
        The last estimate of the person's joint angles [rad]; None, as the rest, before the person is seen first.
    demonstrated, target : ndarray, shape (d, d), or None
        The person's ellipsoid in the trunk frame, and the target in the robot's base frame; that of velocity also where
        forces were transferred.
    distance : float or None
        Affine-invariant distance of target and achieved ellipsoid, with the damping.
    tip_error : float or None
        Distance of the end effector from the target of the path [m]; None without a path.
    """

    time: float
    state: str
    joint_positions: Array
    joint_velocities: Array
    achieved: Array
    tip: Array
    person: Array | None
    demonstrated: Array | None
    target: Array | None
    distance: float | None
    tip_error: float | None


class FollowState:
    """The state machine of a robot, from its start on; `state` is one of `STATES`."""

    def __init__(self) -> None:
        self.state = REACHING
        self._least, self._least_at = np.inf, 0.0

    @property
    def approaching(self) -> bool:
        """Whether the robot moves to the target from afar."""
        return self.state in (REACHING, RECOVERING)

    def hold(self) -> None:
        """Brake and rest."""
        self.state = HOLDING

    def resume(self) -> None:
        """End the rest."""
        if self.state == HOLDING:
            self.state, self._least = RECOVERING, np.inf

    def update(self, now: float, position_error: float | None, distance: Callable[[], float]) -> None:
        """Update the state at a time [s]; an approach ends near the target, or after 0.5 s without coming nearer."""
        if self.approaching:
            error, enough = (distance(), 0.1) if position_error is None else (position_error, NEAR)
            if error < 0.98 * self._least:
                self._least, self._least_at = error, now
            if error > enough and now - self._least_at <= 0.5:
                return
            self.state = FOLLOWING
        if position_error is not None and not NEAR < position_error <= FAR:
            self.state = FOLLOWING if position_error <= NEAR else LAGGING
