"""How a motion goes, moment by moment: what it is called, and its colour."""

from maniport.tracking.follow import status

STATES = {
    status.FOLLOWED: ("#D9E0E6", "#3A4652"),
    status.NEARLY_FOLLOWED: ("#B5DDF5", "#30607C"),
    status.ELLIPSOID: ("#56B4E9", "#4A94BF"),
    status.JOINT_LIMIT: ("#E69F00", "#D99A14"),
    status.VELOCITY_LIMIT: ("#CC79A7", "#CC79A7"),
    status.PATH: ("#000000", "#E8EDF2"),
    status.HELD: ("#8C2F1B", "#E2705B"),
}
"""How a motion goes at a moment, from good to bad, with its colours on light and on dark ground."""
