"""A robot in MuJoCo that executes the commands of `maniport.Live`, without hardware."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.live.live import Live
from maniport.live.state import LiveState, errors_text
from maniport.motion import robot_model
from maniport.util.optional import mujoco
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

    Raises
    ------
    MissingPackageError
        When the robot has masses and MuJoCo is not installed.
    """

    def __init__(self, robot: Arm | ArmGroup, start: Array):
        self.q = start.copy()
        self.dynamic = all(arm.chain.inertia is not None for arm in as_group(robot).arms)
        self.largest_share = 0.0  # of the torque limits that was used
        efforts = robot.effort_limits
        self._efforts = np.full(len(start), np.inf) if efforts is None else efforts
        self.limited = bool(np.isfinite(self._efforts).any())
        if self.dynamic:
            self._mujoco = mujoco()
            self._model = model_spec(robot).compile()
            self._data = self._mujoco.MjData(self._model)
            self._data.qpos[:] = start
            self._mujoco.mj_forward(self._model, self._data)

    def move(self, q: Array, velocity: Array, duration: float) -> None:
        """Simulate for a duration [s], at the end of which position and velocity (dof,) are commanded."""
        self.q = q.copy()
        if not self.dynamic:
            return
        data = self._data
        for left in np.arange(round(duration / PERIOD))[::-1] * PERIOD:
            error = q - left * velocity - data.qpos
            change = velocity - data.qvel
            torque = np.empty(len(q))
            self._mujoco.mj_mulM(
                self._model, data, torque, BANDWIDTH**2 * error + 2.0 * BANDWIDTH * change
            )
            torque = np.clip(torque + data.qfrc_bias, -self._efforts, self._efforts)
            self.largest_share = max(
                self.largest_share, float(np.abs(torque / self._efforts).max())
            )
            data.qfrc_applied[:] = torque
            self._mujoco.mj_step(self._model, data)
        self.q = data.qpos.copy()


def model_spec(arm: Arm | ArmGroup) -> Any:
    """Return an arm or a group as a specification of MuJoCo, without shapes."""
    package = mujoco()
    robot = robot_model(arm)
    spec = package.MjSpec()
    spec.option.timestep = PERIOD
    spec.option.gravity = robot.gravity.linear
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-6  # massless links between two joints
    bodies = [spec.worldbody]
    for joint, parent, place, link in zip(
        list(robot.joints)[1:],
        list(robot.parents)[1:],
        list(robot.jointPlacements)[1:],
        list(robot.inertias)[1:],
        strict=True,
    ):
        quaternion = np.empty(4)
        package.mju_mat2Quat(quaternion, place.rotation.ravel())
        body = bodies[parent].add_body(pos=place.translation, quat=quaternion)
        about_center = link.inertia + 1e-9 * np.eye(3)
        body.explicitinertial = True
        body.mass = link.mass
        body.ipos = link.lever
        body.fullinertia = about_center[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        data = joint.createData()
        joint.calc(data, np.zeros(joint.nq))
        axis = np.ravel(data.S)
        slides = not np.any(np.ravel(data.S)[3:])
        if slides:
            kind = package.mjtJoint.mjJNT_SLIDE
        else:
            kind = package.mjtJoint.mjJNT_HINGE
        body.add_joint(type=kind, axis=axis[:3] if slides else axis[3:])
        bodies.append(body)
    return spec


class Simulation:
    """Frames of a recording lead a simulated robot; keeps position errors and lags of the servos."""

    def __init__(self, live: Live):
        self.robot = SimulatedRobot(live.robot, live.joint_positions)
        self._live = live
        self._time: float | None = None
        # position errors of the simulated robot while the person is followed [m]
        self.errors: list[float] = []
        self.lag = 0.0  # largest distance of a joint from its command [rad or m]

    def step(self, points: Array | None, time: float) -> LiveState:
        """Let the robot follow a frame; return the state of the simulated robot."""
        state = self._live.step(points, time)
        self.robot.move(state.joint_positions, state.joint_velocities, time - (self._time or time))
        self._time = time
        arms = []
        self.lag = max(self.lag, float(np.abs(self.robot.q - state.joint_positions).max()))
        for arm, pose in zip(
            state.arms, as_group(self._live.robot).forward(self.robot.q), strict=True
        ):
            if arm.target_position is None:
                error = None
            else:
                error = math.dist(pose[:3, 3], arm.target_position)
            arms.append(replace(arm, position=pose[:3, 3], position_error=error))
        state = replace(state, joint_positions=self.robot.q, arms=tuple(arms))
        if state.position_error is not None and state.state in ("following", "lagging"):
            self.errors.append(state.position_error)
        return state

    def __str__(self) -> str:
        if self.robot.limited:
            share = f"at most {100.0 * self.robot.largest_share:.0f} %"
        else:
            share = "without limits"
        servo = f"servo lag at most {self.lag:.3f} rad, torque {share}"
        if self.robot.dynamic:
            text = servo
        else:
            text = "robot without masses: no dynamics"
        if self.errors:
            return f"{errors_text(self.errors)}; {text}"
        return text
