"""Robots of example-robot-data, and one motion transferred to them: adapted, placed, planned and tracked."""

import time as clock
from dataclasses import dataclass
from pathlib import Path
from sysconfig import get_paths
from typing import Any

import numpy as np

import maniport as mp
from maniport.arms import VELOCITY, Arm
from maniport.motion import (
    MotionLimits,
    Planner,
    PlanOptions,
    TargetTrajectory,
    place_path,
    plan_motion,
    track,
)
from maniport.util.defaults import STUDENT_SAMPLES, TEACHER_SAMPLES

from .inputs import DAMPING, Array
from .motions import Motion

FILES = Path(get_paths()["purelib"]) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
"""Folder of the package example-robot-data."""

ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "UR5": ("ur_description/urdf/ur5_robot.urdf", {}),
    "xArm7": ("xarm_description/urdf/xarm7.urdf", {}),
    "Talos, left arm": (
        "talos_data/robots/talos_reduced.urdf",
        {"frame": "arm_left_7_link", "joints": [f"arm_left_{i}_joint" for i in range(1, 8)]},
    ),
    "Tiago, arm": (
        "tiago_description/robots/tiago_no_hand.urdf",
        {"frame": "arm_tool_link", "joints": [f"arm_{i}_joint" for i in range(1, 8)]},
    ),
    "G1, left arm": (
        "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        {
            "frame": "left_wrist_yaw_link",
            "joints": [
                *(f"left_shoulder_{axis}_joint" for axis in ("pitch", "roll", "yaw")),
                "left_elbow_joint",
                *(f"left_wrist_{axis}_joint" for axis in ("roll", "pitch", "yaw")),
            ],
        },
    ),
}
"""Robot files and options. The base of Talos is its pelvis, that of Tiago the floor."""


@dataclass(frozen=True)
class Comparison:
    """One motion on one robot, planned and tracked; n waypoints."""

    planned: Array  # (n,), distances of the planned motion
    tracked: Array  # (n,), distances of the tracked motion
    planned_error: Array  # (n,), position errors of the plan [m]
    collisions: float  # share of the plan's samples that collide
    seconds: float  # processor time of sampling, placement and plan [s]


def transferred(name: str, motion: Motion) -> Comparison:
    """Adapt a motion to a robot, place and plan it, and let the tracker follow the same targets."""
    robot = load_robot(name)
    student = mp.sample_domain(robot, STUDENT_SAMPLES, 1)
    teacher = mp.sample_domain(motion.person, TEACHER_SAMPLES, 0)
    adapter = mp.ScaledTransport(damping=DAMPING, base_rotation=np.eye(3)).fit(teacher, student)
    damping = adapter.student_regularization
    time = motion.robot_time
    begin = clock.process_time()
    planner = Planner.of(MotionLimits.of(robot), VELOCITY)
    targets = TargetTrajectory.checked(
        robot, time, adapter.transform(motion.profile), positions=motion.hand, damping=damping
    )
    options = PlanOptions(position_tolerance=1e-3)
    placed = place_path(robot, targets, planner=planner, plan=options)[0]
    (plan,) = plan_motion(
        robot, placed.moved(targets), options, planner=planner, starts=[placed.joint_positions]
    ).arms
    seconds = clock.process_time() - begin
    # the tracker has the same margin of the joint limits as the plan
    arm = planner.limits.arm
    followed = TargetTrajectory.checked(
        arm, time, placed.profile, positions=placed.path, damping=damping
    )
    (tracked,) = track(arm, followed, start=plan.joint_positions[0]).arms
    return Comparison(
        plan.distance, tracked.distance, plan.position_error, plan.clearance.share, seconds
    )


def load_robot(name: str) -> Arm:
    """Load a robot of `ROBOTS`."""
    file, options = ROBOTS[name]
    return mp.load_arm(FILES / file, **options)
