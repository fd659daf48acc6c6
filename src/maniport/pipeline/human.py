"""The person's side: the part of a recording that is used, and the arms of the person in it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from maniport.arms import as_group
from maniport.errors import InvalidInputError, RecordingError, collected_warnings
from maniport.mocap import HumanMotion, Recording, fit_arms
from maniport.pipeline.config import Config
from maniport.pipeline.demonstrations import LearnedProfile
from maniport.pipeline.options import SECTIONS
from maniport.pipeline.settings import Settings, fit_options, read_part
from maniport.util.progress import Step
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

MIN_FRAMES = 3  # frames without which there is no motion

Origin = Mapping[str, str | float | Path]  # options that read a recording again, by name


@dataclass(frozen=True, eq=False)
class Human:
    """Fitted arms of a person, for two arms left first.

    Attributes
    ----------
    recording : Recording
        The part that is used.
    motion : HumanMotion
        Arms and joint angles.
    ellipsoids : tuple of ndarray, shape (n, d, d)
        Of each arm in the trunk frame (x forward, y left, z up), without damping.
    hand_paths : tuple of ndarray, shape (n, 3)
        Of each arm in the frame of all arms [m].
    origin : mapping
        Options that read the same part again.
    warnings : tuple of str
    """

    recording: Recording
    motion: HumanMotion
    ellipsoids: tuple[Array, ...]
    hand_paths: tuple[Array, ...]
    origin: Origin = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def subsampled(self, rate: float) -> "Human":
        """Keep at most so many frames a second [Hz], evenly spaced."""
        count = max(MIN_FRAMES, int(np.ceil(np.ptp(self.motion.time) * rate)) + 1)
        rows = evenly_spaced(len(self.motion), count)
        return Human(
            self.recording,
            self.motion.only(rows),
            tuple(ellipsoids[rows] for ellipsoids in self.ellipsoids),
            tuple(path[rows] for path in self.hand_paths),
            self.origin,
            self.warnings,
        )

    def config(self, config: Config) -> Config:
        """Return options that read the same recording, if they name none."""
        if config.recording:
            return config
        return config.changed(allowed=SECTIONS, **self.origin)


def origin_of(recording: Recording | LearnedProfile | str | Path, config: Config) -> Origin:
    """Return options that read the part of a recording again; none where it has no file."""
    if isinstance(recording, LearnedProfile):
        return {}
    if not isinstance(recording, Recording):
        return {"recording": recording}
    if not recording.source:
        return {}
    origin: dict[str, str | float | Path] = {"recording": str(recording.source)}
    if config.start is None:
        origin["start"] = float(recording.time[0])
    if config.stop is None:
        origin["stop"] = float(recording.time[-1])
    return origin


def read_usable_part(recording: Recording | str | Path, settings: Settings) -> Recording:
    """Read the part of a recording that is used; raise where it has too few frames to be fitted."""
    step = Step(settings.progress, "Read recording")
    part = read_part(recording, settings.config)
    _require_frames(part, len(part), "frames")
    step.end(f"{len(part)} frames, {part.duration:.1f} s at {part.rate:.4g} Hz")
    return part


def _require_frames(recording: Recording, count: int, what: str) -> None:
    if count < MIN_FRAMES:
        raise RecordingError(
            f"{what} of {recording.source!r}: {count}; at least {MIN_FRAMES} are needed"
        )


def fit_human(recording: Recording | LearnedProfile, settings: Settings) -> Human:
    """Fit one or both arms of the person; a learned profile has its arms already."""
    with collected_warnings() as texts:
        if isinstance(recording, LearnedProfile):
            if recording.config.spec != settings.config.spec:
                raise InvalidInputError(
                    f"spec must be that of the learned profile, {recording.config.spec}; found {settings.config.spec}"
                )
            demonstrated = recording.each_arm()
            ellipsoids = [arm.profile for arm in demonstrated]
            hand_paths = [arm.path for arm in demonstrated]
            motion = recording.reference.motion
            recording = recording.reference.recording
        else:
            motion = fit_arms(recording, **fit_options(settings.config), progress=settings.progress)
            _require_frames(recording, len(motion), "frames with the arm fully observed")
            spec = settings.config.spec
            ellipsoids = [fit.arm.ellipsoids(fit.joint_angles, spec) for fit in motion.arms]
            hand_paths = list(motion.hands)

    for given in settings.given_lines:
        given.require_cover(motion.time)
    arms = len(motion.arms)
    count = len(settings.arms)
    if arms > count:
        raise InvalidInputError(f"the profile is of {arms} arms, and the robot has {count}")
    if arms < count:  # each robot arm moves in front of its own base
        origins = as_group(settings.robot).base_positions
        bases = origins - origins.mean(axis=0)
        motion = HumanMotion(motion.arms * count, bases)
        ellipsoids = ellipsoids * count
        hand_paths = [hand_paths[0] + base for base in bases]
    return Human(recording, motion, tuple(ellipsoids), tuple(hand_paths), warnings=tuple(texts))
