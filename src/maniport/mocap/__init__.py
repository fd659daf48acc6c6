"""From a recording of a person to the joint angles of an arm."""

from maniport.mocap.arm_fit import ArmFit, HumanMotion
from maniport.mocap.arm_ik import fit_arm, fit_arms
from maniport.mocap.directions import synthetic_recording
from maniport.mocap.readers import READERS, read_recording, shipped_recording
from maniport.mocap.recording import Recording
from maniport.mocap.roles import MARKER_SETS

__all__ = [
    "MARKER_SETS",
    "READERS",
    "ArmFit",
    "HumanMotion",
    "Recording",
    "fit_arm",
    "fit_arms",
    "read_recording",
    "shipped_recording",
    "synthetic_recording",
]
