"""ArmFit: what fitting an arm to a recording gives."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm
from maniport.mocap.recording import Bools, frames_between
from maniport.util.notebook import ShownInNotebooks
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array


def about_axis(segment: str) -> str:
    """What the turn of a segment about its own axis is called in the residuals."""
    return f"{segment} about its axis"


@dataclass(frozen=True, eq=False)
class ArmFit(ShownInNotebooks):
    """Joint angles of an arm that follows a recording, and their quality.

    Attributes
    ----------
    arm : Arm
        The human arm, right or left, with the person's segment lengths; its base frame is the trunk (x forward, y
        left, z up).
    side_reason : str
        Why it is that arm of the person.
    joint_angles : ndarray, shape (n, dof)
        Joint angles [rad], always within the limits.
    time : ndarray, shape (n,)
        Time [s] of the frames that were used, as in the recording.
    frames : ndarray, shape (n,)
        Their indices in the recording.
    segments : tuple of str
        ``"upper arm"``, ``"forearm"`` and, where the recording shows it, ``"hand"``.
    residual : ndarray, shape (n, len(segments))
        Angle between the arm's segment and the recorded one [degrees].
    twist_residual : dict of str to ndarray, shape (n,)
        Rotation of a segment about its own axis from the arm's joint axis to its markers [degrees]; nan where they are
        missing.
    determined : ndarray of bool, shape (dof,)
        Whether the recorded points determine the joint in more than half of the frames.
    seen : ndarray, shape (dof,)
        Share of the frames in which they do.
    reasons : tuple of str
        For each joint that is not determined, why, and what was done; else empty.
    segment_lengths : dict of str to float
        Median lengths in the recording, or fractions of the body height [m]; the notes tell which.
    at_limit : ndarray, shape (dof,)
        Share of the frames in which each joint is saturated.
    beyond_limit : ndarray, shape (n, dof)
        By how much each saturated joint would exceed its limit in a fit without limits [degrees].
    roles : dict
        The points of each role.
    notes : tuple of str
        What was interpolated and left out.
    quality_warnings : tuple of str
        Data-quality warnings: large differences of model and person, and repairs that change the result.
    """

    arm: Arm
    side_reason: str
    joint_angles: Array
    time: Array
    frames: NDArray[np.intp]
    segments: tuple[str, ...]
    residual: Array
    twist_residual: dict[str, Array]
    determined: Bools
    seen: Array
    reasons: tuple[str, ...]
    segment_lengths: dict[str, float]
    at_limit: Array
    beyond_limit: Array
    roles: dict[str, Any]
    notes: tuple[str, ...]
    quality_warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.time)

    def __repr__(self) -> str:
        return f"ArmFit({self.arm.name!r}, {self.summary})"

    def crop(self, start: float | None = None, stop: float | None = None) -> "ArmFit":
        """Keep the frames with start ≤ time ≤ stop [s]; `determined`, `seen`, `at_limit` and `quality_warnings` stay as they are.

        Raises
        ------
        InvalidInputError
            When no frame lies in that interval.
        """
        return self.only(frames_between(self.time, start, stop))

    def thinned(self, count: int) -> "ArmFit":
        """Keep so many frames at most, evenly; all else as `crop` does."""
        return self.only(evenly_spaced(len(self), count))

    def only(self, keep: NDArray[Any]) -> "ArmFit":
        """Keep some of the frames, by a mask or by their numbers; all else as `crop` does."""
        twists = {segment: twist[keep] for segment, twist in self.twist_residual.items()}
        each = ("joint_angles", "time", "frames", "residual", "beyond_limit")
        return replace(self, twist_residual=twists, **{name: getattr(self, name)[keep] for name in each})

    @property
    def summary(self) -> str:
        """Which arm, frames, residuals and what is not determined, in one line."""
        residuals = ", ".join(
            f"{name} {np.median(column):.2f}°" for name, column in zip(self.segments, self.residual.T, strict=True)
        )
        open_joints = f"; not determined: {', '.join(self.undetermined)}" if self.undetermined else ""
        return f"{self.arm.side} arm, {len(self)} frames, median residuals {residuals}{open_joints}"

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, the columns of `joint_angles`."""
        return tuple(self.arm.joint_names)

    @property
    def undetermined(self) -> dict[str, str]:
        """The joints that the recorded points do not determine, with the reason."""
        return {n: r for n, r, known in zip(self.joint_names, self.reasons, self.determined, strict=True) if not known}

    @property
    def largest_step(self) -> tuple[float, float]:
        """The largest change of a joint from frame to frame [degrees], and when it ends [s]; a jump shows here."""
        steps = np.where(np.diff(self.frames) == 1, np.abs(np.diff(self.joint_angles, axis=0)).max(axis=1), 0.0)
        at = int(np.argmax(steps)) + 1 if steps.any() else 0
        return float(np.degrees(steps.max(initial=0.0))), float(self.time[at])

    def residual_summary(self) -> dict[str, dict[str, float]]:
        """Size of each residual [degrees]: ``median``, ``p95``, ``max``, and ``max_at_s`` when that is [s].

        The rows are the segments and, where the recording shows a joint axis at their end, their turn about their own
        axis (``"forearm about its axis"``).
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
