"""Several people's recordings, or several times of one, become one profile."""

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import make_smoothing_spline

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.chain import SIDES
from maniport.arms.human import human_arm
from maniport.errors import InvalidInputError, argument
from maniport.learning import Alignment, ProfileGMM, align
from maniport.learning.alignment import Agreement, agreement
from maniport.mocap import HumanMotion, Recording, fit_arms
from maniport.pipeline.config import Config
from maniport.pipeline.options import TransferOptions
from maniport.pipeline.results import SavedResult
from maniport.pipeline.settings import fit_options, read_part
from maniport.spd.matrix_functions import from_vector, to_vector
from maniport.spd.regularization import Regularization
from maniport.util.defaults import AUTO
from maniport.util.files import save_arrays, save_ellipsoids, save_path
from maniport.util.progress import Progress, Step, counted
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_numbers

MIN_FRAMES = 10  # Fewest frames of a demonstration
# Ellipsoids of a demonstration per second, and at most; arms move below 10 Hz
RATE = 30.0
MAX_ELLIPSOIDS = 1500
CUTOFF = 8.0  # Cutoff frequency of the learned path [Hz]

Interval = tuple[float, float]  # Start and end of a demonstration [s]
Segments = (
    str | Sequence[Sequence[float]] | None
)  # Of a recording: `AUTO`, text or numbers, None: the whole


@dataclass(frozen=True, eq=False)
class Performance:
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
    demonstrations : tuple of Performance
    arms : tuple of Arm
        The human arms with the mean lengths of all, in whose base frames the ellipsoids are.
    bases : ndarray, shape (a, 3)
        Origins of these base frames in the common frame of the arms [m], see `maniport.mocap.HumanMotion`.
    alignment : Alignment
        The demonstrations on common times.
    paths : ndarray, shape (k, m, 3 a)
        Their hands on these times, in the trunk frame [m].
    model : ProfileGMM
    time : ndarray, shape (n,)
        Of the reference demonstration [s], all of its frames.
    profile : ndarray, shape (n, a d, a d)
        The ellipsoid at each time, with regularization.
    covariance : ndarray, shape (n, p, p)
        See `ProfileGMM.predict`.
    path : ndarray, shape (n, 3 a)
        Mean of the hands, smoothed over time [m].
    agreement : Agreement
        Agreement of the demonstrations.
    config : Config
        Options of the run, with files of recordings only.
    """

    demonstrations: tuple[Performance, ...]
    arms: tuple[Arm, ...]
    bases: Array
    alignment: Alignment
    paths: Array
    model: ProfileGMM
    time: Array
    profile: Array
    covariance: Array
    path: Array
    agreement: Agreement
    config: Config

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
    def reference(self) -> Performance:
        """The demonstration that gives the times, with the learned arms and its joint angles."""
        reference = self.demonstrations[self.alignment.reference]
        source = f"{len(self.demonstrations)} demonstrations"
        note = f"ellipsoids and the hand's path are learned from {source}; the configurations are those of "
        notes = (*reference.recording.notes, note + reference.name)
        recording = replace(reference.recording, source=source, notes=notes)
        fits = []
        for fit, arm in zip(reference.motion.arms, self.arms, strict=True):
            fits.append(replace(fit, arm=arm))
        motion = HumanMotion(tuple(fits), self.bases)
        return replace(reference, recording=recording, motion=motion)

    def each_arm(self) -> "tuple[LearnedProfile, ...]":
        """Return the profile, covariance and path of each arm; model and agreement stay those of all arms."""
        d = self.profile.shape[-1] // len(self.arms)
        units = from_vector(np.eye(d * (d + 1) // 2))
        profiles = []
        for i, arm in enumerate(self.arms):
            rows = slice(i * d, (i + 1) * d)
            hand = slice(3 * i, 3 * i + 3)
            columns = np.eye(len(self.arms) * d)[:, rows]
            vectors = to_vector(columns @ units @ columns.T)  # of units of the block in all blocks
            ellipsoids = self.alignment.ellipsoids[..., rows, rows]
            profile = replace(
                self,
                arms=(arm,),
                bases=self.bases[i : i + 1],
                alignment=replace(self.alignment, ellipsoids=ellipsoids),
                paths=self.paths[..., hand],
                profile=self.profile[:, rows, rows],
                covariance=vectors @ self.covariance @ vectors.T,
                path=self.path[:, hand],
            )
            profiles.append(profile)
        return tuple(profiles)

    def write_data(self, folder: Path) -> None:
        """Write the data files into an existing folder.

        ``profile.npz`` and ``path.npz`` are input of ``maniport track``, for both arms ``profile-left.npz`` and so on;
        ``model.npz`` has the attributes of `ProfileGMM`; ``demonstrations.npz`` has ``names``, ``time`` (m,),
        ``ellipsoids`` (k, m, a d, a d) and ``paths`` (k, m, 3 a).
        """
        for learned in self.each_arm():
            side = f"-{learned.arms[0].side}" if len(self.arms) > 1 else ""
            save_ellipsoids(folder / f"profile{side}.npz", learned.profile, self.time)
            save_path(folder / f"path{side}.npz", learned.path, self.time)
        names = "weights_", "input_means_", "means_", "covariances_"
        save_arrays(
            folder / "model.npz", {name.strip("_"): getattr(self.model, name) for name in names}
        )
        aligned = {
            "time": self.alignment.time,
            "ellipsoids": self.alignment.ellipsoids,
            "paths": self.paths,
        }
        save_arrays(folder / "demonstrations.npz", {"names": np.array(self.names), **aligned})


def learn(
    recordings: Sequence[Recording | str | Path],
    config: TransferOptions | None = None,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> LearnedProfile:
    """Learn one profile of ellipsoids, and one path of the hand, from several demonstrations of a motion.

    One arm or both are fitted to each recording; the ellipsoids of both are blocks of one matrix, so that the arms are
    aligned together. All ellipsoids are those of arms with the mean of all lengths. `maniport.learning.align` brings
    the demonstrations to common times, a `maniport.learning.ProfileGMM` over time gives mean and covariance of the
    ellipsoid at each time. Left and right may be mixed: the rarer are mirrored.

    Parameters
    ----------
    recordings : sequence of Recording, str or Path
        At least two demonstrations: recordings, or segments of them.
    config : TransferOptions, optional
        Options of the persons, the ellipsoids and the learning.
    progress : callable, optional
        Called with the name of a step and the fraction done.
    **options
        Options by name, which override those of `config`; `maniport.pipeline.options` describes them. ``segments`` are
        "auto" for all times that a hand goes out and back (`maniport.mocap.ArmFit.repetitions`), or have an entry for
        each recording: "auto", a sequence of (start, stop) [s], each a demonstration, or None for the whole.

    Raises
    ------
    ManiportError
        When an input cannot be used, there are fewer than two demonstrations, one is too short or they overlap.
    """
    config = Config.of(config).changed(allowed=("human", "transfer", "learning"), **options)
    intervals = _intervals(recordings, config.segments)
    demonstrations = _demonstrations(recordings, intervals, config, progress)
    files = tuple(os.fspath(source) for source in recordings if not isinstance(source, Recording))
    config = replace(config, recording=files, verb="learn")
    motions = [demonstration.motion for demonstration in demonstrations]
    arms = _mean_arms(config.person, motions)
    bases = np.mean([motion.bases for motion in motions], axis=0)

    times = []
    ellipsoids = []
    hands = []
    for motion in motions:
        sampled = _sampled(motion, arms, bases, config.spec)
        times.append(sampled.time)
        ellipsoids.append(sampled.ellipsoids)
        hands.append(sampled.hands)
    regularization = Regularization(config.damping or None).fitted(np.concatenate(ellipsoids))
    profiles = []
    for blocks in ellipsoids:
        profiles.append(regularization.apply(blocks, "the ellipsoids of a demonstration"))

    alignment = align(profiles, times, progress=progress)
    model = ProfileGMM(config.components).fit(*alignment.stacked(), progress=progress)
    time = motions[alignment.reference].time
    profile, covariance = model.predict(time, return_covariance=True)
    paths = alignment.warp(hands)
    return LearnedProfile(
        demonstrations=demonstrations,
        arms=tuple(arms),
        bases=bases,
        alignment=alignment,
        paths=paths,
        model=model,
        time=time,
        profile=np.asarray(profile),
        covariance=covariance,
        path=_smoothed(paths.mean(axis=0), alignment.time, time),
        agreement=agreement(profiles, alignment, model, progress),
        config=config,
    )


class _Sampled(NamedTuple):
    """A demonstration at m of its frames, with a arms."""

    time: Array  # (m,) [s]
    ellipsoids: Array  # (m, a d, a d), those of each arm are a block
    hands: Array  # (m, 3 a), positions in the common frame [m]


def _sampled(
    motion: HumanMotion, arms: Sequence[Arm], bases: Array, spec: EllipsoidSpec
) -> _Sampled:
    """Take `RATE` frames a second of a motion, with ellipsoids and hands of arms of other lengths."""
    number = np.ceil(np.ptp(motion.time) * RATE) + 1
    rows = evenly_spaced(len(motion), int(np.clip(number, MIN_FRAMES, MAX_ELLIPSOIDS)))
    blocks = np.zeros((len(rows), len(arms), spec.size, len(arms), spec.size))
    hands = []
    for i, (arm, fit) in enumerate(zip(arms, motion.arms, strict=True)):
        q = fit.joint_angles[rows]
        blocks[:, i, :, i] = arm.ellipsoids(q, spec)
        hands.append(arm.forward(q)[:, :3, 3] + bases[i])
    size = len(arms) * spec.size
    ellipsoids = blocks.reshape(len(rows), size, size)
    return _Sampled(motion.time[rows], ellipsoids, np.concatenate(hands, axis=1))


def _smoothed(path: Array, aligned_time: Array, time: Array) -> Array:
    """Return a path (m, 3 a) at times (n,) on a spline with half the amplitude at `CUTOFF`.

    An alignment goes in steps, a hand does not.
    """
    strength = 1.0 / (float(np.median(np.diff(aligned_time))) * (2.0 * np.pi * CUTOFF) ** 4)
    columns = []
    for column in path.T:
        columns.append(make_smoothing_spline(aligned_time, column, lam=strength)(time))
    return np.stack(columns, axis=-1)


def _intervals(
    recordings: Sequence[Recording | str | Path], segments: Sequence[Segments]
) -> list[list[Interval | None] | str]:
    """Check the segments; return those of each recording, [None] for the whole, or "auto"."""
    if isinstance(recordings, str | Path | Recording) or not len(recordings):
        raise InvalidInputError("recordings must be a sequence of at least one recording")
    stated = list(segments or (None,))
    if stated in ([None], [AUTO]):
        stated *= len(recordings)
    if len(stated) != len(recordings):
        raise InvalidInputError(
            f"{argument('segments')} must be one list for each of the {len(recordings)} recordings; found {segments!r}"
        )
    intervals = [_checked_segments(of_recording) for of_recording in stated]
    if AUTO not in intervals:
        _require_two(sum(map(len, intervals)))
    return intervals


def _checked_segments(segments: Segments) -> list[Interval | None] | str:
    """Return the intervals of a recording, [None] for the whole, or "auto"."""
    if segments is None:
        return [None]
    if segments == AUTO:
        return AUTO
    intervals = list[Interval]()
    try:
        for pair in _pairs(segments):
            start, stop = as_numbers(pair, "segment", 2).tolist()
            intervals.append((start, stop))
    except ValueError:
        rule = f"{argument('segments')} must be {AUTO} or times such as 2:4,4:5.6 [s]"
        raise InvalidInputError(f"{rule}; found {segments!r}") from None

    end = -np.inf
    for start, stop in sorted(intervals):
        if start < end or stop <= start:
            raise InvalidInputError(
                f"segments must begin before they end, and must not overlap; found {segments!r}"
            )
        end = stop
    return list(intervals)


def _pairs(segments: str | Sequence[Sequence[float]]) -> Sequence[Sequence[float]]:
    """Return start and end of segments as they are, or from text such as 2:4,4:5.6."""
    if not isinstance(segments, str):
        return segments
    pairs = []
    for text in segments.split(","):
        pairs.append([float(number) for number in text.split(":")])
    return pairs


def _require_two(count: int) -> None:
    if count < 2:
        text = f"give several recordings, or {argument('segments')} of one"
        raise InvalidInputError(f"at least two demonstrations are needed; found {count}: {text}")


def _demonstrations(
    recordings: Sequence[Recording | str | Path],
    intervals: Sequence[list[Interval | None] | str],
    config: Config,
    progress: Progress | None,
) -> tuple[Performance, ...]:
    """Fit the person's arms to each recording, and cut the fits."""
    demonstrations = list[Performance]()
    step = Step(progress, "Fit human arms")
    steps = counted(recordings, len(recordings), step)
    for source, of_recording in zip(steps, intervals, strict=True):
        demonstrations += _cut(read_part(source, config), of_recording, config)
    _require_two(len(demonstrations))
    step.end(
        f"{len(demonstrations)} demonstrations in {len(recordings)} recording{'s' * (len(recordings) > 1)}"
    )

    names = Counter(demonstration.name for demonstration in demonstrations)
    for i, demonstration in enumerate(demonstrations):
        name = demonstration.name
        if names[name] > 1:
            demonstrations[i] = replace(demonstration, name=f"{name} ({i + 1})")
    return tuple(demonstrations)


def _cut(
    recording: Recording, intervals: list[Interval | None] | str, config: Config
) -> list[Performance]:
    """Fit the person's arms to a recording; return each interval of it, for "auto" each repetition."""
    name = Path(recording.source).name or "a recording"
    if not isinstance(intervals, str):
        _require_inside(intervals, recording, name)
    motion = fit_arms(recording, **fit_options(config))
    if isinstance(intervals, str):
        intervals = list(motion.repetitions())
    quality_warnings = []
    for text in (*recording.quality_warnings, *motion.quality_warnings):
        quality_warnings.append(f"{name}: {text}")

    demonstrations = []
    for interval in intervals:
        start = recording.time[0]
        stop = recording.time[-1]
        title = name
        if interval is not None:
            start, stop = interval
            title = f"{name} {start:.4g}–{stop:.4g} s"
        frames = (motion.time >= start) & (motion.time <= stop)
        count = int(frames.sum())
        if count < MIN_FRAMES:
            raise InvalidInputError(
                f"{name} from {start:.2f} to {stop:.2f} s has {count} frames in which the arm is fully observed; "
                f"a demonstration needs at least {MIN_FRAMES}"
            )
        demonstration = Performance(title, recording, motion.only(frames), tuple(quality_warnings))
        demonstrations.append(demonstration)
    return demonstrations


def _require_inside(intervals: Sequence[Interval | None], recording: Recording, name: str) -> None:
    """Raise where an interval exceeds the times of a recording by more than a frame."""
    first = recording.time[0]
    last = recording.time[-1]
    frame = 1.0 / recording.rate
    for interval in intervals:
        if interval is None:
            continue
        start, stop = interval
        if start < first - frame or stop > last + frame:
            raise InvalidInputError(
                f"segments of {name} must lie between {first:.2f} and {last:.2f} s; found {start:g} to {stop:g} s"
            )


def _mean_arms(person: str, motions: Sequence[HumanMotion]) -> list[Arm]:
    """Return each arm of the person, of the side of most demonstrations, with the mean of the recorded lengths."""
    arms = []
    for fits in zip(*(motion.arms for motion in motions), strict=True):
        sides = Counter(fit.arm.side for fit in fits)
        lengths = dict[str, list[float]]()
        for fit in fits:
            for name, length in fit.segment_lengths.items():
                lengths.setdefault(name, []).append(length)
        means = {name: float(np.mean(values)) for name, values in lengths.items()}
        side = max(SIDES, key=sides.__getitem__)
        arms.append(human_arm(person, side, lengths=means))
    return arms
