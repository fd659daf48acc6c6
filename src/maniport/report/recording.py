"""Reports of recordings, of the human arm fitted to one, and of what is learned from several."""

import json
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from maniport.arms.chain import RIGHT, SIDES
from maniport.arms.human import FRACTIONS
from maniport.errors import RecordingError, argument, nearest_first
from maniport.mocap import ArmFit, HumanMotion, Recording
from maniport.mocap.roles import (
    DIRECTIONS,
    ROLES,
    assign_roles,
    assigned_roles,
    example_markers,
    find_side,
    missing_roles,
    role_position,
    usual_names,
)
from maniport.pipeline.demonstrations import LearnedProfile
from maniport.report.renderings import escaped
from maniport.report.values import (
    FIT,
    RECORDING,
    Metric,
    Report,
    Section,
    Table,
    describe,
    in_axes,
    info,
    listed,
    notes,
    numbers,
    software,
    statistics,
    table_of,
    warning,
    warnings_of,
)  # fmt: skip
from maniport.util.defaults import AUTO


@describe.register
def recording_report(
    recording: Recording, markers: Mapping[str, Any] | None = None, side: str = AUTO, command: str = ""
) -> Report:
    """Describe a recording and the roles of its points."""
    markers_of = {name: markers if name == (RIGHT if side == AUTO else side) else None for name in SIDES}
    roles = {name: assigned_roles(recording, markers_of[name], name) for name in SIDES}
    complete = [name for name in SIDES if not missing_roles(roles[name][1])]
    fitted, metrics = "", list[Metric]()
    try:
        fitted, reason, _ = find_side(recording, markers, side)
        metrics.append(info("Fitted arm", "fitted", fitted, f"the {fitted} arm: {reason}"))
    except RecordingError:
        pass  # no arm can be fitted
    best = max(
        SIDES, key=lambda name: (name == fitted, name in complete, len(roles[name][1].keys() & {"elbow", "wrist"}))
    )
    assigned = {name: points for name, (_, points) in roles.items()}
    family = roles[best][0]
    if any(assigned.values()):
        metrics.insert(0, info("Names", "names", family, f"as in {family}"))
    for name in SIDES:
        metrics += _arm(recording, assigned[name], markers_of[name], name)
    if not complete:
        metrics.append(warning("arm-incomplete", "No arm is complete, so that none can be fitted"))

    def names(role: str, points: Any) -> str:
        if points is None:
            return "–"
        return " to ".join(" + ".join(group) for group in points) if role in DIRECTIONS else " + ".join(points)

    rows = tuple((role, *(names(role, assigned[name].get(role)) for name in SIDES)) for role in ROLES)
    table = Table(("role", *(f"{name} arm" for name in SIDES)), rows)
    sections = (
        recording_section(recording, points=True),
        Section("Roles of the points", tuple(metrics), (table,), "arms"),
        _completion(recording, *roles[best], best, command or shlex.quote(recording.source or "FILE")),
    )
    return Report(recording.source or "A recording", sections=sections)


def recording_section(recording: Recording, points: bool = False) -> Section:
    """Describe a recording, with the names of its points where they are requested."""
    gaps = {name: float(part) for name, part in zip(recording.names, recording.missing, strict=True) if part}
    rate = recording.rate if len(recording) > 1 else None
    frames = f"{len(recording)}, {recording.duration:.2f} s at {rate:.4g} Hz" if rate else "1"
    names = list(recording.names)
    missing = listed(f"{name} {100 * part:.1f} %" for name, part in gaps.items()) if points else ""
    metrics = [
        info("File", "source", Path(recording.source).name),
        info("Format", "format", recording.format, recording.format.removeprefix(".").upper()),
        info("Frames", "frames", len(recording), frames),
        *numbers(duration_s=round(recording.duration, 3), rate_hz=rate and round(rate, 3)),
        *([info("Points", "points", names, f"{len(names)}: {listed(names)}")] if points else []),
        info("Missing", "missing", gaps, missing, "Share of the frames."),
        *warnings_of(RECORDING, recording.quality_warnings),
    ]
    return Section("Recording", (*metrics, *notes(recording.notes)), key="recording")


def _arm(recording: Recording, roles: Mapping[str, Any], markers: Mapping[str, Any] | None, side: str) -> list[Metric]:
    """Describe one arm: its missing roles, its lengths, and contradictions."""
    missing, lengths, warned = missing_roles(roles), dict[str, float](), []
    for name, (start, end) in {"upper arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist")}.items():
        if start in roles and end in roles:
            step = role_position(recording, roles[end]) - role_position(recording, roles[start])
            if np.isfinite(length := np.linalg.norm(step, axis=-1)).any():
                lengths[name] = round(float(np.nanmedian(length)), 4)
    texts = [f"lacks {listed(missing)}" if missing else "complete"]
    texts += [f"{name} {length:.3f} m" for name, length in lengths.items()]
    value = {"complete": not missing, "lacks": missing, "lengths_m": lengths, "markers": roles}
    if not missing:
        try:
            assign_roles(recording, markers, side)
        except RecordingError as error:
            warned.append(warning("markers", str(error)))
    for name, length in lengths.items():
        low, high = 0.85 * 1.4 * FRACTIONS[name], 1.15 * 2.1 * FRACTIONS[name]  # of 1.4 to 2.1 m, ± 15 % [m]
        if not low <= length <= high:
            text = f"the {name} is {length:.3f} m long, those of adults are {low:.2f} to {high:.2f} m"
            warned.append(warning("segment-lengths", f"the {side} arm: {text}"))
    return [info(f"{side.title()} arm", side, value, listed(texts)), *warned]


def _completion(recording: Recording, family: str, roles: Mapping[str, Any], side: str, command: str) -> Section:
    """Explain how to assign missing roles."""
    if not (required := missing_roles(roles)):
        return Section("")
    lines = [f"The {side} arm lacks {listed(required)}."]
    for role in required:
        usual = usual_names(role, family, side)
        near = nearest_first(usual.replace("'", ""), recording.observed)[:3]
        lines.append(f"- {role}: usually {usual}; nearest here: {escaped(listed(near)) or 'none'}")
    template = example_markers(required)
    lines += [
        "Replace the capitalized words with point names and save as markers.json:",
        f"`{json.dumps(template)}`",
        f"Then run `maniport transfer {command} --markers markers.json"
        f"{' --side left' if side == 'left' else ''} -o results`",
    ]
    return Section("Missing roles", tuple(numbers(markers=template)), key="to_complete", text="\n".join(lines))


@describe.register
def fit_report(fit: ArmFit | HumanMotion) -> Report:
    """Describe the fit of one or both human arms."""
    if isinstance(fit, ArmFit):
        return Report(f"{fit.arm.name}, fitted to a person", "", (person_section(fit),))
    both = []
    if len(fit.arms) > 1:
        apart = np.linalg.norm(fit.hands[1] - fit.hands[0], axis=-1)
        distance = statistics("Distance between the hands", "between_hands", apart, fit.time, "m")
        both.append(Section("Both arms", (distance,)))
    arms = [replace(person_section(own), title=f"Human {own.arm.side} arm", key=str(own.arm.side)) for own in fit.arms]
    title = f"{' and '.join(own.arm.name for own in fit.arms)}, fitted to a person"
    return Report(title, sections=(*both, *arms))


def person_section(fit: ArmFit) -> Section:
    """Describe the fit of a human arm and what the recording does not determine."""
    lengths = {name: round(float(length), 4) for name, length in fit.segment_lengths.items()}
    at_limit = {name: float(part) for name, part in zip(fit.joint_names, fit.at_limit, strict=True) if part > 0}
    by_reason: dict[str, list[str]] = {}
    for name, reason in fit.unobservable.items():
        by_reason.setdefault(reason, []).append(name)
    texts = [f"The recording does not determine {listed(names)}: {why}" for why, names in by_reason.items()]
    frames = f"{fit.arm.name}, {len(fit)} frames, {fit.time[0]:.2f} to {fit.time[-1]:.2f} s"
    metrics = (
        *warnings_of(FIT, fit.quality_warnings),
        *warnings_of("undetermined-joints", texts),
        info("Model", "model", fit.arm.name, frames),
        info("Arm", "side", fit.arm.side, f"{fit.arm.side}: {fit.side_reason}"),
        *numbers(frames=len(fit), joints_not_determined=fit.unobservable),
        info("Segments", "segment_lengths", lengths,
             listed(f"{name} {length:.3f} m" for name, length in lengths.items()),
             "The model is scaled to these lengths.", "m"),
        info("Saturated joints", "fraction_at_limit", at_limit,
             listed(f"{name} {100 * part:.0f} %" for name, part in at_limit.items()),
             "Share of the frames; the true angle may exceed the limit."),
        *notes(fit.notes),
    )  # fmt: skip
    residuals = fit.residual_summary()
    columns = {"direction of": "{name}", "median": "{median:.2f}°", "95 %": "{p95:.2f}°", "max": "{max:.2f}°",
               "when": "at {max_at_s:.1f} s"}  # fmt: skip
    caption = "Angle between measured and modelled direction of each segment, and about its own axis where it is known."
    table = table_of([{"name": name, **item} for name, item in residuals.items()], columns, caption, "residual_deg")
    return Section("Human arm", metrics, (replace(table, value=residuals),), "person")


AGREEMENT = {"agree": 0.2, "agree in part": 0.5, "do not agree": np.inf}
"""Largest shares of the variance between demonstrations by words."""


@describe.register
def learned_report(learned: LearnedProfile) -> Report:
    """Report a learned profile, agreement of the demonstrations first."""
    agreement, names, k = learned.agreement, learned.names, len(learned.demonstrations)
    outlier, held = "" if agreement.outlier is None else names[agreement.outlier], agreement.held_out
    grade = next(words for words, bound in AGREEMENT.items() if agreement.share <= bound)
    texts = ["the demonstrations differ: their mean is a motion that nobody performed"] if grade != "agree" else []
    texts += [f"{outlier} differs from the other demonstrations"] if outlier else []
    warned = (
        *warnings_of(RECORDING, [text for part in learned.demonstrations for text in part.quality_warnings]),
        *warnings_of("demonstrations-differ", texts),
    )
    lead = (
        f"{k} demonstrations, aligned to the {np.ptp(learned.time):.1f} s of {learned.reference.name}. Each of "
        f"{len(learned.time)} times has a mean ellipsoid, its covariance, and a position of the hand."
    )
    before, after = agreement.before, agreement.after
    cause = f"The mean distance to the mean ellipsoid of the same time is {after:.2f} ({in_axes(after)})."
    held_out = {} if held is None else {"learned": held.learned, "plain_mean": held.mean, "nearest_other": held.nearest,
                                        "one_for_all_times": held.constant}  # fmt: skip
    means = {name: float(np.mean(distances)) for name, distances in held_out.items()}
    advice = ""
    if outlier:
        cause += f" {outlier} is an outlier."
        advice = f"Leave out {outlier}, or give it a profile of its own."
    elif means and means["learned"] > means["plain_mean"]:
        advice = f"More Gaussians may predict better: {argument('components', 2 * learned.model.n_components_)}."
    text = listed(f"{value:.2f} to {name.replace('_', ' ')}" for name, value in means.items())
    profile = [
        info("Dispersion", "dispersion", {"before": before, "after": after},
             f"{after:.2f} after alignment, {before:.2f} before",
             "Mean distance to the mean ellipsoid of the same time; 0.1 is one axis 5 % too long.", main=True),
        info("Variance between demonstrations", "variance_share", agreement.share, f"{100 * agreement.share:.0f} %",
             "Share of all variance.", main=True),
        *([info("Leave-one-out distance", "held_out", means, text, "Mean over the demonstrations.", main=True)]
          if means else []),
        info("Gaussians", "gaussians", learned.model.n_components_),
        *numbers(ellipsoids=len(learned.time), duration_s=round(float(np.ptp(learned.time)), 3)),
    ]  # fmt: skip
    spec, damping, arms = learned.spec, learned.regularization.epsilon, learned.arms
    settings = (
        info("Ellipsoids", "ellipsoids", {"kind": spec.kind, "part": spec.part}, f"{spec.kind}, {spec.part}",
             "Trunk frame (x forward, y left, z up)."),
        info("Damping", "damping", damping, f"{damping:.3g}" if damping else str(learned.regularization),
             "Added to all eigenvalues before ellipsoids are compared."),
        info("Arm", "arm", listed(arm.name for arm in arms), listed(f"{arm.name}, {arm.side}" for arm in arms)),
        *software(learned.random_state),
    )  # fmt: skip
    sections = (
        Section("Learned profile", (*warned, *profile), key="profile"),
        _demonstrations(learned, outlier),
        Section("Settings", settings, key="run", folded=True),
    )
    outcome = f"The demonstrations {grade}."
    return Report(f"A profile of {k} demonstrations", lead, sections, outcome, cause, advice)


def _demonstrations(learned: LearnedProfile, outlier: str) -> Section:
    """List the demonstrations, and report what made them comparable: mirroring and segment lengths."""
    agreement, held = learned.agreement, learned.agreement.held_out
    sides = tuple(str(arm.side) for arm in learned.arms)
    values = [
        {"name": part.name, "start_s": float(part.motion.time[0]), "stop_s": float(part.motion.time[-1]),
         "frames": len(part.motion), "side": listed(part.motion.names), "from_others": float(agreement.alone[i]),
         "held_out": None if held is None else float(held.learned[i]),
         "segment_lengths_m": {fit.arm.side: fit.segment_lengths for fit in part.motion.arms}}
        for i, part in enumerate(learned.demonstrations)
    ]  # fmt: skip
    columns = {"demonstration": "{name}", "start": "{start_s:.2f} s", "stop": "{stop_s:.2f} s", "frames": "{frames}",
               "arm": "{side}", "from the others": "{from_others:.2f}"}  # fmt: skip
    if held is not None:
        columns["held out"] = "{held_out:.2f}"
    caption = "Mean distances after alignment: from the others, and from the profile learned without it."
    mirrored = [part.name for part in learned.demonstrations if part.motion.names != sides]
    metrics = (
        info("Reference", "reference", learned.alignment.reference, learned.reference.name,
             "Gives the times of the profile."),
        info("Outlier", "outlier", agreement.outlier, outlier or "none",
             "At least 1.5 times the median distance from the others."),
        *notes([f"mirrored to the {sides[0]} arm: {listed(mirrored)}"] if mirrored else []),
        *notes([f"all ellipsoids are those of {' and '.join(sides)} arm of mean lengths"]),
    )  # fmt: skip
    return Section("Demonstrations", metrics, (table_of(values, columns, caption, "demonstrations"),), "demonstrations")
