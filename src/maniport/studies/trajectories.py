"""The arms and the motions of the paper's experiments, and every choice that the paper leaves open.

Reithmeir, Figueredo and Haddadin, IROS 2022 (arXiv 2208.07588), §§ V-A and V-B; the angles of the human trajectories
and of M-Eval-1 and -2 are facts of the authors' published code. What neither contains is chosen here, once:

- Two-joint arms, training: which angles the resting joint has, and where the half turn of the other begins.
- M-Eval-2: where its half turn begins. M-Eval-3: a second resting angle of joint 1, since the paper's errors for
  M-Eval-2 and M-Eval-3 almost agree in every row.
- Which number the human trajectories have: only H-Eval-4, an upward motion of the extended arm, is described.
- The elbow-and-shoulder fold: axial rotation goes to its upper limit (inward) together with the other two joints.
- The Panda's trajectories: see `robot_path`.
"""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm, load_arm, rhuman
from maniport.mocap.arm_path import JointPriors, solve_path
from maniport.util.validation import Array

MOUNTING = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""Base of the vertical two-joint arm, the student; the teacher's is the identity. A quarter turn about y."""


def two_dof_arms() -> tuple[Arm, Arm]:
    """Teacher and student of § V-A: two links of one meter, in the horizontal x-y and in the vertical y-z plane."""
    links = [[0, 0, 1, 0], [0, 0, 1, 0]]
    return Arm.from_dh("horizontal", links), Arm.from_dh("vertical", links, base=MOUNTING)


def two_dof_training() -> Array:
    """Twenty trajectories of 20 configurations, shape (20, 20, 2) [rad]: one joint rests, the other turns by 180°."""
    resting = range(-180, 180, 36)  # ten angles around the circle [deg], zero among them; chosen
    paths = []
    for angle in resting:
        for moving in (0, 1):
            paths.append(_half_turn(moving, angle))
    return np.stack(paths)


def two_dof_evaluation() -> dict[str, Array]:
    """M-Eval-1 to -3, each of shape (20, 2) [rad]; none of them is in the training set."""
    return {
        "M-Eval-1": _half_turn(0, -135),
        "M-Eval-2": _half_turn(1, -110),
        "M-Eval-3": _half_turn(1, 65),
    }


HUMAN_LIMITS = ((-90, 130), (0, 180), (-80, 40), (0, 130), (-90, 90), (0, 25), (-60, 60))
"""Limits of the human arm's joints in the paper [degrees], narrower than those of people."""


def human_arm() -> Arm:
    """Make rHuMan with the paper's segments and limits: upper arm 0.302 m, forearm 0.2795 m, hand 0.05 m."""
    arm = rhuman(upper_arm=0.302, forearm=0.2795, hand=0.05)
    lower, upper = np.radians(HUMAN_LIMITS).T
    return Arm(replace(arm.chain, lower=lower, upper=upper))


def human_training() -> list[Array]:
    """Four sideways and four upward motions of the extended arm, each of shape (50, 7) [rad]."""
    paths = []
    for angle in (90, 110, 120, 150):
        paths.append(_human(plane=(-90, 130), elevation=angle))
    for angle in (0, 30, 45, 90):
        paths.append(_human(plane=angle, elevation=(79, 180)))
    return paths


def human_evaluation() -> dict[str, Array]:
    """H-Eval-1 to -4, each of shape (50, 7) [rad]."""
    inward = float(np.degrees(human_arm().upper[2]))
    return {
        "H-Eval-1": _human(plane=(-90, 130), elevation=140),
        "H-Eval-2": _human(elevation=90, elbow=(0, 130)),
        "H-Eval-3": _human(plane=(0, 90), elevation=90, axial=(0, inward), elbow=(0, 90)),
        "H-Eval-4": _human(plane=60, elevation=(79, 180)),
    }


@cache
def robot_arm() -> Arm:
    """Return the Panda to its flange, in the frame of the person's trunk: x forward, z up."""
    return load_arm("panda", frame="panda_link8")


def robot_targets(path: ArrayLike, reach: float = 0.815) -> tuple[Array, Array]:
    """Positions of the Panda's flange for a joint path (n, 7) of the human arm, and of its shoulder, in its base frame.

    While the human arm is extended, the flange is `reach` from the shoulder; its farthest is 0.858 m.
    """
    arm = human_arm()
    shoulder = np.array([0.0, 0.0, 0.333])  # where the axes of its first three joints meet [m]
    extended = float(np.linalg.norm(arm.forward(np.zeros(arm.dof))[:3, 3]))
    return np.asarray(shoulder + reach / extended * arm.forward(path)[:, :3, 3]), shoulder


def robot_path(path: ArrayLike, pull: float = 1e-3, smoothing: float = 0.1) -> Array:
    """Joint path of the Panda whose flange follows the scaled hand path of the human arm, shape (n, 7) [rad].

    The weights [m/rad] are those of the ready position and of second differences, relative to the position error.
    """
    arm = robot_arm()
    targets, shoulder = robot_targets(path)

    def residual(q: Array) -> tuple[Array, Array]:
        return arm.forward(q)[:, :3, 3] - targets, arm.jacobian(q)[:, :3]

    ahead = targets - shoulder
    facing = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    if np.linalg.norm(ahead[:, :2], axis=1).min() < 0.05:  # overhead, the direction means nothing
        facing[:] = facing[0]
    facing -= 2 * np.pi * np.round(np.mean(facing) / (2 * np.pi))
    ready = (0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4)  # the usual one
    start = np.tile(ready, (len(targets), 1))
    start[:, 0] = np.clip(facing, arm.lower[0], arm.upper[0])
    neutral = start.mean(axis=0)
    weights = np.full(start.shape, smoothing)
    weights[[0, -1]] = 0.0
    priors = JointPriors(arm.lower, arm.upper, np.full(arm.dof, pull), neutral)
    return solve_path(residual, start, priors, weights)


def _half_turn(moving: int, resting: float) -> Array:
    """Turn one joint from 0° to 180° while the other rests [deg]; shape (20, 2) [rad]."""
    path = np.full((20, 2), np.radians(resting))
    path[:, moving] = np.linspace(0.0, np.pi, 20)
    return path


def _human(
    plane: float | tuple[float, float] = 0,
    elevation: float | tuple[float, float] = 0,
    axial: float | tuple[float, float] = 0,
    elbow: float | tuple[float, float] = 0,
) -> Array:
    """Joint path of the human arm from angles [deg] that rest or go from start to end; shape (50, 7) [rad]."""
    path = np.zeros((50, 7))  # eight make the paper's 400
    for joint, angle in enumerate((plane, elevation, axial, elbow)):
        ends = angle if isinstance(angle, tuple) else (angle, angle)
        path[:, joint] = np.radians(np.linspace(*ends, len(path)))
    return path
