"""From a recording of a person to the joint angles of an arm."""

from maniport.demonstrations.arm_fit import fit_arm
from maniport.demonstrations.arm_fit_result import ArmFit
from maniport.demonstrations.both_arms import ArmFits, fit_arms
from maniport.demonstrations.marker_sets import DIALECTS
from maniport.demonstrations.readers import READERS, read_recording, shipped_recording
from maniport.demonstrations.recording import Recording
from maniport.demonstrations.synthetic import performed

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
