"""Curve of the end-effector speed in the report."""

from dataclasses import replace

import numpy as np

from maniport.report import report_of
from maniport.report.page import write_page
from maniport.report.page.animation import animation_of
from maniport.report.page.content import Line, Panel


def write_page_with_speed(path, result):
    """Write the report of a run with a panel of the end-effector speed."""
    motion = result.arm.motion
    positions = result.arm.robot.forward(motion.joint_positions)[:, :3, 3]
    speed = np.linalg.norm(np.gradient(positions, motion.time, axis=0), axis=1)
    panel = Panel(
        "End-effector speed", "m/s", (Line("", speed),), "Speed during the robot's motion."
    )
    animation = animation_of(result)
    animation = replace(animation, panels={**animation.panels, "Speed": (panel,)})
    write_page(path, report_of(result), animation)
