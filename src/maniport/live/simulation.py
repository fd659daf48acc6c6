"""A simulated robot that executes the commands of `maniport.Live`, without hardware."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin

from maniport.arms import Arm, ArmGroup, as_group
from maniport.live.live import Live
from maniport.live.state import HOLDING, REACHING, LiveState, errors_text
from maniport.motion import robot_model
from maniport.util.validation import Array

BANDWIDTH = 60.0  # Of the simulated joint servos, critically damped [rad/s]
PERIOD = 1e-3  # Of the simulation and the servos [s]


class SimulatedRobot:
    """A robot with its masses, joint servos by inverse dynamics, and the limits of its motors, at 1 kHz.

    A servo follows the last commanded position and velocity. A robot without masses is at each command immediately.

    Parameters
    ----------
    robot : Arm or ArmGroup
    start : ndarray, shape (dof,)
        Configuration at rest [rad or m].
    """

    def __init__(self, robot: Arm | ArmGroup, start: Array):
        self.q, self._velocity = start.copy(), np.zeros(len(start))
        self.dynamic = all(own.chain.inertia is not None for own in as_group(robot).arms)
        self.largest_share = 0.0  # of the torque limits that was used
        self._model = robot_model(robot)
        self._model.armature[:] = 1e-6  # for links without mass
        self._data = self._model.createData()

    def move(self, q: Array, velocity: Array, duration: float) -> None:
        """Simulate for a duration [s], at the end of which position and velocity (dof,) are commanded."""
        if not self.dynamic:
            self.q = q.copy()
            return
        model, data, limits = self._model, self._data, self._model.effortLimit
        for left in np.arange(round(duration / PERIOD))[::-1] * PERIOD:
            error, change = q - left * velocity - self.q, velocity - self._velocity
            demanded = BANDWIDTH**2 * error + 2.0 * BANDWIDTH * change
            torque = np.clip(pin.rnea(model, data, self.q, self._velocity, demanded), -limits, limits)
            self.largest_share = max(self.largest_share, float(np.abs(torque / limits).max()))
            self._velocity = self._velocity + PERIOD * pin.aba(model, data, self.q, self._velocity, torque)
            self.q = self.q + PERIOD * self._velocity


class Simulation:
    """Frames of a recording lead a simulated robot; keeps position errors and lags of the servos."""

    def __init__(self, live: Live):
        self.robot, self._live = SimulatedRobot(live.robot, live.joint_positions), live
        self._time: float | None = None
        self.errors: list[float] = []  # position errors of the simulated robot while the person is followed [m]
        self.lag = 0.0  # largest distance of a joint from its command [rad or m]

    def step(self, points: Array | None, time: float) -> LiveState:
        """Let the robot follow a frame; return the state of the simulated robot."""
        state = self._live.step(points, time)
        self.robot.move(state.joint_positions, state.joint_velocities, time - (self._time or time))
        self._time, arms = time, []
        self.lag = max(self.lag, float(np.abs(self.robot.q - state.joint_positions).max()))
        for arm, pose in zip(state.arms, as_group(self._live.robot).forward(self.robot.q), strict=True):
            error = None if arm.target_position is None else math.dist(pose[:3, 3], arm.target_position)
            arms.append(replace(arm, position=pose[:3, 3], position_error=error))
        state = replace(state, joint_positions=self.robot.q, arms=tuple(arms))
        if state.position_error is not None and state.state not in (REACHING, HOLDING):
            self.errors.append(state.position_error)
        return state

    def __str__(self) -> str:
        servo = f"servo lag at most {self.lag:.3f} rad, torque at most {100 * self.robot.largest_share:.0f} %"
        text = servo if self.robot.dynamic else "robot without masses: no dynamics"
        return f"{errors_text(self.errors)}; {text}" if self.errors else text
