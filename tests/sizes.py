"""Sizes for tests that look at the way and not at how good the figures are."""

from dataclasses import replace
from unittest import mock

from maniport.motion import RobotMotion
from maniport.motion.plan.plan_settings import PlanSettings
from maniport.pipeline import MotionResult
from maniport.pipeline.results import ArmResult

SMALL = {"n_teacher": 128, "n_student": 256}
"""Sizes of domains."""


def smaller_search(**budget):
    """Patch the search budget of placement and planning."""
    return mock.patch.object(PlanSettings, "budget", replace(PlanSettings.budget, **budget))


def few_places(**budget):
    """Patch the search budget so that few placements are tried."""
    return smaller_search(**{"candidates": 64, "placement_nodes": 24} | budget)


def with_arm(result, **changes):
    """Return a result of one arm with other attributes of the arm, and its motion."""
    arm = replace(result.arm, **changes)
    return replace(result, arms=(arm,), motion=RobotMotion(result.robot, arm.motion, (arm.motion,)))


def motion_alone(result):
    """Return the motion of a transfer as a result without a person."""
    names = ("name", "robot", "placement", "motion", "free", "gap", "collisions")
    arm = ArmResult(**{name: getattr(result.arm, name) for name in names})
    return MotionResult(robot=result.robot, arms=(arm,), motion=result.motion)
