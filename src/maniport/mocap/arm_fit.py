"""Results of fitting human arms to a recording."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from maniport.arms import Arm
from maniport.mocap.recording import Bools
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array


def about_axis(segment: str) -> str:
    """Return the name of the residual of a segment's rotation about its own axis."""
    return f"{segment} about its axis"


@dataclass(frozen=True, eq=False)
class ArmFit(NotebookDisplay):
    """Joint angles of an arm fitted to a recording, and their quality.

    Attributes
    ----------
    arm : Arm
        The human arm, right or left, with the person's segment lengths; its base frame is the trunk (x forward, y
        left, z up).
    side_reason : str
        Why this arm of the person was fitted.
    joint_angles : ndarray, shape (n, dof)
        Joint angles [rad], always within the limits.
    time : ndarray, shape (n,)
        Time [s] of the frames that were used, as in the recording.
    frames : ndarray, shape (n,)
        Their indices in the recording.
    segments : tuple of str
        ``"upper arm"``, ``"forearm"`` and, where it is recorded, ``"hand"``.
    residual : ndarray, shape (n, len(segments))
        Angle between the arm's segment and the recorded one [degrees].
    twist_residual : dict of str to ndarray, shape (n,)
        Rotation of a segment about its own axis from the arm's joint axis to its markers [degrees]; nan where they are
        missing.
    observable : ndarray of bool, shape (dof,)
        Whether the recorded points determine the joint in more than half of the frames.
    observable_share : ndarray, shape (dof,)
        Share of the frames in which they do.
    reasons : tuple of str
        For each unobservable joint the cause and the treatment; else empty.
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
    smoothed : bool
        Whether points were noisy and were smoothed; `maniport.Live` then filters frames of the same points.
    """

    arm: Arm
    side_reason: str
    joint_angles: Array
    time: Array
    frames: NDArray[np.intp]
    segments: tuple[str, ...]
    residual: Array
    twist_residual: dict[str, Array]
    observable: Bools
    observable_share: Array
    reasons: tuple[str, ...]
    segment_lengths: dict[str, float]
    at_limit: Array
    beyond_limit: Array
    roles: dict[str, Any]
    notes: tuple[str, ...]
    quality_warnings: tuple[str, ...] = ()
    smoothed: bool = False

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    def __repr__(self) -> str:
        return f"ArmFit({self.arm.name!r}, {self.summary})"

    def only(self, keep: NDArray[Any]) -> "ArmFit":
        """Keep some of the frames, by a mask or by their indices; statistics over all frames are not computed again."""
        twists = {segment: twist[keep] for segment, twist in self.twist_residual.items()}
        per_frame = ("joint_angles", "time", "frames", "residual", "beyond_limit")
        return replace(self, twist_residual=twists, **{name: getattr(self, name)[keep] for name in per_frame})

    @property
    def summary(self) -> str:
        """Arm, frames, range of the segments' median residuals, and unobservable joints in one line."""
        medians = np.median(self.residual, axis=0)
        unobservable = f"; unobservable: {', '.join(self.unobservable)}" if self.unobservable else ""
        residuals = f"median residual {medians.min():.1f}–{medians.max():.1f}°"
        return f"{self.arm.side} arm, {len(self)} frames, {residuals}{unobservable}"

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, the columns of `joint_angles`."""
        return tuple(self.arm.joint_names)

    @property
    def unobservable(self) -> dict[str, str]:
        """Joints that the recorded points do not determine, with the reason."""
        joints = zip(self.joint_names, self.reasons, self.observable, strict=True)
        return {name: reason for name, reason, observable in joints if not observable}

    def residual_summary(self) -> dict[str, dict[str, float]]:
        """Statistics of each residual [degrees]: ``median``, ``p95``, ``max``, and its time ``max_at_s`` [s].

        The rows are the segments and, where markers of a joint axis are recorded, the rotation of a segment about its
        own axis (``"forearm about its axis"``).
        """
        columns = dict(zip(self.segments, self.residual.T, strict=True))
        columns |= {about_axis(segment): np.abs(twist) for segment, twist in self.twist_residual.items()}
        return {
            name: {
                "median": float(np.nanmedian(r)),
                "p95": float(np.nanpercentile(r, 95)),
                "max": float(np.nanmax(r)),
                "max_at_s": float(self.time[np.nanargmax(r)]),
            }
            for name, r in columns.items()
            if not np.isnan(r).all()
        }

    def repetitions(self, width: float = 0.1, least: float = 0.5, returned: float = 0.9) -> list[tuple[float, float]]:
        """Find (start, stop) [s] of each time that the hand moves out and back.

        The path is smoothed over `width` [s]. A repetition reaches at least the share `least` of the largest distance;
        it starts and stops where the hand has `returned` by this share.
        """
        from scipy.signal import find_peaks, peak_widths  # loads scipy.stats, which takes 0.5 s

        if len(self) < 3:
            return []
        hand = self.arm.forward(self.joint_angles)[:, :3, 3]
        step = float(np.median(np.diff(self.time)))
        path = _along(gaussian_filter1d(hand, width / step, axis=0, mode="nearest"))
        peaks, properties = find_peaks(path, prominence=np.finfo(float).tiny)
        if not len(peaks):
            return []
        high = properties["prominences"] >= least * properties["prominences"].max()
        peaks = peaks[high]
        prominences = tuple(properties[key][high] for key in ("prominences", "left_bases", "right_bases"))
        _, _, left, right = peak_widths(path, peaks, returned, prominences)
        valleys = [int(a + np.argmin(path[a:b])) for a, b in pairwise(peaks)]
        first = np.maximum(np.ceil(left).astype(int), [0, *(valley + 1 for valley in valleys)])
        last = np.minimum(np.floor(right).astype(int), [*valleys, len(path) - 1])
        return [(float(self.time[a]), float(self.time[b])) for a, b in zip(first, last, strict=True)]


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
    def frames(self) -> NDArray[np.intp]:
        """Their indices in the recording, shape (n,)."""
        return self.arms[0].frames

    @property
    def hands(self) -> Array:
        """Paths of the hands in the common frame, shape (n_arms, n, 3) [m]."""
        paths = [fit.arm.forward(fit.joint_angles)[:, :3, 3] for fit in self.arms]
        return np.stack(paths) + self.bases[:, None]

    @property
    def quality_warnings(self) -> tuple[str, ...]:
        """Warnings of each arm with its side; common warnings once."""
        first, *others = (fit.quality_warnings for fit in self.arms)
        shared = tuple(text for text in first if others and all(text in texts for texts in others))
        own = zip(self.names, self.arms, strict=True)
        return (
            *(f"{side} arm: {text}" for side, fit in own for text in fit.quality_warnings if text not in shared),
            *shared,
        )

    @property
    def summary(self) -> str:
        """Frames and residuals of each arm in one line."""
        return "; ".join(fit.summary for fit in self.arms)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    def __repr__(self) -> str:
        return f"HumanMotion({' and '.join(repr(fit.arm.name) for fit in self.arms)}, {self.summary})"

    def repetitions(self) -> list[tuple[float, float]]:
        """Find (start, stop) [s] of each time that the hand with the longer path moves out and back."""
        lengths = np.linalg.norm(np.diff(self.hands, axis=1), axis=-1).sum(axis=1)
        return self.arms[int(np.argmax(lengths))].repetitions()

    def only(self, keep: NDArray[Any]) -> "HumanMotion":
        """Keep some of the frames of all arms, by a mask or by their indices; see `ArmFit.only`."""
        return replace(self, arms=tuple(fit.only(keep) for fit in self.arms))


def _along(hand: Array) -> Array:
    """Project positions (n, 3), from their median, on their principal direction, the longer side positive."""
    offsets = hand - np.median(hand, axis=0)
    path = offsets @ np.linalg.svd(offsets - offsets.mean(axis=0), full_matrices=False)[2][0]
    return np.asarray(path if path.max() >= -path.min() else -path)
