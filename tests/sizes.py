"""Sizes for tests that look at the way and not at how good the figures are."""

from contextlib import contextmanager
from dataclasses import replace
from unittest import mock

import numpy as np

from maniport.arms import load_arm
from maniport.motion import RobotMotion
from maniport.motion.plan.plan_settings import EFFORTS
from maniport.pipeline import MotionResult
from maniport.pipeline.results import ArmResult

SMALL = {"n_teacher": 128, "n_student": 256}
"""Sizes of domains."""


@contextmanager
def few_places(**sizes):
    """Patch every effort so that few placements are tried, with a small reachability map; prefer ``effort="quick"``."""
    few = {"candidates": 64, "placement_nodes": 24} | sizes
    efforts = {name: replace(effort, **few) for name, effort in EFFORTS.items()}
    with mock.patch.dict(EFFORTS, efforts), mock.patch("maniport.motion.plan.reachability_map.SAMPLES", 10_000):
        yield


def with_arm(result, **changes):
    """Return a result of one arm with other attributes of the arm, and its motion."""
    arm = replace(result.arm, **changes)
    return replace(result, arms=(arm,), motion=RobotMotion(result.robot, arm.motion, (arm.motion,)))


def motion_alone(result):
    """Return the motion of a transfer as a result without a person."""
    names = ("name", "robot", "placement", "motion", "free", "gap", "collisions")
    arm = ArmResult(**{name: getattr(result.arm, name) for name in names})
    return MotionResult(robot=result.robot, arms=(arm,), motion=result.motion)


def panda_profile(count=11):
    """Return the Panda, and times, joint positions, ellipsoids and end-effector positions of a short motion."""
    panda, time = load_arm("panda"), np.linspace(0.0, 1.0, count)
    joints = np.linspace([0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.0], [0.3, -0.4, 0.1, -1.8, 0.1, 1.7, 0.0], count)
    return panda, time, joints, panda.manipulability(joints), panda.forward(joints)[:, :3, 3]
