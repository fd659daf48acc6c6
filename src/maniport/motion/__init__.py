"""Motions of robots: feasible ellipsoids, placement of paths, planning, time parameterization and control.

Target ellipsoids and positions are plain arrays, in the arm's base frame.
"""

import importlib
from typing import TYPE_CHECKING, Any

from maniport.motion.objective import Objective
from maniport.motion.search.feasible import FeasibleEllipsoids, feasibility_gap, nearest_feasible
from maniport.motion.search.projector import FeasibleProjector, FeasibleSearch
from maniport.motion.search.seed_bank import SeedBank

if TYPE_CHECKING:
    from maniport.motion.arm_model import robot_model
    from maniport.motion.arm_motion import ArmMotion
    from maniport.motion.controller import Controller, ControlProblem, ControlState
    from maniport.motion.exports import export_motion
    from maniport.motion.limits import BrakingLimit, CollisionLimit, Limit
    from maniport.motion.motion_limits import LimitUse, MotionLimits
    from maniport.motion.placement.placed_path import Place, Placement
    from maniport.motion.placement.placement import place_path
    from maniport.motion.plan.home_motion import with_approach
    from maniport.motion.plan.plan_control import PlanControl
    from maniport.motion.plan.plan_motion import plan_motion
    from maniport.motion.plan.planner import Planner
    from maniport.motion.plan.reachability_map import ReachabilityMap
    from maniport.motion.plan.time_parameterization import Timed, retime
    from maniport.motion.problem import Cost, MotionProblem, RelativePositionCost
    from maniport.motion.robot_motion import RobotMotion
    from maniport.motion.tracker import Control, track
    from maniport.motion.trajectory import Clearance, Trajectory

_LAZY = {
    "arm_model": ("robot_model",),
    "arm_motion": ("ArmMotion",),
    "controller": ("Controller", "ControlProblem", "ControlState"),
    "exports": ("export_motion",),
    "limits": ("BrakingLimit", "CollisionLimit", "Limit"),
    "motion_limits": ("LimitUse", "MotionLimits"),
    "placement.placed_path": ("Place", "Placement"),
    "placement.placement": ("place_path",),
    "plan.home_motion": ("with_approach",),
    "plan.plan_control": ("PlanControl",),
    "plan.plan_motion": ("plan_motion",),
    "plan.planner": ("Planner",),
    "plan.reachability_map": ("ReachabilityMap",),
    "plan.time_parameterization": ("Timed", "retime"),
    "problem": ("Cost", "MotionProblem", "RelativePositionCost"),
    "robot_motion": ("RobotMotion",),
    "tracker": ("Control", "track"),
    "trajectory": ("Clearance", "Trajectory"),
}
"""Names by module, loaded on first use, since some modules import slowly."""
_HOMES = {name: module for module, names in _LAZY.items() for name in names}

__all__ = [
    "ArmMotion",
    "BrakingLimit",
    "Clearance",
    "CollisionLimit",
    "Control",
    "ControlProblem",
    "ControlState",
    "Controller",
    "Cost",
    "FeasibleEllipsoids",
    "FeasibleProjector",
    "FeasibleSearch",
    "Limit",
    "LimitUse",
    "MotionLimits",
    "MotionProblem",
    "Objective",
    "Place",
    "Placement",
    "PlanControl",
    "Planner",
    "ReachabilityMap",
    "RelativePositionCost",
    "RobotMotion",
    "SeedBank",
    "Timed",
    "Trajectory",
    "export_motion",
    "feasibility_gap",
    "nearest_feasible",
    "place_path",
    "plan_motion",
    "retime",
    "robot_model",
    "track",
    "with_approach",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'maniport.motion' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"maniport.motion.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
