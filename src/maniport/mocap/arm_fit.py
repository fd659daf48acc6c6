"""Results of fitting human arms to a recording."""

from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from maniport.arms import Arm
from maniport.mocap.recording import Bools
from maniport.mocap.roles import Roles
from maniport.util.notebook import NotebookDisplay
from maniport.util.plotting import Plottable
from maniport.util.sampling import statistics
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False)
class ArmFit(NotebookDisplay, Plottable):
    """Joint angles of an arm fitted to a recording, and their quality.

    Attributes
    ----------
    arm : Arm
        The human arm, right or left, with the person's segment lengths; its base frame is the trunk (x forward, y
        left, z up).
    side_reason : str
        Why this arm of the person was fitted.
    joint_angles : ndarray, shape (n, dof)
        Angles of the joints of `arm` [rad], always within the limits.
    time : ndarray, shape (n,)
        Time [s] of the frames that were used, as in the recording.
    frames : ndarray, shape (n,)
        Their indices in the recording.
    residuals : dict of str to ndarray, shape (n,)
        For each segment that is recorded (``"upper arm"``, ``"forearm"``, ``"hand"``) the angle between it and that of
        the arm [degrees]. For markers of a joint axis the rotation of a segment about its own axis (``"forearm about
        its axis"``) from the arm's joint axis to them; nan where they are missing.
    unobservable : dict of str to str
        Joints that the recorded points do not determine in more than half of the frames, with cause and treatment.
    segment_lengths : dict of str to float
        Median lengths of the recorded segments [m].
    at_limit : ndarray, shape (dof,)
        Share of the frames in which each joint is saturated.
    beyond_limit : ndarray, shape (n, dof)
        By how much each saturated joint would exceed its limit in a fit without limits [degrees].
    roles : dict
        The points of each role.
    notes : tuple of str
        Interpolated and omitted frames.
    quality_warnings : tuple of str
        Data-quality warnings: large differences of model and person, and repairs that change the result.
    model_warnings : tuple of str
        Those of the warnings that report differences of model and person.
    smoothed : bool
        Whether points were noisy and were smoothed; `maniport.Live` then filters frames of the same points.
    """

    arm: Arm
    side_reason: str
    joint_angles: Array
    time: Array
    frames: NDArray[np.intp]
    residuals: dict[str, Array]
    unobservable: dict[str, str]
    segment_lengths: dict[str, float]
    at_limit: Array
    beyond_limit: Array
    roles: Roles
    notes: tuple[str, ...]
    quality_warnings: tuple[str, ...] = ()
    model_warnings: tuple[str, ...] = ()
    smoothed: bool = False

    def __post_init__(self) -> None:
        for value in (*vars(self).values(), *self.residuals.values()):
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    def __repr__(self) -> str:
        return f"ArmFit({self.arm.name!r}, {self.summary})"

    def only(self, keep: Bools | NDArray[np.intp]) -> "ArmFit":
        """Keep some of the frames, by a mask or by their indices; statistics stay those of all frames."""
        residuals = {name: values[keep] for name, values in self.residuals.items()}
        per_frame = {}
        for name in ("joint_angles", "time", "frames", "beyond_limit"):
            per_frame[name] = getattr(self, name)[keep]
        return replace(self, residuals=residuals, **per_frame)

    @property
    def summary(self) -> str:
        """Arm, frames, range of the segments' median residuals, and unobservable joints in one line."""
        medians = [np.median(self.residuals[segment]) for segment in self.segment_lengths]
        if self.unobservable:
            unobservable = f"; unobservable: {', '.join(self.unobservable)}"
        else:
            unobservable = ""
        residuals = f"median residual {min(medians):.1f}–{max(medians):.1f}°"
        return f"{self.arm.side} arm, {len(self)} frames, {residuals}{unobservable}"

    @property
    def observable(self) -> Bools:
        """Whether the recorded points determine the joint in more than half of the frames, shape (dof,)."""
        return np.array([name not in self.unobservable for name in self.arm.joint_names])

    def residual_summary(self) -> dict[str, dict[str, float]]:
        """Statistics of each residual, without sign [degrees]: ``median``, ``p95``, ``max`` at ``max_at_s`` [s]."""
        sizes = {}
        for name, values in self.residuals.items():
            if not np.isnan(values).all():
                sizes[name] = np.abs(values)
        return {name: statistics(size, self.time) for name, size in sizes.items()}

    def repetitions(self) -> list[tuple[float, float]]:
        """Find (start, stop) [s] of each time that the hand moves out and back.

        A repetition reaches at least half of the largest distance; it starts and stops where the hand has returned by
        90 %.
        """
        from scipy.signal import find_peaks, peak_widths  # loads scipy.stats, which takes 0.5 s

        if len(self) < 3:
            return []
        hand = self.arm.forward(self.joint_angles)[:, :3, 3]
        hand = gaussian_filter1d(
            hand, 0.1 / float(np.median(np.diff(self.time))), axis=0, mode="nearest"
        )
        offsets = hand - np.median(hand, axis=0)
        # on their principal direction, the longer side positive
        path = offsets @ np.linalg.svd(offsets - offsets.mean(axis=0), full_matrices=False)[2][0]
        if not (path.max() >= -path.min()):
            path = -path
        peaks, properties = find_peaks(path, prominence=np.finfo(float).tiny)
        if not len(peaks):
            return []
        high = properties["prominences"] >= 0.5 * properties["prominences"].max()
        peaks = peaks[high]
        prominences = tuple(values[high] for values in properties.values())
        _, _, left, right = peak_widths(path, peaks, 0.9, prominences)
        valleys = [int(a + np.argmin(path[a:b])) for a, b in pairwise(peaks)]
        after_valleys = [valley + 1 for valley in valleys]
        first = np.maximum(np.ceil(left).astype(int), [0, *after_valleys])
        last = np.minimum(np.floor(right).astype(int), [*valleys, len(path) - 1])
        return list(zip(self.time[first].tolist(), self.time[last].tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class HumanMotion(NotebookDisplay):
    """Joint angles of several arms of a person, in the same frames of one recording.

    Attributes
    ----------
    arms : tuple of ArmFit
        One for each arm, with its own residuals and unobservable joints; their times and frames are the same.
    bases : ndarray, shape (n_arms, 3)
        Origin of each arm's base frame [m] relative to the mean of these origins, in the trunk's axes (x forward, y
        left, z up). The shoulders are where the recording has them (median).
    """

    arms: tuple[ArmFit, ...]
    bases: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Sides of the arms, "left" and "right"."""
        return tuple(str(fit.arm.side) for fit in self.arms)

    @property
    def time(self) -> Array:
        """Times of the frames, shape (n,) [s]."""
        return self.arms[0].time

    @property
    def hands(self) -> Array:
        """Paths of the hands in the common frame, shape (n_arms, n, 3) [m]."""
        paths = [fit.arm.forward(fit.joint_angles)[:, :3, 3] for fit in self.arms]
        return np.stack(paths) + self.bases[:, None]

    @property
    def quality_warnings(self) -> tuple[str, ...]:
        """Warnings of each arm with its side; common warnings once."""
        texts = []
        for side, fit in zip(self.names, self.arms, strict=True):
            for text in fit.quality_warnings:
                texts.append((side, text))
        counts = Counter(text for _, text in texts)
        warnings = []
        for side, text in texts:
            if counts[text] > 1:
                warnings.append(text)
            else:
                warnings.append(f"{side} arm: {text}")
        return tuple(dict.fromkeys(warnings))

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    def __repr__(self) -> str:
        return f"HumanMotion({', '.join(map(repr, self.arms))})"

    def repetitions(self) -> list[tuple[float, float]]:
        """Find (start, stop) [s] of each time that the hand with the longer path moves out and back."""
        lengths = np.linalg.norm(np.diff(self.hands, axis=1), axis=-1).sum(axis=1)
        return self.arms[int(np.argmax(lengths))].repetitions()

    def only(self, keep: Bools | NDArray[np.intp]) -> "HumanMotion":
        """Keep some of the frames of all arms, by a mask or by their indices; see `ArmFit.only`."""
        return replace(self, arms=tuple(fit.only(keep) for fit in self.arms))
