"""Ellipsoid task in Pink.

`EllipsoidTask` works with Pink's frame and posture tasks in a loop of `pink.solve_ik` (extra: pink). With the position
constrained, a 7-joint arm is redundant, and without the task its ellipsoids drift. `maniport.track` is such a loop
without Pink, with acceleration limits and a search for the start configuration.

    python 05_follow_a_profile.py [FOLDER]
"""

import sys
import tempfile
import time as clock
from pathlib import Path

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import FrameTask, PostureTask

import maniport as mp
from maniport.motion import robot_model
from maniport.motion.pink_task import EllipsoidTask

RATE = 200.0  # control steps a second [Hz]
TIME = np.arange(0.0, 4.0, 1.0 / RATE)  # [s]
HOME = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])  # [rad]


def wanted_motion(arm):
    """Ellipsoids (n, 3, 3) and hand positions (n, 3) that the arm can make: those of a swing of all its joints."""
    swing = np.array([0.5, 0.3, -0.4, 0.4, 0.6, 0.3, 0.0])
    joints = HOME + swing * np.sin(0.5 * np.pi * TIME[:, None])
    return arm.manipulability(joints), arm.forward(joints)[:, :3, 3]


def follow(arm, profile, path, with_ellipsoids):
    """Joint positions (n, dof) of Pink's loop, which starts from HOME."""
    model = robot_model(arm)  # a plain Pinocchio model with the arm's limits; one from a URDF does as well
    ellipsoid = EllipsoidTask(arm, cost=1.0)
    position = FrameTask(arm.frame, position_cost=200.0, orientation_cost=0.0)  # cost of a meter
    posture = PostureTask(cost=1e-2)  # holds what nothing else does: here the last joint
    posture.set_target(HOME)
    tasks = [position, posture] + ([ellipsoid] if with_ellipsoids else [])
    configuration = pink.Configuration(model, model.createData(), HOME)
    joints = np.empty((len(TIME), arm.dof))
    for i in range(len(TIME)):
        ellipsoid.set_target(profile[i])
        position.set_target(pin.SE3(np.eye(3), path[i]))
        velocity = pink.solve_ik(configuration, tasks, 1.0 / RATE, solver="daqp")  # within the model's limits
        configuration.integrate_inplace(velocity, 1.0 / RATE)
        joints[i] = configuration.q
    return joints


def main(folder):
    """Follow the same motion without and with the ellipsoid task, and write what came of both."""
    folder.mkdir(parents=True, exist_ok=True)
    arm = mp.load_arm("panda")
    profile, path = wanted_motion(arm)
    found = {}
    for with_ellipsoids in (False, True):
        began = clock.perf_counter()
        joints = follow(arm, profile, path, with_ellipsoids)
        rate = len(TIME) / (clock.perf_counter() - began)
        d = mp.spd.distance(profile, arm.manipulability(joints))
        beside = 1e3 * np.linalg.norm(arm.forward(joints)[:, :3, 3] - path, axis=1)
        name = "with" if with_ellipsoids else "without"
        found |= {f"joints_{name}": joints, f"distance_{name}": d}
        print(
            f"{name:>7} the ellipsoid task: d {np.median(d):.3f} (median), "
            f"{np.percentile(d, 95):.3f} (95 %), {d.max():.3f} (largest, at {TIME[d.argmax()]:.1f} s); hand "
            f"{np.percentile(beside, 95):.2f} mm beside its path (95 %), at most {beside.max():.2f}; {rate:.0f} steps/s"
        )
    np.savez(folder / "joints.npz", time=TIME, target=profile, **found)
    print(f"joints in {folder / 'joints.npz'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
