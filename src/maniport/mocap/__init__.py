"""From a recording of a person to the joint angles of an arm."""

from maniport.mocap.arm_ik import fit_arm
from maniport.mocap.arm_ik_result import ArmFit
from maniport.mocap.both_arms import ArmFits, fit_arms
from maniport.mocap.marker_sets import DIALECTS
from maniport.mocap.readers import READERS, read_recording, shipped_recording
from maniport.mocap.recording import Recording
from maniport.mocap.synthetic import performed

__all__ = [
    "DIALECTS",
    "READERS",
    "ArmFit",
    "ArmFits",
    "Recording",
    "fit_arm",
    "fit_arms",
    "performed",
    "read_recording",
    "shipped_recording",
]
