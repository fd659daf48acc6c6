"""Twelve motions of a human arm, what adapters make of them for a robot, and the three placements of their hand paths.

Segments of the recordings: the joint angles are smoothed (Gaussian, 0.1 s), and where the hand then stays below 1.2 m/s
for three seconds, that stretch is cut into equal parts of 3.3 to 4.9 s; 50 points of each. That leaves out where the
person lets go or jumps down, and leaps of the fit where a segment lies along a joint axis (up to 4.7 m/s).
The robot takes twice the time that the person took.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

import maniport as mp
from maniport.arms import Arm
from maniport.mocap import fit_arm, read_recording, shipped_recording
from maniport.studies.paper.trajectories import human_arm, human_evaluation
from maniport.transfer import DomainAdapter, Search

from .inputs import DAMPING, Array

SEGMENTS = {
    "ladder": ((0.0, 3.9), (3.9, 7.8), (7.8, 11.7), (14.2, 18.3), (18.8, 23.2), (23.2, 27.5), (30.0, 34.9)),
    "freeform": ((3.7, 7.0),),
}
"""Beginning and end in the shipped recordings [s]."""
POINTS, SMOOTHING = 50, 0.1
SLOWER = 2.0
"""How many times longer than the person the robot takes: a Panda's hand may go 1.7 m/s, and paths are enlarged."""
EVALUATION_SECONDS = 5.0
"""Duration of H-Eval-1 to -4, for which the paper gives none."""

ADAPTED = "mean and dispersion"
"""Parallel transport with the base_rotation known: person and robot face the same way."""


@dataclass(frozen=True)
class Motion:
    """A motion of a person's arm.

    Attributes
    ----------
    name : str
    person : Arm
        Its base frame is the trunk: x forward, z up.
    length : float
        Of the person's extended arm [m].
    time : ndarray, shape (n,)
        [s]
    joint_positions : ndarray, shape (n, dof)
        [rad]
    """

    name: str
    person: Arm
    length: float
    time: Array
    joint_positions: Array

    @property
    def hand(self) -> Array:
        """Path of the hand, shape (n, 3) [m]."""
        return self.person.forward(self.joint_positions)[:, :3, 3]

    @property
    def robot_time(self) -> Array:
        """When the robot shall be there, shape (n,) [s]."""
        return SLOWER * (self.time - self.time[0])

    @property
    def profile(self) -> Array:
        """Velocity ellipsoids along it, shape (n, 3, 3)."""
        return self.person.manipulability(self.joint_positions)


def motions() -> Iterator[Motion]:
    """H-Eval-1 to -4 of the arm rHuMan, then the segments of the two recordings by MyoArm."""
    for name, joints in human_evaluation().items():
        person = human_arm()
        length = float(np.linalg.norm(person.forward(np.zeros(person.dof))[:3, 3]))
        yield Motion(name, person, length, np.linspace(0.0, EVALUATION_SECONDS, len(joints)), joints)
    for recording, segments in SEGMENTS.items():
        fit = fit_arm(read_recording(shipped_recording(recording)), "myoarm")
        joints = gaussian_filter1d(fit.joint_angles, SMOOTHING / np.median(np.diff(fit.time)), axis=0)
        for begin, end in segments:
            inside = np.flatnonzero((fit.time >= begin) & (fit.time <= end))
            rows = inside[np.linspace(0, len(inside) - 1, POINTS).round().astype(int)]
            name = f"{recording} {begin:g}–{end:g} s"
            yield Motion(name, fit.arm, sum(fit.segment_lengths.values()), fit.time[rows], joints[rows])


PLACEMENTS: dict[str, dict[str, float]] = {
    "free": {},
    "facing the same way": {"yaw": 0.0},
    "to the left": {"yaw": np.pi / 2.0},
}
"""What is given to `place_path`, by name, the same for all methods: in which direction the task is done, or nothing.
Size and place are searched for."""

LIFE_SIZE = {"scale": 1.0}
"""What is given where the task has to be as large as the person's: a robot that is larger than the person cannot
stretch where the person does."""


def adapters() -> dict[str, DomainAdapter]:
    """Mean and dispersion, then the other methods, with the base_rotation known; not fitted."""
    known: dict[str, Any] = {"damping": DAMPING, "base_rotation": np.eye(3)}
    return {
        ADAPTED: mp.ParallelTransport(**known),
        "identity baseline": mp.IdentityMap(**known),
        "recentred": mp.MeanTransport(**known),
        # by default it keeps its start here, which is mean and dispersion
        "ICP, refined": mp.RiemannianICP(**known, random_state=0, search=Search(require_improvement=False)),
        "nearest neighbour": mp.NearestNeighbor(damping=DAMPING),
    }
