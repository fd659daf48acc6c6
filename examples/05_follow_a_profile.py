"""Ellipsoid task in Pink.

`EllipsoidTask` (`pink_task.py`) works with Pink's frame and posture tasks in a loop of `pink.solve_ik` (extra: pink).
With the position constrained, a 7-joint arm is redundant, and without the task its ellipsoids drift. `maniport.track`
is such a loop without Pink, with acceleration limits and a search for the start configuration.

    python 05_follow_a_profile.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import FrameTask, PostureTask

import maniport as mp
from maniport.motion import robot_model
from pink_task import EllipsoidTask

RATE = 200.0  # control rate [Hz]
TIME = np.arange(0.0, 4.0, 1.0 / RATE)  # [s]
HOME = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])  # [rad]


def target_motion(arm):
    """Return feasible ellipsoids (n, 3, 3) and positions (n, 3) [m] of the end effector."""
    amplitude = np.array([0.5, 0.3, -0.4, 0.4, 0.6, 0.3, 0.0])
    joints = HOME + amplitude * np.sin(0.5 * np.pi * TIME[:, None])
    return arm.manipulability(joints), arm.forward(joints)[:, :3, 3]


def follow(arm, profile, path, with_ellipsoids):
    """Return the joint positions (n, dof) of Pink's loop, starting from HOME."""
    model = robot_model(arm)  # a Pinocchio model with the arm's limits, like one from a URDF
    ellipsoid = EllipsoidTask(arm, cost=1.0)
    position = FrameTask(arm.frame, position_cost=200.0, orientation_cost=0.0)  # [1/m]
    posture = PostureTask(cost=1e-2)  # determines the last joint, which the other tasks do not
    posture.set_target(HOME)
    tasks = [position, posture] + ([ellipsoid] if with_ellipsoids else [])
    configuration = pink.Configuration(model, model.createData(), HOME)
    joints = np.empty((len(TIME), arm.dof))
    for i in range(len(TIME)):
        ellipsoid.set_target(profile[i])
        position.set_target(pin.SE3(np.eye(3), path[i]))
        velocity = pink.solve_ik(
            configuration, tasks, 1.0 / RATE, solver="daqp"
        )  # within the model's limits
        configuration.integrate_inplace(velocity, 1.0 / RATE)
        joints[i] = configuration.q
    return joints


def main(folder):
    """Follow the same motion without and with the ellipsoid task."""
    folder.mkdir(parents=True, exist_ok=True)
    arm = mp.load_arm("panda")
    profile, path = target_motion(arm)
    arrays = {"time": TIME, "target": profile}
    for name in ("without", "with"):
        start = perf_counter()
        joints = follow(arm, profile, path, name == "with")
        rate = len(TIME) / (perf_counter() - start)
        d = mp.spd.distance(profile, arm.manipulability(joints))
        error = 1e3 * np.linalg.norm(arm.forward(joints)[:, :3, 3] - path, axis=1)
        arrays |= {f"joints_{name}": joints, f"distance_{name}": d}
        print(
            f"{name:>7} ellipsoid task: distance {np.median(d):.3f} (median), {np.percentile(d, 95):.3f} (95 %), "
            f"{d.max():.3f} (max at {TIME[d.argmax()]:.1f} s); position error [mm] {np.percentile(error, 95):.2f} "
            f"(95 %), {error.max():.2f} (max); {rate:.0f} steps/s"
        )
    np.savez(folder / "joints.npz", **arrays)
    print(f"joints in {folder / 'joints.npz'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
