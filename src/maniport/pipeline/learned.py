"""What is learned of several demonstrations, as data."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.chain import LEFT, RIGHT
from maniport.learning import Alignment, ProfileGMM
from maniport.learning.agreement import Agreement
from maniport.mocap import HumanMotion, Recording
from maniport.pipeline.config import Config
from maniport.pipeline.results import SavedResult
from maniport.spd.matrix_functions import from_vector, to_vector
from maniport.spd.regularization import Regularization
from maniport.util.files import save_arrays, save_ellipsoids, save_path
from maniport.util.validation import Array

DATA_FILES = (
    *("profile.npz", "path.npz", "model.npz", "demonstrations.npz"),
    *(f"{content}-{side}.npz" for side in (LEFT, RIGHT) for content in ("profile", "path")),
)
"""The files that `LearnedProfile.save` may write."""


def block_diagonal(profiles: Sequence[Array]) -> Array:
    """Return the ellipsoids (n, a d, a d) of a arms as blocks of one matrix, from those of each (n, d, d)."""
    d, count = profiles[0].shape[-1], len(profiles)
    blocks = np.zeros((len(profiles[0]), count * d, count * d))
    for arm, profile in enumerate(profiles):
        blocks[:, arm * d : (arm + 1) * d, arm * d : (arm + 1) * d] = profile
    return blocks


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One performance of a motion: a recording, or a part of one."""

    name: str
    recording: Recording  # the whole of it
    motion: HumanMotion  # the person's arms in this part
    quality_warnings: tuple[str, ...]  # warnings of the recording and of the arm fits


@dataclass(frozen=True, eq=False)
class LearnedProfile(SavedResult):
    """One profile of several demonstrations, and how much they agree.

    For both arms of a person (a = 2, left first) the ellipsoids of each arm are a block of a matrix of 2 d rows, and
    the positions of each hand three columns.

    Attributes
    ----------
    demonstrations : tuple of Demonstration
    arms : tuple of Arm
        The human arms with the mean lengths of all, in whose base frames the ellipsoids are.
    bases : ndarray, shape (a, 3)
        Origins of these base frames in the common frame of the arms [m], see `maniport.mocap.HumanMotion`.
    lengths : {"mean", "own"}
        Whether the ellipsoids of all are those of these arms, or each of an arm of its own lengths.
    spec : EllipsoidSpec
    regularization : Regularization
        What was done to the ellipsoids before they were compared; those of the profile carry it.
    alignment : Alignment
        The demonstrations on common times.
    paths : ndarray, shape (k, m, 3 a)
        Their hands on these times, in the trunk frame [m].
    model : ProfileGMM
    time : ndarray, shape (n,)
        Of the reference demonstration [s], all of its frames.
    profile : ndarray, shape (n, a d, a d)
        The ellipsoid at each time.
    covariance : ndarray, shape (n, p, p)
        See `ProfileGMM.predict`.
    path : ndarray, shape (n, 3 a)
        Mean of the hands, smoothed over time [m].
    agreement : Agreement
        Agreement of the demonstrations.
    random_state : int
    """

    data_files = DATA_FILES

    demonstrations: tuple[Demonstration, ...]
    arms: tuple[Arm, ...]
    bases: Array
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
        return tuple(demonstration.name for demonstration in self.demonstrations)

    @property
    def reference(self) -> Demonstration:
        """The demonstration that gives the times, with the learned arms and its joint angles."""
        own = self.demonstrations[self.alignment.reference]
        note = (
            f"ellipsoids and the hand's path are learned from {len(self.demonstrations)} demonstrations; the "
            f"configurations are those of {own.name}"
        )
        source = f"{len(self.demonstrations)} demonstrations"
        recording = replace(own.recording, source=source, notes=(*own.recording.notes, note))
        fits = tuple(replace(fit, arm=arm) for fit, arm in zip(own.motion.arms, self.arms, strict=True))
        return replace(own, recording=recording, motion=HumanMotion(fits, self.bases))

    def each_arm(self) -> "tuple[LearnedProfile, ...]":
        """Return the profile, covariance and path of each arm; model and agreement stay those of all arms."""
        d = self.profile.shape[-1] // len(self.arms)
        parts = []
        for i, arm in enumerate(self.arms):
            rows, hand = slice(i * d, (i + 1) * d), slice(3 * i, 3 * i + 3)
            columns = np.eye(len(self.arms) * d)[:, rows]
            vectors = to_vector(columns @ from_vector(np.eye(d * (d + 1) // 2)) @ columns.T)  # of the block's own
            alignment = replace(self.alignment, ellipsoids=self.alignment.ellipsoids[..., rows, rows])
            parts.append(replace(
                self, arms=(arm,), bases=self.bases[i : i + 1], alignment=alignment, paths=self.paths[..., hand],
                profile=self.profile[:, rows, rows], covariance=vectors @ self.covariance @ vectors.T,
                path=self.path[:, hand],
            ))  # fmt: skip
        return tuple(parts)

    def write_data(self, folder: Path) -> None:
        """Write `DATA_FILES` into an existing folder.

        ``profile.npz`` and ``path.npz`` are input of ``maniport track``, for both arms ``profile-left.npz`` and so on;
        `ProfileGMM.load` reads ``model.npz``; ``demonstrations.npz`` has ``names``, ``time`` (m,), ``ellipsoids``
        (k, m, a d, a d) and ``paths`` (k, m, 3 a).
        """
        for part in self.each_arm():
            side = f"-{part.arms[0].side}" if len(self.arms) > 1 else ""
            save_ellipsoids(folder / f"profile{side}.npz", part.profile, self.time)
            save_path(folder / f"path{side}.npz", part.path, self.time)
        self.model.save(folder / DATA_FILES[2])
        aligned = {"time": self.alignment.time, "ellipsoids": self.alignment.ellipsoids, "paths": self.paths}
        save_arrays(folder / DATA_FILES[3], {"names": np.array(self.names), **aligned})
