"""Physics check in MuJoCo.

A Panda with masses and torque limits replays the motion of example 06 with a joint controller, with and without
velocity feed-forward. The program reports joint lag, position error, change of the ellipsoids and torques. It fails if
the distance changes by 0.02 or more (95 %) or a motor reaches its limit. Not modeled: friction, motor inertia.
Needs `pip install mujoco`. Usage: python 08_replay_in_mujoco.py [FOLDER]
"""

import runpy
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline

import maniport as mp
from maniport.motion import ArmMotion, robot_model

HERE = Path(__file__).parent
STIFFNESS = np.array(
    [600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0]
)  # libfranka's joint impedance example [N m/rad]
DAMPING = np.array([50.0, 50.0, 50.0, 50.0, 30.0, 25.0, 15.0])  # of the same example [N m s/rad]


def physical_panda(arm):
    """Return a MuJoCo model of arm and hand with position servos; the motors compensate gravity."""
    kinematics, spec = robot_model(arm), mujoco.MjSpec()
    spec.option.timestep, spec.option.integrator = (
        1e-3,
        mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    )  # explicit is unstable
    links, body = (
        arm.chain.inertia[1:],
        spec.worldbody,
    )  # spatial inertia of each link, the last with the hand
    for i, (pose, link) in enumerate(zip(kinematics.jointPlacements[1:], links, strict=True)):
        x, y, z, w = pin.SE3ToXYZQUAT(pose)[3:]
        body = body.add_body(pos=pose.translation, quat=(w, x, y, z), gravcomp=1.0)
        body.explicitinertial, body.mass, body.ipos = (
            True,
            link[0, 0],
            link[[5, 3, 4], [1, 2, 0]] / link[0, 0],
        )
        about_center = link[3:, 3:] + body.mass * np.linalg.matrix_power(pin.skew(body.ipos), 2)
        body.fullinertia = about_center[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        torque = arm.effort_limits[i]
        body.add_joint(
            name=f"joint{i + 1}", actfrcrange=(-torque, torque), actgravcomp=True
        )  # all rotate about z
        servo = spec.add_actuator(target=f"joint{i + 1}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=STIFFNESS[i], kv=DAMPING[i])
    return spec.compile()


def replay(model, motion, feed_forward):
    """Return times [s], commanded and achieved joints [rad] and torques over their limits, at 1 kHz."""
    data, spline = mujoco.MjData(model), CubicSpline(motion.control_time, motion.control_positions)
    time = np.arange(motion.control_time[0], motion.control_time[-1] + 1e-3, 1e-3)
    planned, velocity = spline(time), spline(time, 1)
    # The servo's torque kp (command - q) - kd dq becomes kp (planned - q) + kd (velocity - dq).
    command = planned + feed_forward * DAMPING / STIFFNESS * velocity
    achieved, torque = np.empty_like(planned), np.empty_like(planned)
    data.qpos, data.qvel = planned[0], velocity[0]
    for i in range(len(time)):
        achieved[i], data.ctrl = data.qpos, command[i]
        mujoco.mj_step(model, data)
        torque[i] = data.qfrc_actuator  # includes gravity compensation
    return time, planned, achieved, torque / model.jnt_actfrcrange[:, 1]


def main(folder):
    """Return the change of d (95 %), the largest torque over its limit, and the replay, with feed-forward."""
    motion, arm = (
        runpy.run_path(str(HERE / "06_place_and_track.py"))["main"](folder),
        mp.load_arm("panda"),
    )
    for feed_forward in (False, True):
        time, planned, q, torque = replay(physical_panda(arm), motion, feed_forward)
        real = ArmMotion.of_motion(
            arm, motion.time, motion.target, time, q, damping=motion.damping, path=motion.path
        )
        change, peak = (
            np.percentile(np.abs(real.distance - motion.distance), 95),
            np.abs(torque).max(),
        )
        lag, error = (
            np.degrees(np.abs(q - planned).max()),
            1e3 * np.percentile(real.position_error, (95, 100)),
        )
        print(
            f"{'with' if feed_forward else 'without'} velocity feed-forward: change of d {change:.4f} (95 %); position "
            f"error [mm] {error[0]:.1f} (95 %), {error[1]:.1f} (max); lag {lag:.2f}° (max); torque {peak:.0%} (max)"
        )
    return change, peak, (time, planned, q, torque)


if __name__ == "__main__":
    change, peak, _ = main(
        Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-"))
    )
    if change >= 0.02 or peak >= 1.0:
        sys.exit(f"failed: change of d {change:.4f} (limit 0.02), torque {peak:.0%} (limit 100 %)")
