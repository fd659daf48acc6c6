"""Sizes for tests that look at the way and not at how good the figures are."""

from contextlib import contextmanager
from dataclasses import replace
from unittest import mock

import numpy as np

from maniport.arms import load_arm
from maniport.motion.plan import plan_options
from maniport.motion.plan.plan_options import PlacementRound
from maniport.pipeline import MotionResult
from maniport.pipeline.results import ArmResult

SIX_ROWS = [  # like a UR5
    [0, 0.089, 0, np.pi / 2],
    [0, 0, -0.425, 0],
    [0, 0, -0.392, 0],
    [0, 0.109, 0, np.pi / 2],
    [0, 0.095, 0, -np.pi / 2],
    [0, 0.082, 0, 0],
]
SMALL = {"n_teacher": 128, "n_student": 256}
"""Sizes of domains."""


@contextmanager
def little_search(**budget):
    """Patch the search budget so that little is searched, with a small reachability map, for results that any do."""
    rounds = (
        PlacementRound(32, 8, 30.0, 4),
        PlacementRound(8, 12, 60.0, 6),
        PlacementRound(2, 24, 200.0, 20),
    )
    less = {"candidates": 64, "rounds": rounds, "nodes": 150, "stage": 1.0, "rel_tol": 1e-3}
    gap = {"pointwise_starts": 8, "gap_points": 40, "gap_starts": 16}
    few = replace(plan_options.DEFAULT_BUDGET, **less | gap | budget)
    with (
        mock.patch.object(plan_options, "DEFAULT_BUDGET", few),
        mock.patch("maniport.motion.plan.reachability_map.SAMPLES", 10_000),
    ):
        yield


def motion_alone(result):
    """Return the motion of a transfer as a result without a person."""
    names = ("name", "robot", "placement", "motion", "gap", "collisions")
    arm = ArmResult(**{name: getattr(result.arm, name) for name in names})
    return MotionResult(robot=result.robot, arms=(arm,), config=result.config, motion=result.motion)


def panda_profile(count=11):
    """Return the Panda, and times, joint positions, ellipsoids and end-effector positions of a short motion."""
    panda = load_arm("panda")
    time = np.linspace(0.0, 1.0, count)
    joints = np.linspace(
        [0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.0], [0.3, -0.4, 0.1, -1.8, 0.1, 1.7, 0.0], count
    )
    return panda, time, joints, panda.manipulability(joints), panda.forward(joints)[:, :3, 3]
