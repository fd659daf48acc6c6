"""Motions of robots: feasible ellipsoids, placement of paths, planning, time parameterization and control.

Targets are in the arm's base frame.
"""

from maniport.motion.arm_model import robot_model
from maniport.motion.collision_limit import Limit
from maniport.motion.configurations import Configurations
from maniport.motion.costs.cost import Cost
from maniport.motion.exports import export_motion
from maniport.motion.feasible import FeasibleEllipsoids, FeasibleProjector, nearest_feasible
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.placement.options import PlacementOptions
from maniport.motion.placement.place_path import place_path
from maniport.motion.placement.placement import Placement
from maniport.motion.plan.group_planner import Planner
from maniport.motion.plan.plan_motion import plan_motion
from maniport.motion.plan.plan_options import PlanOptions
from maniport.motion.robot_motion import ArmMotion, RobotMotion
from maniport.motion.search import SeedBank
from maniport.motion.targets import TargetTrajectory
from maniport.motion.tracker import TrackOptions, track
from maniport.motion.trajectory import Clearance, Trajectory

__all__ = [
    "ArmMotion",
    "Clearance",
    "Configurations",
    "Cost",
    "FeasibleEllipsoids",
    "FeasibleProjector",
    "Limit",
    "MotionLimits",
    "Placement",
    "PlacementOptions",
    "PlanOptions",
    "Planner",
    "RobotMotion",
    "SeedBank",
    "TargetTrajectory",
    "TrackOptions",
    "Trajectory",
    "export_motion",
    "nearest_feasible",
    "place_path",
    "plan_motion",
    "robot_model",
    "track",
]
