"""Warnings that the model of the arm and the person differ, with the remedies that lower the residual.

Each remedy is tried on single frames of the recording before it is advised: another model, the other arm, and exchanged
or omitted markers of an axis.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maniport.arms import PERSONS
from maniport.arms.chain import LEFT, RIGHT
from maniport.arms.human import human_arm
from maniport.errors import InvalidInputError, RecordingError, argument
from maniport.mocap.arm_fit import ArmFit
from maniport.mocap.arm_path import local_solutions, sample_directions
from maniport.mocap.data_quality import model_differences
from maniport.mocap.directions import (
    Observation,
    observe,
    require_human,
    segment_lengths,
)
from maniport.mocap.recording import Recording
from maniport.mocap.roles import Markers
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

TRIED_FRAMES = 100  # Evenly spaced frames on which remedies are tried, 0.1 s for each remedy
CLEAR_GAIN = 0.7  # A remedy lowers the residual to less than this share of it: wrong ones reach 0.9


@dataclass(frozen=True)
class Fitting:
    """Input of a fit, with which it can be repeated in another way."""

    recording: Recording
    markers: Mapping[str, Markers]  # by side
    person: str
    smooth: bool
    observations: tuple[Observation, ...]  # one for each arm


class Residual(NamedTuple):
    """Residual of one direction over some frames."""

    squares: float  # sum of the weighted squares [rad²]
    weights: float  # sum of the squares of the weights


Residuals = dict[str, Residual]  # by the names of `Directions`


@dataclass(frozen=True)
class Trial:
    """A remedy, and the residuals without and with it [degrees]."""

    advice: str
    before: float
    after: float

    @property
    def helps(self) -> bool:
        """Whether the remedy lowers the residual."""
        return self.after < CLEAR_GAIN * self.before

    def __str__(self) -> str:
        return (
            f"{self.advice}, which lowers the residual from {self.before:.1f}° to {self.after:.1f}°"
        )


def model_warnings(fit: ArmFit, fitting: Fitting, arm: int) -> list[str]:
    """Report differences of the model and the person with remedies, for one of the arms of a fitting."""
    differences = model_differences(fit)
    if not differences.texts:
        return []
    before = [_residuals(observation, fitting.person) for observation in fitting.observations]
    observation = fitting.observations[arm]
    exchanges = []
    for axis, text in differences.turned.items():
        trial = _exchange(observation, fitting.person, axis, before[arm])
        if trial.helps:
            exchanges.append(f"{text}: {trial}")
    if exchanges:
        return exchanges

    trials = []
    for axis in differences.turned:
        trials.append(_omission(observation, fitting.person, axis, before[arm]))
    trials += _other_models(fitting, before)
    trials += _other_arm(fitting, before[arm])
    helpful = sorted((trial for trial in trials if trial.helps), key=lambda trial: trial.after)
    if helpful:
        advice = "Advice: " + "; or ".join(map(str, helpful))
    else:
        tried = ", ".join(trial.advice for trial in trials)
        advice = f"Tried without a clearly lower residual: {tried}"
        if differences.doubtful:
            advice += (
                ". Advice: check the roles of the points (maniport info) and assign others with "
                f"{argument('markers')}"
            )
    text = "; ".join(differences.texts)
    return [f"the model of the arm and the person differ: {text}. {advice}"]


def _exchange(observation: Observation, person: str, axis: str, before: Residuals) -> Trial:
    """Try the markers of an axis in the opposite order."""
    first, second = observation.roles[axis]
    exchanged = replace(observation, roles={**observation.roles, axis: (second, first)})
    advice = (
        f"{'+'.join(first)} and {'+'.join(second)} may be exchanged; give "
        f"{argument('markers', {axis: [list(second), list(first)]})}"
    )
    return _trial(advice, [before], [_residuals(exchanged, person)])


def _omission(observation: Observation, person: str, axis: str, before: Residuals) -> Trial:
    """Try without the markers of an axis."""
    roles = {role: points for role, points in observation.roles.items() if role != axis}
    advice = f"omit the markers of the axis ({argument('markers', {axis: None})})"
    return _trial(advice, [before], [_residuals(replace(observation, roles=roles), person)])


def _other_models(fitting: Fitting, before: list[Residuals]) -> list[Trial]:
    """Try the other models, for all arms at once."""
    trials = []
    for person in PERSONS:
        if person == fitting.person:
            continue
        advice = f"try another model ({argument('person', person)})"
        try:
            after = [_residuals(observation, person) for observation in fitting.observations]
        except (InvalidInputError, RecordingError):
            continue  # a model of a user's own that does not fit these segments
        trials.append(_trial(advice, before, after))
    return trials


def _other_arm(fitting: Fitting, before: Residuals) -> list[Trial]:
    """Try the other arm, where it is recorded and only one is fitted."""
    if len(fitting.observations) > 1:
        return []
    side = fitting.observations[0].side
    if side == LEFT:
        other = RIGHT
    else:
        other = LEFT
    markers = fitting.markers.get(side, next(iter(fitting.markers.values())))
    try:
        observation = observe(fitting.recording, markers, other, fitting.smooth)
        after = _residuals(observation, fitting.person)
    except RecordingError:
        return []
    return [_trial(f"try the other arm ({argument('side', other)})", [before], [after])]


def _trial(advice: str, before: list[Residuals], after: list[Residuals]) -> Trial:
    """Compare the residuals of arms, over the directions that both have."""
    squares = np.zeros(2)
    for residuals, changed in zip(before, after, strict=True):
        names = residuals.keys() & changed.keys()
        squares += [_mean_square(residuals, names), _mean_square(changed, names)]
    root = np.degrees(np.sqrt(squares / len(before)))
    return Trial(advice, float(root[0]), float(root[1]))


def _mean_square(residuals: Residuals, names: Collection[str]) -> float:
    """Return the weighted mean square of the residuals of some directions [rad²]."""
    squares = sum(residuals[name].squares for name in names)
    return squares / sum(residuals[name].weights for name in names)


def _residuals(observation: Observation, person: str) -> Residuals:
    """Return the residuals of a model, each of some frames fitted on its own."""
    lengths = segment_lengths(observation.used, observation.roles)
    arm = human_arm(person, observation.side, lengths=lengths)
    require_human(arm)
    rows = evenly_spaced(len(observation.frames), TRIED_FRAMES)
    directions = replace(observation, frames=observation.frames[rows]).directions(arm)
    samples, modeled = sample_directions(directions)
    candidates, cost = local_solutions(directions, samples, modeled)
    best: Array = candidates[np.arange(len(cost)), np.argmin(cost, axis=1)]
    values, _ = directions.residual(best)

    observed = ~np.isnan(directions.targets[..., 0])
    squares = np.sum(values.reshape(*observed.shape, 3) ** 2, axis=-1)
    residuals = {}
    for i, name in enumerate(directions.names):
        if observed[:, i].any():
            weights = directions.weights[i] ** 2 * observed[:, i].sum()
            residuals[name] = Residual(float(squares[:, i].sum()), float(weights))
    return residuals
