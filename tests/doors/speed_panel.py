"""A figure of one's own in the page: how fast the robot's tip moves."""

from dataclasses import replace

import numpy as np

from maniport.report import report_of
from maniport.report.page import Line, Panel, write_page
from maniport.report.page.animation import animation_of


def write_page_with_speed(path, result):
    """Write the page of a run with one figure more, whose cursor moves with the arms."""
    motion = result.arm.motion
    tips = result.arm.robot.forward(motion.joint_positions)[:, :3, 3]
    speed = np.linalg.norm(np.gradient(tips, motion.time, axis=0), axis=1)
    panel = Panel("Speed of the tip", "m/s", (Line("", speed),), "At the robot's speed_scale.")
    shown = animation_of(result)
    shown = replace(shown, panels={**shown.panels, "Speed": (panel,)})
    write_page(path, report_of(result), {"motion": [shown]})
