"""Teleoperation of a LeRobot robot by ``maniport live``."""

from lerobot_teleoperator_maniport.config_maniport import ManiportTeleopConfig
from lerobot_teleoperator_maniport.maniport_teleop import ManiportTeleop

__all__ = ["ManiportTeleop", "ManiportTeleopConfig"]
