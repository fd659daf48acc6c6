"""Several people's recordings, or several times of one, become one profile."""

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import make_smoothing_spline

from maniport.arms import Arm
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

    demonstrations: tuple[Demonstration, ...]
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
    def reference(self) -> Demonstration:
        """The demonstration that gives the times, with the learned arms and its joint angles."""
        own = self.demonstrations[self.alignment.reference]
        source = f"{len(self.demonstrations)} demonstrations"
        note = f"ellipsoids and the hand's path are learned from {source}; the configurations are those of {own.name}"
        recording = replace(own.recording, source=source, notes=(*own.recording.notes, note))
        fits = tuple(
            replace(fit, arm=arm) for fit, arm in zip(own.motion.arms, self.arms, strict=True)
        )
        return replace(own, recording=recording, motion=HumanMotion(fits, self.bases))

    def each_arm(self) -> "tuple[LearnedProfile, ...]":
        """Return the profile, covariance and path of each arm; model and agreement stay those of all arms."""
        d = self.profile.shape[-1] // len(self.arms)
        parts = []
        for i, arm in enumerate(self.arms):
            rows = slice(i * d, (i + 1) * d)
            hand = slice(3 * i, 3 * i + 3)
            columns = np.eye(len(self.arms) * d)[:, rows]
            vectors = to_vector(
                columns @ from_vector(np.eye(d * (d + 1) // 2)) @ columns.T
            )  # of the block's own
            alignment = replace(
                self.alignment, ellipsoids=self.alignment.ellipsoids[..., rows, rows]
            )
            parts.append(replace(
                self, arms=(arm,), bases=self.bases[i : i + 1], alignment=alignment, paths=self.paths[..., hand],
                profile=self.profile[:, rows, rows], covariance=vectors @ self.covariance @ vectors.T,
                path=self.path[:, hand],
            ))  # fmt: skip
        return tuple(parts)

    def write_data(self, folder: Path) -> None:
        """Write the data files into an existing folder.

        ``profile.npz`` and ``path.npz`` are input of ``maniport track``, for both arms ``profile-left.npz`` and so on;
        ``model.npz`` has the attributes of `ProfileGMM`; ``demonstrations.npz`` has ``names``, ``time`` (m,),
        ``ellipsoids`` (k, m, a d, a d) and ``paths`` (k, m, 3 a).
        """
        for part in self.each_arm():
            side = f"-{part.arms[0].side}" if len(self.arms) > 1 else ""
            save_ellipsoids(folder / f"profile{side}.npz", part.profile, self.time)
            save_path(folder / f"path{side}.npz", part.path, self.time)
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
    demonstrations = _demonstrations(
        recordings, _intervals(recordings, config.segments), config, progress
    )
    files = tuple(os.fspath(source) for source in recordings if not isinstance(source, Recording))
    config, spec = replace(config, recording=files, verb="learn"), config.spec
    motions = [demonstration.motion for demonstration in demonstrations]
    arms = _mean_arms(config.person, motions)
    bases = np.mean([motion.bases for motion in motions], axis=0)
    times = []
    ellipsoids = []
    hands = []
    for motion in motions:
        number = np.ceil(np.ptp(motion.time) * RATE) + 1
        rows = evenly_spaced(len(motion), int(np.clip(number, MIN_FRAMES, MAX_ELLIPSOIDS)))
        pairs = [(arm, fit.joint_angles[rows]) for arm, fit in zip(arms, motion.arms, strict=True)]
        blocks = np.zeros((len(rows), len(arms), spec.size, len(arms), spec.size))
        for i, (arm, q) in enumerate(pairs):
            blocks[:, i, :, i] = arm.ellipsoids(q, spec)
        times.append(motion.time[rows])
        ellipsoids.append(blocks.reshape(len(rows), *[len(arms) * spec.size] * 2))
        paths = [
            arm.forward(q)[:, :3, 3] + base for (arm, q), base in zip(pairs, bases, strict=True)
        ]
        hands.append(np.concatenate(paths, axis=1))
    regularization = Regularization(config.damping or None).fitted(np.concatenate(ellipsoids))
    profiles = []
    for own in ellipsoids:
        profiles.append(regularization.apply(own, "the ellipsoids of a demonstration"))
    alignment = align(profiles, times, progress=progress)
    model = ProfileGMM(config.components).fit(*alignment.stacked(), progress=progress)
    time = motions[alignment.reference].time
    profile, covariance = model.predict(time, return_covariance=True)
    warped = alignment.warp(hands)
    # An alignment goes in steps, a hand does not: a spline with half the amplitude at `CUTOFF`.
    strength = 1.0 / (float(np.median(np.diff(alignment.time))) * (2.0 * np.pi * CUTOFF) ** 4)
    path = []
    for axis in warped.mean(axis=0).T:
        path.append(make_smoothing_spline(alignment.time, axis, lam=strength)(time))
    return LearnedProfile(
        demonstrations, tuple(arms), bases, alignment, warped, model, time, np.asarray(profile), covariance,
        np.stack(path, axis=-1), agreement(profiles, alignment, model, progress), config,
    )  # fmt: skip


def _pairs(part: Any) -> Any:
    """Return start and end of segments as they are, or from text such as 2:4,4:5.6."""
    if not isinstance(part, str):
        return part
    pairs = []
    for text in part.split(","):
        pairs.append([float(number) for number in text.split(":")])
    return pairs


def _intervals(
    recordings: Sequence[Recording | str | Path], segments: tuple[Any, ...]
) -> list[Any]:
    """Check the segments; return those of each recording, [None] for the whole, or "auto"."""
    if isinstance(recordings, str | Path | Recording) or not len(recordings):
        raise InvalidInputError("recordings must be a sequence of at least one recording")
    parts: list[Any] = list(segments or (None,))
    if parts in ([None], [AUTO]):
        parts *= len(recordings)
    if len(parts) != len(recordings):
        raise InvalidInputError(
            f"{argument('segments')} must be one list for each of the {len(recordings)} recordings; found {segments!r}"
        )
    for index, part in enumerate(parts):
        if part is None or part == AUTO:
            parts[index] = part or [None]
            continue
        try:
            pairs = _pairs(part)
            parts[index] = [tuple(as_numbers(pair, "segment", 2).tolist()) for pair in pairs]
        except ValueError:
            rule = f"{argument('segments')} must be {AUTO} or times such as 2:4,4:5.6 [s]"
            raise InvalidInputError(f"{rule}; found {part!r}") from None
        times = []
        for pair in sorted(parts[index]):
            for time in pair:
                times.append(time)
        if times != sorted(times) or any(start == stop for start, stop in parts[index]):
            raise InvalidInputError(
                f"segments must begin before they end, and must not overlap; found {part!r}"
            )
    if AUTO not in parts:
        _require_two(sum(map(len, parts)))
    return parts


def _require_two(count: int) -> None:
    if count < 2:
        text = f"give several recordings, or {argument('segments')} of one"
        raise InvalidInputError(f"at least two demonstrations are needed; found {count}: {text}")


def _demonstrations(
    recordings: Sequence[Recording | str | Path],
    parts: list[Any],
    config: Config,
    progress: Progress | None,
) -> tuple[Demonstration, ...]:
    """Fit the person's arms to each recording, and cut the fits."""
    demonstrations = list[Demonstration]()
    step = Step(progress, "Fit human arms")
    for source, segments in zip(counted(recordings, len(recordings), step), parts, strict=True):
        recording = read_part(source, config)
        name = Path(recording.source).name or "a recording"
        first = recording.time[0]
        last = recording.time[-1]
        for start, stop in [] if segments == AUTO else filter(None, segments):
            if start < first - 1.0 / recording.rate or stop > last + 1.0 / recording.rate:
                raise InvalidInputError(
                    f"segments of {name} must lie between {first:.2f} and {last:.2f} s; found {start:g} to {stop:g} s"
                )
        motion = fit_arms(recording, **fit_options(config))
        texts = tuple(
            f"{name}: {text}" for text in (*recording.quality_warnings, *motion.quality_warnings)
        )
        for segment in motion.repetitions() if segments == AUTO else segments:
            start, stop = segment or (first, last)
            kept = (motion.time >= start) & (motion.time <= stop)
            if (frames := int(kept.sum())) < MIN_FRAMES:
                raise InvalidInputError(
                    f"{name} from {start:.2f} to {stop:.2f} s has {frames} frames in which the arm is fully observed; "
                    f"a demonstration needs at least {MIN_FRAMES}"
                )
            title = name if segment is None else f"{name} {start:.4g}–{stop:.4g} s"
            demonstrations.append(Demonstration(title, recording, motion.only(kept), texts))
    _require_two(len(demonstrations))
    step.end(
        f"{len(demonstrations)} demonstrations in {len(recordings)} recording{'s' * (len(recordings) > 1)}"
    )
    names = Counter(own.name for own in demonstrations)
    return tuple(
        replace(own, name=f"{own.name} ({number})") if names[own.name] > 1 else own
        for number, own in enumerate(demonstrations, 1)
    )


def _mean_arms(person: str, motions: Sequence[HumanMotion]) -> list[Arm]:
    """Return each arm of the person, of the side of most demonstrations, with the mean of the recorded lengths."""
    arms = []
    for fits in zip(*(motion.arms for motion in motions), strict=True):
        sides = Counter(fit.arm.side for fit in fits)
        lengths = dict[str, list[float]]()
        for name, length in (pair for fit in fits for pair in fit.segment_lengths.items()):
            lengths.setdefault(name, []).append(length)
        means = {name: float(np.mean(values)) for name, values in lengths.items()}
        arms.append(human_arm(person, max(SIDES, key=sides.__getitem__), lengths=means))
    return arms
