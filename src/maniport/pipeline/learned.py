"""What is learned of several demonstrations, as data."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from maniport.arms import Arm, EllipsoidSpec
from maniport.learning import Alignment, ProfileGMM
from maniport.learning.agreement import Agreement
from maniport.mocap import ArmFit, Recording
from maniport.pipeline.config import Config
from maniport.pipeline.results import SavedResult
from maniport.spd.regularization import Regularization
from maniport.util.files import save_arrays, save_ellipsoids, save_path
from maniport.util.validation import Array

DATA_FILES = ("profile.npz", "path.npz", "model.npz", "demonstrations.npz")
"""The files that `LearnedProfile.save` writes."""


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One performance of a motion: a recording, or a part of one."""

    name: str
    recording: Recording  # the whole of it
    fit: ArmFit  # the person's arm in this part
    quality_warnings: tuple[str, ...]  # warnings of the recording and of the arm fit


@dataclass(frozen=True, eq=False)
class LearnedProfile(SavedResult):
    """One profile of several demonstrations, and how much they agree.

    Attributes
    ----------
    demonstrations : tuple of Demonstration
    arm : Arm
        A human arm with the mean lengths of all, in whose base frame profile and path are.
    lengths : {"mean", "own"}
        Whether the ellipsoids of all are those of this arm, or each of an arm of its own lengths.
    spec : EllipsoidSpec
    regularization : Regularization
        What was done to the ellipsoids before they were compared; those of the profile carry it.
    alignment : Alignment
        The demonstrations on common times.
    paths : ndarray, shape (k, m, 3)
        Their hands on these times, in the trunk frame [m].
    model : ProfileGMM
    time : ndarray, shape (n,)
        Of the reference demonstration [s], all of its frames.
    profile : ndarray, shape (n, d, d)
        The ellipsoid at each time.
    covariance : ndarray, shape (n, p, p)
        See `ProfileGMM.predict`.
    path : ndarray, shape (n, 3)
        Mean of the hands, smoothed over time [m].
    agreement : Agreement
        How alike the demonstrations are.
    random_state : int
    """

    data_files = DATA_FILES

    demonstrations: tuple[Demonstration, ...]
    arm: Arm
    lengths: str
    spec: EllipsoidSpec
    regularization: Regularization
    alignment: Alignment
    paths: Array
    model: ProfileGMM
    time: Array
    profile: Array
    covariance: Array
    path: Array
    agreement: Agreement
    random_state: int
    config: Config | None = None  # How the profile was requested

    def __repr__(self) -> str:
        return (
            f"LearnedProfile({len(self.demonstrations)} demonstrations, {len(self.time)} ellipsoids, "
            f"{self.model.n_components_} Gaussians, spread {self.agreement.after:.2f})"
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the demonstrations."""
        return tuple(one.name for one in self.demonstrations)

    @property
    def reference(self) -> Demonstration:
        """The demonstration that gives the times, with the learned arm and its joint angles."""
        one = self.demonstrations[self.alignment.reference]
        note = (
            f"ellipsoids and the hand's path are learned from {len(self.demonstrations)} demonstrations; the "
            f"configurations are those of {one.name}"
        )
        source = f"{len(self.demonstrations)} demonstrations"
        recording = replace(one.recording, source=source, notes=(*one.recording.notes, note))
        return replace(one, recording=recording, fit=replace(one.fit, arm=self.arm))

    def write_data(self, folder: Path) -> None:
        """Write `DATA_FILES` into an existing folder.

        ``profile.npz`` and ``path.npz`` are input of ``maniport track``; `ProfileGMM.load` reads ``model.npz``;
        ``demonstrations.npz`` has ``names``, ``time`` (m,), ``ellipsoids`` (k, m, d, d) and ``paths`` (k, m, 3).
        """
        profile, path, model, every = (folder / name for name in DATA_FILES)
        save_ellipsoids(profile, self.profile, self.time)
        save_path(path, self.path, self.time)
        self.model.save(model)
        aligned = {"time": self.alignment.time, "ellipsoids": self.alignment.ellipsoids, "paths": self.paths}
        save_arrays(every, {"names": np.array(self.names), **aligned})
