"""Twelve motions of a human arm: H-Eval-1 to 4 of the paper, and segments of the bundled recordings.

The joint angles of a segment are smoothed (Gaussian, 0.1 s) and have 50 waypoints. In the segments the hand stays below
1.2 m/s, so that jumps of the recordings are left out. The robot takes twice the person's time.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from maniport.arms import Arm
from maniport.mocap import fit_arm, read_recording, shipped_recording
from maniport.studies.trajectories import human_arm, human_evaluation

from .inputs import Array

SEGMENTS = {
    "ladder": (
        (0.0, 3.9),
        (3.9, 7.8),
        (7.8, 11.7),
        (14.2, 18.3),
        (18.8, 23.2),
        (23.2, 27.5),
        (30.0, 34.9),
    ),
    "freeform": ((3.7, 7.0),),
}
"""Start and stop in the bundled recordings [s]."""
POINTS = 50
SMOOTHING = 0.1
SLOWER = 2.0
"""Duration of the robot relative to the person's: a Panda's hand reaches 1.7 m/s, and paths are enlarged."""
EVALUATION_SECONDS = 5.0
"""Duration of H-Eval-1 to -4, for which the paper gives none."""


@dataclass(frozen=True)
class Motion:
    """A motion of a person's arm; the base frame is the trunk, x forward and z up."""

    name: str
    person: Arm
    time: Array  # (n,) [s]
    joint_positions: Array  # (n, dof) [rad]

    @property
    def hand(self) -> Array:
        """Path of the hand, shape (n, 3) [m]."""
        return self.person.forward(self.joint_positions)[:, :3, 3]

    @property
    def robot_time(self) -> Array:
        """Times of the robot, shape (n,) [s]."""
        return SLOWER * (self.time - self.time[0])

    @property
    def profile(self) -> Array:
        """Velocity ellipsoids, shape (n, 3, 3)."""
        return self.person.manipulability(self.joint_positions)


def motions() -> Iterator[Motion]:
    """H-Eval-1 to -4 of the arm rHuMan, then the segments of the two recordings by MyoArm."""
    for name, joints in human_evaluation().items():
        person = human_arm()
        yield Motion(name, person, np.linspace(0.0, EVALUATION_SECONDS, len(joints)), joints)
    for recording, segments in SEGMENTS.items():
        fit = fit_arm(read_recording(shipped_recording(recording)), "myoarm")
        joints = gaussian_filter1d(
            fit.joint_angles, SMOOTHING / np.median(np.diff(fit.time)), axis=0
        )
        for begin, end in segments:
            inside = np.flatnonzero((fit.time >= begin) & (fit.time <= end))
            rows = inside[np.linspace(0, len(inside) - 1, POINTS).round().astype(int)]
            name = f"{recording} {begin:g}–{end:g} s"
            yield Motion(name, fit.arm, fit.time[rows], joints[rows])
