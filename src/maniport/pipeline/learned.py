"""What is learned of several demonstrations, as data."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from maniport.atomic_io import folder_written_whole
from maniport.bodies import Arm, EllipsoidSpec
from maniport.demonstrations import ArmFit, Recording
from maniport.files import save_arrays, save_ellipsoids, save_path
from maniport.notebook import ShownInNotebooks
from maniport.profiles import Alignment, ProfileGMM
from maniport.profiles.agreement import Agreement
from maniport.spd.regularization import Regularization
from maniport.validation import Array

DATA_FILES = ("profile.npz", "path.npz", "model.npz", "demonstrations.npz")
"""The files that `LearnedProfile.save` writes."""


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One time that somebody showed a motion: a recording, or a part of one.

    Attributes
    ----------
    name : str
    recording : Recording
        The whole of it.
    fit : ArmFit
        The person's arm in the part that is meant.
    doubts : tuple of str
        Of the whole recording and of the arm's fit to it, to be read before all else.
    """

    name: str
    recording: Recording
    fit: ArmFit
    doubts: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class LearnedProfile(ShownInNotebooks):
    """One profile of several demonstrations, and how much they agree.

    Attributes
    ----------
    demonstrations : tuple of Demonstration
    arm : Arm
        A human arm with the mean lengths of all; what the robot takes over is seen from it.
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

    See Also
    --------
    learn : makes it.
    transfer_recording : takes it in place of a recording.
    """

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
        """The demonstration that gives the times, with the learned arm in its postures."""
        one = self.demonstrations[self.alignment.reference]
        note = (
            f"ellipsoids and the hand's path are learned from {len(self.demonstrations)} demonstrations; the postures "
            f"are those of {one.name}"
        )
        source = f"{len(self.demonstrations)} demonstrations"
        recording = replace(one.recording, source=source, notes=(*one.recording.notes, note))
        return replace(one, recording=recording, fit=replace(one.fit, arm=self.arm))

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the data to a folder, whole or not at all; `maniport.write_results` adds figures and a page.

        ``profile.npz`` and ``path.npz`` are files that ``maniport track`` takes; `ProfileGMM.load` reads ``model.npz``;
        ``demonstrations.npz`` has ``names``, ``time`` (m,), ``ellipsoids`` (k, m, d, d) and ``paths`` (k, m, 3).

        Raises
        ------
        OutputError
            When the folder holds earlier data that may not be overwritten, or other things, or cannot be written.
        """
        with folder_written_whole(folder, DATA_FILES, overwrite) as staging:
            self.write_data(staging)

    def write_data(self, folder: Path) -> None:
        """Write `DATA_FILES` into a folder that is there."""
        profile, path, model, every = (folder / name for name in DATA_FILES)
        save_ellipsoids(profile, self.profile, self.time)
        save_path(path, self.path, self.time)
        self.model.save(model)
        aligned = {"time": self.alignment.time, "ellipsoids": self.alignment.ellipsoids, "paths": self.paths}
        save_arrays(every, {"names": np.array(self.names), **aligned})
