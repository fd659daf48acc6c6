"""Several people's recordings, or several times of one, become one profile."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import make_smoothing_spline

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.chain import RIGHT, SIDES
from maniport.arms.human import human_arm
from maniport.errors import InvalidInputError, argument
from maniport.learning import Alignment, ProfileGMM, align
from maniport.learning.agreement import agreement
from maniport.learning.mixture import points_each
from maniport.mocap import Recording, fit_arm, read_recording
from maniport.mocap.arm_ik import require_person
from maniport.pipeline.learned import Demonstration, LearnedProfile
from maniport.spd.regularization import Regularization
from maniport.util.defaults import AUTO, DAMPING, KEEP, PERSON
from maniport.util.progress import Progress, Step, counted
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_choice, as_count, as_numbers

FEWEST = 10  # A demonstration has at least so many frames

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
    eigenvalue_floor: float | None = None,
    components: int | None = None,
    random_state: int = 0,
    progress: Progress | None = None,
) -> LearnedProfile:
    """Learn one profile of ellipsoids, and one path of the hand, from several demonstrations of a motion.

    An arm is fitted to each recording. Demonstrations are brought to common times by `maniport.learning.align`; a
    `maniport.learning.ProfileGMM` over time gives the ellipsoid at each time and how much it may vary. How alike the
    demonstrations are is measured, also by leaving each one out. Left and right may be mixed: the rarer are mirrored.

    Parameters
    ----------
    recordings : sequence of Recording, str or Path
        At least two demonstrations: recordings, or segments of them.
    segments : "auto" or sequence, one entry for each recording, optional
        Each a sequence of (start, stop) [s], each a demonstration; "auto" for all times that the hand goes out and back
        (`maniport.mocap.ArmFit.repetitions`); None for the whole recording.
    person, markers, side, height, smooth, jumps : optional
        For all recordings; see `fit_arm`.
    spec : EllipsoidSpec
        Which ellipsoids.
    lengths : {"mean", "own"}
        With "mean" all ellipsoids are made by one arm with the mean of all lengths, so that ways of using an arm are
        compared; with "own" sizes count, too: at equal joint angles by 2 √3 log of the ratio of lengths.
    damping, eigenvalue_floor : float, optional
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
    require_person(person, side, height, smooth, jumps)
    as_choice(lengths, "lengths", ("mean", "own"))
    regularization = Regularization(damping, eigenvalue_floor)
    seed = as_count(random_state, "random_state", minimum=0)
    count = None if components is None else as_count(components, "components")
    parts = _checked(recordings, segments)
    whose = {"person": person, "markers": markers, "side": side, "height": height, "smooth": smooth, "jumps": jumps}
    shown = _demonstrations(recordings, parts, whose, progress)
    arm = _common_arm(person, shown)
    own = [human_arm(person, arm.side or RIGHT, lengths=one.fit.segment_lengths) for one in shown]
    arms = own if lengths == "own" else [arm] * len(shown)
    thin = [evenly_spaced(len(one.fit), _count(one.fit.time)) for one in shown]
    joints = [one.fit.joint_angles[some] for one, some in zip(shown, thin, strict=True)]
    made = [body.ellipsoids(q, spec) for body, q in zip(arms, joints, strict=True)]
    regularization = regularization.fitted(np.concatenate(made))
    profiles = [regularization.apply(one, "the ellipsoids of a demonstration") for one in made]
    times = [one.fit.time[some] for one, some in zip(shown, thin, strict=True)]
    alignment = align(profiles, times, progress=progress)
    model = _fitted(count, alignment, seed, progress)
    time = shown[alignment.reference].fit.time
    profile, covariance = model.predict(time, return_covariance=True)
    paths = alignment.warp([body.forward(q)[:, :3, 3] for body, q in zip(arms, joints, strict=True)])
    return LearnedProfile(
        tuple(shown), arm, lengths, spec, regularization, alignment, paths, model, time, np.asarray(profile),
        covariance, _smoothed(alignment, paths, time), agreement(profiles, alignment, model, progress), seed,
    )  # fmt: skip


def _checked(recordings: Sequence[Recording | str | Path], segments: Segments | None) -> list[Any]:
    """Segments of each recording, [None] for the whole, or "auto"."""
    if isinstance(recordings, str | Path | Recording) or not len(recordings):
        raise InvalidInputError("recordings must be a sequence of at least one recording")
    given = [segments] * len(recordings) if segments is None or segments == AUTO else segments
    if isinstance(given, str) or len(given) != len(recordings):
        raise InvalidInputError(
            f"{argument('segments')} must be one list for each of the {len(recordings)} recordings; found {segments!r}"
        )
    parts = [[None] if one is None else one if one == AUTO else _intervals(one) for one in given]
    if AUTO not in parts:
        _require_two(sum(map(len, parts)))
    return parts


def _require_two(count: int) -> None:
    if count < 2:
        raise InvalidInputError(
            f"at least two demonstrations are needed; found {count}: give several recordings, or "
            f"{argument('segments')} of one"
        )


def _intervals(given: str | Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    if isinstance(given, str):
        raise InvalidInputError(f"{argument('segments')} must be {AUTO!r} or (start, stop) [s]; found {given!r}")
    found = []
    for one in given:
        start, stop = as_numbers(one, "a segment (start, stop) [s]", 2)
        if not start < stop:
            raise InvalidInputError(f"a segment must begin before it ends; found {start:g} to {stop:g} s")
        found.append((float(start), float(stop)))
    for (_, before), (after, _) in zip(sorted(found), sorted(found)[1:], strict=False):
        if after < before:
            raise InvalidInputError(
                f"segments must not overlap, or they agree by themselves; found one up to {before:g} s "
                f"and one from {after:g} s"
            )
    return found


def _demonstrations(
    recordings: Sequence[Recording | str | Path],
    parts: list[Any],
    whose: dict[str, Any],
    progress: Progress | None,
) -> list[Demonstration]:
    """Fit an arm to each recording, and cut the fits."""
    found: list[Demonstration] = []
    step = Step(progress, "Fit human arms")
    for given, segments in zip(counted(recordings, len(recordings), step), parts, strict=True):
        recording = given if isinstance(given, Recording) else read_recording(given)
        found += _cut(recording, segments, whose)
    _require_two(len(found))
    step.end(f"{len(found)} demonstrations in {len(recordings)} recording{'s' if len(recordings) > 1 else ''}")
    again = Counter(one.name for one in found)
    return [
        replace(one, name=f"{one.name} ({number})") if again[one.name] > 1 else one
        for number, one in enumerate(found, 1)
    ]


def _cut(recording: Recording, segments: Any, whose: dict[str, Any]) -> Iterator[Demonstration]:
    """Demonstrations in a recording, its segments or those that are found in it."""
    source = Path(recording.source).name or "a recording"
    first, last = recording.time[0], recording.time[-1]
    for start, stop in [] if segments == AUTO else filter(None, segments):
        if start < first - 1.0 / recording.rate or stop > last + 1.0 / recording.rate:
            raise InvalidInputError(
                f"segments of {source} must lie between {first:.2f} and {last:.2f} s; found {start:g} to {stop:g} s"
            )
    fit = fit_arm(recording, **whose)
    quality_warnings = tuple(f"{source}: {doubt}" for doubt in (*recording.quality_warnings, *fit.quality_warnings))
    for segment in fit.repetitions() if segments == AUTO else segments:
        start, stop = segment or (first, last)
        frames = int(np.sum((fit.time >= start) & (fit.time <= stop)))
        if frames < FEWEST:
            raise InvalidInputError(
                f"{source} from {start:.2f} to {stop:.2f} s has {frames} frames in which the arm is seen; "
                f"a demonstration needs at least {FEWEST}"
            )
        name = source if segment is None else f"{source} {start:.4g}–{stop:.4g} s"
        yield Demonstration(name, recording, fit.crop(start, stop), quality_warnings)


def _common_arm(person: str, shown: Sequence[Demonstration]) -> Arm:
    """An arm of the side that most demonstrations show, with the mean of the lengths that are known."""
    sides = Counter(one.fit.arm.side for one in shown)
    known: dict[str, list[float]] = {}
    for one in shown:
        for segment, length in one.fit.segment_lengths.items():
            known.setdefault(segment, []).append(length)
    means = {segment: float(np.mean(each)) for segment, each in known.items()}
    return human_arm(person, max(SIDES, key=sides.__getitem__), lengths=means)


def _count(time: Array, rate: float = 30.0, most: int = 1500) -> int:
    """Return the number of ellipsoids of a demonstration that are compared; arms move below 10 Hz."""
    return int(np.clip(np.ceil(np.ptp(time) * rate) + 1, FEWEST, most))


def _fitted(count: int | None, alignment: Alignment, seed: int, progress: Progress | None) -> ProfileGMM:
    """Fit a mixture of so many Gaussians, by default of the number with the least BIC."""
    step, data = Step(progress, "Learn profile"), alignment.stacked()
    room = len(data[1]) // points_each(data[1].shape[-1])
    tried = [one for one in (1, 2, 4, 8, 16, 32) if one <= max(room, 1)] if count is None else [count]
    best: ProfileGMM | None = None
    for one in counted(tried, len(tried), step):
        model = ProfileGMM(one, random_state=seed).fit(*data)
        if best is not None and model.bic_curve_[0] >= best.bic_curve_[0]:
            break
        best = model
    assert best is not None
    step.end(f"{best.n_components_} Gaussians")
    return best


def _smoothed(alignment: Alignment, paths: Array, time: Array, cutoff: float = 8.0) -> Array:
    """Return the mean of the hands (k, m, 3) at times (n,), as a spline with half the amplitude at the cutoff [Hz].

    An alignment goes in steps, a hand does not.
    """
    step = float(np.median(np.diff(alignment.time)))
    strength = 1.0 / (step * (2.0 * np.pi * cutoff) ** 4)
    mean = paths.mean(axis=0)
    return np.stack([make_smoothing_spline(alignment.time, one, lam=strength)(time) for one in mean.T], axis=-1)
