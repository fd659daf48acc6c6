"""Several people's recordings, or several times of one, become one profile."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import make_smoothing_spline

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.chain import RIGHT, SIDES
from maniport.arms.human import human_arm
from maniport.errors import InvalidInputError, argument
from maniport.learning import ProfileGMM, align
from maniport.learning.agreement import agreement
from maniport.mocap import HumanMotion, Recording, fit_arms, read_recording
from maniport.mocap.arm_ik import require_person
from maniport.mocap.directions import SEGMENTS
from maniport.pipeline.learned import Demonstration, LearnedProfile, block_diagonal
from maniport.spd.regularization import Regularization
from maniport.util.defaults import AUTO, BOTH, DAMPING, KEEP, PERSON
from maniport.util.progress import Progress, Step, counted
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import as_choice, as_count, as_numbers

MIN_FRAMES = 10  # Fewest frames of a demonstration
RATE, MAX_ELLIPSOIDS = 30.0, 1500  # Ellipsoids of a demonstration per second, and at most; arms move below 10 Hz
MAX_COMPONENTS = 32  # Gaussians, without a number of the caller
CUTOFF = 8.0  # Cutoff frequency of the learned path [Hz]

Segments = str | Sequence[str | Sequence[tuple[float, float]] | None]


def learn(
    recordings: Sequence[Recording | str | Path],
    segments: Segments | None = None,
    person: str = PERSON,
    *,
    spec: EllipsoidSpec = VELOCITY,
    markers: Mapping[str, Any] | None = None,
    side: str = AUTO,
    height: float | None = None,
    smooth: str | float = AUTO,
    jumps: str = KEEP,
    lengths: str = "mean",
    damping: float | None = DAMPING,
    components: int | None = None,
    random_state: int = 0,
    progress: Progress | None = None,
) -> LearnedProfile:
    """Learn one profile of ellipsoids, and one path of the hand, from several demonstrations of a motion.

    One arm or both are fitted to each recording. The ellipsoids of both are blocks of one matrix, of which d² is the
    sum of the d² of the arms, so that the arms are aligned together. Demonstrations are brought to common times by
    `maniport.learning.align`; a `maniport.learning.ProfileGMM` over time gives the ellipsoid at each time and how much
    it may vary. Their agreement is measured, also by leave-one-out. Left and right may be
    mixed: the rarer are mirrored.

    Parameters
    ----------
    recordings : sequence of Recording, str or Path
        At least two demonstrations: recordings, or segments of them.
    segments : "auto" or sequence, one entry for each recording, optional
        Each a sequence of (start, stop) [s], each a demonstration; "auto" for all times that the hand goes out and back
        (`maniport.mocap.ArmFit.repetitions`); None for the whole recording.
    person, markers, side, height, smooth, jumps : optional
        For all recordings; see `fit_arms`.
    spec : EllipsoidSpec
        Which ellipsoids.
    lengths : {"mean", "own"}
        With "mean" all ellipsoids are made by one arm with the mean of all lengths, so that ways of using an arm are
        compared; with "own" sizes count, too: at equal joint angles by 2 √3 log of the ratio of lengths.
    damping : float, optional
        Regularization of ellipsoids, which are singular where an arm is stretched; see `maniport.spd.regularization`.
    components : int, optional
        Number of Gaussians. Default: of 1, 2, 4, 8, 16 and 32 the last before the BIC grows.
    random_state, progress : optional
        Seed of everything that is drawn; called with the name of a step and the fraction done.

    Raises
    ------
    ManiportError
        When an input cannot be used, there are fewer than two demonstrations, one is too short or they overlap.
    """
    require_person(person, AUTO if side == BOTH else side, height, smooth, jumps)
    as_choice(lengths, "lengths", ("mean", "own"))
    regularization = Regularization(damping)
    seed = as_count(random_state, "random_state", minimum=0)
    components = None if components is None else as_count(components, "components")
    options = {"person": person, "markers": markers, "side": side, "height": height, "smooth": smooth, "jumps": jumps}
    demonstrations = _demonstrations(recordings, _intervals(recordings, segments), options, progress)
    motions = [demonstration.motion for demonstration in demonstrations]
    arms, bases = _mean_arms(person, motions), np.mean([motion.bases for motion in motions], axis=0)
    times, ellipsoids, hands = [], [], []
    for motion in motions:
        number = np.ceil(np.ptp(motion.time) * RATE) + 1
        rows = evenly_spaced(len(motion), int(np.clip(number, MIN_FRAMES, MAX_ELLIPSOIDS)))
        bodies = arms
        if lengths == "own":
            bodies = [human_arm(person, arm.side or RIGHT, lengths=fit.segment_lengths)
                      for arm, fit in zip(arms, motion.arms, strict=True)]  # fmt: skip
        pairs = [(body, fit.joint_angles[rows]) for body, fit in zip(bodies, motion.arms, strict=True)]
        times.append(motion.time[rows])
        ellipsoids.append(block_diagonal([body.ellipsoids(q, spec) for body, q in pairs]))
        paths = [body.forward(q)[:, :3, 3] + base for (body, q), base in zip(pairs, bases, strict=True)]
        hands.append(np.concatenate(paths, axis=1))
    regularization = regularization.fitted(np.concatenate(ellipsoids))
    profiles = [regularization.apply(own, "the ellipsoids of a demonstration") for own in ellipsoids]
    alignment = align(profiles, times, progress=progress)
    mixture = ProfileGMM(components, MAX_COMPONENTS, random_state=seed)
    model = mixture.fit(*alignment.stacked(), progress=progress)
    time = motions[alignment.reference].time
    profile, covariance = model.predict(time, return_covariance=True)
    warped = alignment.warp(hands)
    # An alignment goes in steps, a hand does not: a spline with half the amplitude at `CUTOFF`.
    strength = 1.0 / (float(np.median(np.diff(alignment.time))) * (2.0 * np.pi * CUTOFF) ** 4)
    path = [make_smoothing_spline(alignment.time, axis, lam=strength)(time) for axis in warped.mean(axis=0).T]
    return LearnedProfile(
        demonstrations, tuple(arms), bases, lengths, spec, regularization, alignment, warped, model, time,
        np.asarray(profile), covariance, np.stack(path, axis=-1), agreement(profiles, alignment, model, progress), seed,
    )  # fmt: skip


def _intervals(recordings: Sequence[Recording | str | Path], segments: Segments | None) -> list[Any]:
    """Check the segments; return those of each recording, [None] for the whole, or "auto"."""
    if isinstance(recordings, str | Path | Recording) or not len(recordings):
        raise InvalidInputError("recordings must be a sequence of at least one recording")
    parts: list[Any] = [segments] * len(recordings) if segments is None or segments == AUTO else list(segments)
    if (isinstance(segments, str) and segments != AUTO) or len(parts) != len(recordings):
        raise InvalidInputError(
            f"{argument('segments')} must be one list for each of the {len(recordings)} recordings; found {segments!r}"
        )
    for index, part in enumerate(parts):
        if part is None or part == AUTO:
            parts[index] = part or [None]
            continue
        if isinstance(part, str):
            raise InvalidInputError(f"{argument('segments')} must be {AUTO!r} or (start, stop) [s]; found {part!r}")
        times = [tuple(map(float, as_numbers(pair, "a segment (start, stop) [s]", 2))) for pair in part]
        for start, stop in times:
            if not start < stop:
                raise InvalidInputError(f"a segment must begin before it ends; found {start:g} to {stop:g} s")
        for (_, before), (after, _) in pairwise(sorted(times)):
            if after < before:
                raise InvalidInputError(
                    f"segments must not overlap, or they agree by themselves; found one up to {before:g} s "
                    f"and one from {after:g} s"
                )
        parts[index] = times
    if AUTO not in parts:
        _require_two(sum(map(len, parts)))
    return parts


def _require_two(count: int) -> None:
    if count < 2:
        raise InvalidInputError(
            f"at least two demonstrations are needed; found {count}: give several recordings, or "
            f"{argument('segments')} of one"
        )


def _demonstrations(
    recordings: Sequence[Recording | str | Path], parts: list[Any], options: dict[str, Any], progress: Progress | None
) -> tuple[Demonstration, ...]:
    """Fit the person's arms to each recording, and cut the fits."""
    demonstrations: list[Demonstration] = []
    step = Step(progress, "Fit human arms")
    for source, segments in zip(counted(recordings, len(recordings), step), parts, strict=True):
        recording = source if isinstance(source, Recording) else read_recording(source)
        name = Path(recording.source).name or "a recording"
        first, last = recording.time[0], recording.time[-1]
        for start, stop in [] if segments == AUTO else filter(None, segments):
            if start < first - 1.0 / recording.rate or stop > last + 1.0 / recording.rate:
                raise InvalidInputError(
                    f"segments of {name} must lie between {first:.2f} and {last:.2f} s; found {start:g} to {stop:g} s"
                )
        motion = fit_arms(recording, **options)
        texts = tuple(f"{name}: {text}" for text in (*recording.quality_warnings, *motion.quality_warnings))
        for segment in motion.repetitions() if segments == AUTO else segments:
            start, stop = segment or (first, last)
            frames = int(np.sum((motion.time >= start) & (motion.time <= stop)))
            if frames < MIN_FRAMES:
                raise InvalidInputError(
                    f"{name} from {start:.2f} to {stop:.2f} s has {frames} frames in which the arm is fully observed; "
                    f"a demonstration needs at least {MIN_FRAMES}"
                )
            title = name if segment is None else f"{name} {start:.4g}–{stop:.4g} s"
            demonstrations.append(Demonstration(title, recording, motion.crop(start, stop), texts))
    _require_two(len(demonstrations))
    step.end(f"{len(demonstrations)} demonstrations in {len(recordings)} recording{'s' * (len(recordings) > 1)}")
    again = Counter(demonstration.name for demonstration in demonstrations)
    return tuple(
        replace(own, name=f"{own.name} ({number})") if again[own.name] > 1 else own
        for number, own in enumerate(demonstrations, 1)
    )


def _mean_arms(person: str, motions: Sequence[HumanMotion]) -> list[Arm]:
    """Return each arm of the person, of the side of most demonstrations, with the mean of the recorded lengths."""
    arms = []
    for fits in zip(*(motion.arms for motion in motions), strict=True):
        sides = Counter(fit.arm.side for fit in fits)
        recorded = {
            name: [fit.segment_lengths[name] for fit in fits if name in fit.segment_lengths] for name in SEGMENTS
        }
        means = {name: float(np.mean(lengths)) for name, lengths in recorded.items() if lengths}
        arms.append(human_arm(person, max(SIDES, key=sides.__getitem__), lengths=means))
    return arms
