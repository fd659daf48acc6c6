"""Both arms of a person from one recording, over one trunk."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms.chain import LEFT, RIGHT, SIDES
from maniport.errors import InvalidInputError, ManiportWarning, RecordingError, spoken
from maniport.mocap.arm_ik import fitted, require_person
from maniport.mocap.arm_ik_result import ArmFit
from maniport.mocap.marker_sets import ARM, TRUNK
from maniport.mocap.observation import Observation, observe
from maniport.mocap.recording import LONGEST_GAP, Recording
from maniport.mocap.roles import assign_roles, role_position
from maniport.util.defaults import AUTO, KEEP
from maniport.util.notebook import ShownInNotebooks
from maniport.util.progress import Progress, Step
from maniport.util.validation import Array, as_number

EACH = LEFT, RIGHT  # The order of a pair everywhere


@dataclass(frozen=True, eq=False)
class ArmFits(ShownInNotebooks):
    """Joint angles of both arms of a person, in the same frames of one recording.

    Attributes
    ----------
    left, right : ArmFit
        Each with its own residuals and undetermined joints; their times and frames are the same.
    bases : ndarray, shape (2, 3)
        Origin of each arm's base frame in the common frame [m], left first: the trunk's axes (x forward, y left, z up)
        at the middle between the two origins. The shoulders are where the recording has them (median).
    """

    left: ArmFit
    right: ArmFit
    bases: Array

    @property
    def each(self) -> tuple[ArmFit, ArmFit]:
        """Left and right."""
        return self.left, self.right

    @property
    def time(self) -> Array:
        """Times of the frames, shape (n,) [s]."""
        return self.right.time

    @property
    def frames(self) -> NDArray[np.intp]:
        """Their indices in the recording, shape (n,)."""
        return self.right.frames

    @property
    def hands(self) -> Array:
        """Paths of both hands in the common frame, left first, shape (2, n, 3) [m]."""
        paths = [fit.arm.forward(fit.joint_angles)[:, :3, 3] for fit in self.each]
        return np.stack([path + base for path, base in zip(paths, self.bases, strict=True)])

    @property
    def quality_warnings(self) -> tuple[str, ...]:
        """Warnings of each arm with its side; common warnings once."""
        shared = [text for text in self.left.quality_warnings if text in self.right.quality_warnings]
        own = [
            f"{fit.arm.side} arm: {text}" for fit in self.each for text in fit.quality_warnings if text not in shared
        ]
        return (*own, *shared)

    @property
    def summary(self) -> str:
        """Frames and residuals of each, in one line."""
        return "; ".join(fit.summary for fit in self.each)

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.time)

    def __repr__(self) -> str:
        return f"ArmFits({self.left.arm.name!r} and {self.right.arm.name!r}, {self.summary})"

    def crop(self, start: float | None = None, stop: float | None = None) -> "ArmFits":
        """Keep the frames with start ≤ time ≤ stop [s] of both arms, as `ArmFit.crop` does."""
        return replace(self, left=self.left.crop(start, stop), right=self.right.crop(start, stop))


def fit_arms(
    recording: Recording,
    person: str = "myoarm",
    markers: Mapping[str, Mapping[str, Any]] | None = None,
    fill: float = LONGEST_GAP,
    progress: Progress | None = None,
    *,
    height: float | None = None,
    smooth: str | float = AUTO,
    jumps: str = KEEP,
) -> ArmFits:
    """Find the joint angles with which both arms of a person follow a recording, each as `fit_arm` does.

    Both are taken relative to one trunk, and in the frames that show both.

    Parameters
    ----------
    recording : Recording
        The person's trunk and both arms.
    markers : mapping, optional
        Points of roles for each arm, ``{"left": {...}, "right": {...}}``, as `fit_arm` takes them for one; those of the
        trunk for the right arm hold for the left one, too.
    person, fill, progress, height, smooth, jumps : optional
        As in `fit_arm`; so are the other errors and the warnings.

    Raises
    ------
    RecordingError
        When one of the arms is not recorded, or no frame shows both.
    """
    tall, cutoff = require_person(person, AUTO, height, smooth, jumps)
    longest = as_number(fill, "fill [s]", minimum=0.0)
    own = markers_of_each(recording, markers)
    seen = {side: observe(recording, own[side], side, longest, cutoff) for side in EACH}
    common = _common(recording, seen)
    fits: dict[str, ArmFit] = {}
    for side in EACH:
        step = Step(progress, f"Fit human {side} arm")
        arm = replace(seen[side], frames=common, trunk=seen[RIGHT].trunk)
        fits[side], differences = fitted(recording, arm, person, tall, jumps, step)
        for doubt in differences:
            warnings.warn(f"{side} arm: {doubt}", ManiportWarning, stacklevel=2)
        step.end(fits[side].summary)
    both = _in_both(fits, recording)
    return ArmFits(both[LEFT], both[RIGHT], _bases(seen, both))


def markers_of_each(recording: Recording, markers: Mapping[str, Any] | None) -> dict[str, dict[str, Any]]:
    """Return the markers of each arm, with one trunk for both."""
    given = {} if markers is None else markers
    if not isinstance(given, Mapping) or not set(given) <= set(SIDES):
        found = sorted(map(str, given)) if isinstance(given, Mapping) else given
        raise InvalidInputError(
            f"{spoken('markers')} of both arms must be those of each, {{'left': {{...}}, 'right': {{...}}}}; "
            f"found {found!r}"
        )
    roles, errors = {}, {}
    for side in SIDES:
        try:
            roles[side] = assign_roles(recording, given.get(side), side)
        except RecordingError as error:
            errors[side] = error
    if len(errors) == 1:
        ((there, _),) = roles.items()
        ((absent, why),) = errors.items()
        raise RecordingError(
            f"both arms are asked for, and the recording shows the {there} one alone; {why}. For both arms these "
            f"points are given under {absent!r}"
        )
    if errors:
        raise errors[RIGHT]
    if same := [role for role in ARM if roles[LEFT][role] == roles[RIGHT][role]]:
        raise RecordingError(
            f"both arms are asked for, and {', '.join(same)} of either are the same points: "
            f"{', '.join(roles[LEFT][same[0]])}; there is one arm in {recording.source!r}, or its points have no side"
        )
    trunk = {role: roles[RIGHT].get(role) for role in TRUNK}
    return {side: {**(given.get(side) or {}), **trunk} for side in SIDES}


def _common(recording: Recording, seen: Mapping[str, Observation]) -> NDArray[np.intp]:
    """Return the frames in which trunk and both arms are fully observed."""
    frames = np.intersect1d(seen[LEFT].frames, seen[RIGHT].frames)
    if not len(frames):
        raise RecordingError(
            f"no frame of {recording.source!r} shows both arms: {len(seen[LEFT].frames)} show the left one, "
            f"{len(seen[RIGHT].frames)} the right one"
        )
    return frames


def _in_both(fits: Mapping[str, ArmFit], recording: Recording) -> dict[str, ArmFit]:
    """Keep the frames of both fits, where jumps were cut out."""
    frames = np.intersect1d(fits[LEFT].frames, fits[RIGHT].frames)
    if not len(frames):
        raise RecordingError(
            f"the longest parts of {recording.source!r} without leaps of either arm have no frame in common"
        )
    return {side: fit.only(np.isin(fit.frames, frames)) for side, fit in fits.items()}


def _bases(seen: Mapping[str, Observation], fits: Mapping[str, ArmFit]) -> Array:
    """Return the origins of the arms' base frames, see `ArmFits.bases`."""
    origins = []
    for side in EACH:
        arm, fit = seen[side], fits[side]
        from_neck = arm.points["shoulder"] - role_position(arm.used, arm.roles["trunk_up"][1])
        measured = np.sum(seen[RIGHT].trunk * from_neck[:, :, None], axis=1)[fit.frames]
        origins.append(np.median(measured - fit.arm.point_positions(fit.joint_angles, ("shoulder",))[:, 0], axis=0))
    return np.asarray(np.stack(origins) - np.mean(origins, axis=0))
