"""Reports of recordings, of the human arm fitted to one, and of what is learned from several."""

import contextlib
import json
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from maniport.arms.chain import RIGHT, SIDES
from maniport.arms.human import FRACTIONS
from maniport.errors import RecordingError, argument
from maniport.mocap import ArmFit, HumanMotion, Recording
from maniport.mocap.body_sides import body_sides
from maniport.mocap.roles import (
    DIRECTIONS,
    ROLES,
    Roles,
    assign_roles,
    assigned_roles,
    example_markers,
    find_side,
    likely_points,
    missing_roles,
    role_position,
    usual_names,
)
from maniport.pipeline.demonstrations import LearnedProfile
from maniport.report.render import escaped
from maniport.report.values import (
    FIT,
    RECORDING,
    TIME_COLUMN,
    Report,
    Section,
    Table,
    in_axes,
    listed,
    software,
)
from maniport.util.defaults import AUTO


def recording_report(
    recording: Recording,
    markers: Mapping[str, Any] | None = None,
    side: str = AUTO,
    command: str = "",
) -> Report:
    """Describe a recording and the roles of its points."""
    markers_of = {
        name: markers if name == (RIGHT if side == AUTO else side) else None for name in SIDES
    }
    sets = {name: assigned_roles(recording, markers_of[name], name) for name in SIDES}
    roles = {name: own for name, (_, own) in sets.items()}
    best, reason = max(SIDES, key=lambda name: len(roles[name].keys() & {"elbow", "wrist"})), ""
    with contextlib.suppress(RecordingError):  # no arm can be fitted
        best, reason, _ = find_side(recording, markers, side)
    section = Section("Roles of the points", key="arms")
    if any(roles.values()):
        section.add("Names", "names", sets[best][0], f"as in {sets[best][0]}")
    if reason:
        section.add("Fitted arm", "fitted", best, f"the {best} arm: {reason}")
    exchanged = body_sides(recording, roles[best], best).warnings()
    section.warn("sides", *exchanged)
    for name in SIDES:
        if not exchanged and not missing_roles(roles[name]):
            try:
                assign_roles(recording, markers_of[name], name)
            except RecordingError as error:
                section.warn("markers", str(error))
        _add_arm(section, recording, roles[name], name)
    missing = missing_roles(roles[best])
    if missing:
        section.warn("arm-incomplete", "No arm is complete, so that none can be fitted")

    def names(role: str, points: Any) -> str:
        groups = (
            [" + ".join(group) for group in points] if role in DIRECTIONS else [" + ".join(points)]
        )
        return " to ".join(groups) or "–"

    rows = tuple(
        (role, *(names(role, roles[name].get(role, ())) for name in SIDES)) for role in ROLES
    )
    section.tables = (Table(("role", *(f"{name} arm" for name in SIDES)), rows),)
    sections = [recording_section(recording, points=True), section]
    if missing:
        sections.append(_completion(recording, roles[best], sets[best][0], best, command))
    return Report(recording.source or "A recording", sections=tuple(sections))


def recording_section(recording: Recording, points: bool = False) -> Section:
    """Describe a recording, with the names of its points where they are requested."""
    section, names = Section("Recording", key="recording", folded=not points), list(recording.names)
    gaps = {name: float(part) for name, part in zip(names, recording.missing, strict=True) if part}
    rate = recording.rate if len(recording) > 1 else None
    section.add("File", "source", Path(recording.source).name)
    section.add("Format", "format", recording.format, recording.format.removeprefix(".").upper())
    frames = f"{len(recording)}, {recording.duration:.2f} s at {rate:.4g} Hz" if rate else "1"
    section.add("Frames", "frames", len(recording), frames)
    section.numbers(duration_s=round(recording.duration, 3), rate_hz=rate and round(rate, 3))
    if points:
        section.add("Points", "points", names, f"{len(names)}: {listed(names)}")
    section.add(
        "Missing", "missing", gaps, _percentages(gaps, 1) if points else "", "Share of the frames."
    )
    section.warn(RECORDING, *recording.quality_warnings)
    section.note(*recording.notes)
    return section


def _percentages(shares: Mapping[str, float], digits: int = 0) -> str:
    return listed(f"{name} {100 * share:.{digits}f} %" for name, share in shares.items())


def _add_arm(section: Section, recording: Recording, roles: Mapping[str, Any], side: str) -> None:
    """Describe one arm: its missing roles and its lengths."""
    missing, lengths = missing_roles(roles), dict[str, float]()
    for name, (start, end) in {
        "upper arm": ("shoulder", "elbow"),
        "forearm": ("elbow", "wrist"),
    }.items():
        if start in roles and end in roles:
            step = role_position(recording, roles[end]) - role_position(recording, roles[start])
            if np.isfinite(length := np.linalg.norm(step, axis=-1)).any():
                lengths[name] = round(float(np.nanmedian(length)), 4)
    texts = [f"lacks {listed(missing)}" if missing else "complete"]
    texts += [f"{name} {length:.3f} m" for name, length in lengths.items()]
    value = {"complete": not missing, "lacks": missing, "lengths_m": lengths, "markers": roles}
    section.add(f"{side.title()} arm", side, value, listed(texts))
    for name, length in lengths.items():
        low, high = (
            0.85 * 1.4 * FRACTIONS[name],
            1.15 * 2.1 * FRACTIONS[name],
        )  # of 1.4 to 2.1 m, ± 15 % [m]
        if not low <= length <= high:
            text = (
                f"the {name} is {length:.3f} m long, those of adults are {low:.2f} to {high:.2f} m"
            )
            section.warn("segment-lengths", f"the {side} arm: {text}")


def _completion(
    recording: Recording,
    roles: Roles,
    family: str,
    side: str,
    command: str,
) -> Section:
    """Explain how to assign missing roles."""
    missing = missing_roles(roles)
    lines = [f"The {side} arm lacks {listed(missing)}."]
    for role in missing:
        usual = usual_names(role, family, side)
        near = likely_points(recording, role, roles, family, side)
        lines.append(f"- {role}: usually {usual}; here perhaps {escaped(listed(near)) or 'none'}")
    template, file = example_markers(missing), command or shlex.quote(recording.source or "FILE")
    option = " --side left" if side == "left" else ""
    lines += [
        "Replace the capitalized words with point names and save as markers.json:",
        f"`{json.dumps(template)}`",
        f"Then run `maniport transfer {file} --markers markers.json{option} -o results`",
    ]
    section = Section("Missing roles", key="to_complete", text="\n".join(lines))
    section.numbers(markers=template)
    return section


def fit_report(fit: HumanMotion) -> Report:
    """Describe the fits of the arms of a person."""
    arms = (
        replace(person_section(own), title=f"Human {own.arm.side} arm", key=str(own.arm.side))
        for own in fit.arms
    )
    return Report(
        f"{' and '.join(own.arm.name for own in fit.arms)}, fitted to a person",
        sections=tuple(arms),
    )


def person_section(fit: ArmFit) -> Section:
    """Describe the fit of a human arm and what the recording does not determine."""
    residuals = fit.residual_summary()
    columns = {"direction of [°]": "{name}", "median": "{median:.2f}", "95th percentile": "{p95:.2f}",
               "max": "{max:.2f}", TIME_COLUMN: "{max_at_s:.1f}"}  # fmt: skip
    caption = "Angle between measured and modelled direction of each segment, and about its own axis where it is known."
    table = Table.of(
        [{"name": name, **item} for name, item in residuals.items()],
        columns,
        caption,
        "residual_deg",
    )
    section = Section("Human arm", (), (replace(table, value=residuals),), "person", folded=True)
    by_reason: dict[str, list[str]] = {}
    for name, reason in fit.unobservable.items():
        by_reason.setdefault(reason, []).append(name)
    for text in fit.quality_warnings:
        section.warn(FIT if text in fit.model_warnings else RECORDING, text)
    for reason, names in by_reason.items():
        section.warn(
            "undetermined-joints", f"The recording does not determine {listed(names)}: {reason}"
        )
    frames = f"{fit.arm.name}, {len(fit)} frames, {fit.time[0]:.2f} to {fit.time[-1]:.2f} s"
    section.add("Model", "model", fit.arm.name, frames)
    section.add("Arm", "side", fit.arm.side, f"{fit.arm.side}: {fit.side_reason}")
    section.numbers(frames=len(fit), joints_not_determined=fit.unobservable)
    lengths = {name: round(float(length), 4) for name, length in fit.segment_lengths.items()}
    text = listed(f"{name} {length:.3f} m" for name, length in lengths.items())
    section.add(
        "Segments",
        "segment_lengths",
        lengths,
        text,
        "The model is scaled to these lengths.",
        unit="m",
    )
    at_limit = {
        name: float(part)
        for name, part in zip(fit.arm.joint_names, fit.at_limit, strict=True)
        if part > 0
    }
    about = "Share of the frames; the true angle may exceed the limit."
    section.add("Saturated joints", "fraction_at_limit", at_limit, _percentages(at_limit), about)
    section.note(*fit.notes)
    return section


AGREEMENT = {"agree": 0.2, "agree in part": 0.5, "do not agree": np.inf}
"""Largest shares of the variance between demonstrations by words."""


def learned_report(learned: LearnedProfile) -> Report:
    """Report a learned profile, agreement of the demonstrations first."""
    agreement, parts, seconds = (
        learned.agreement,
        learned.demonstrations,
        float(np.ptp(learned.time)),
    )
    before, after, held = agreement.before, agreement.after, agreement.held_out
    outlier = "" if agreement.outlier is None else learned.names[agreement.outlier]
    grade = next(words for words, bound in AGREEMENT.items() if agreement.share <= bound)
    section, means = Section("Learned profile", key="profile"), dict[str, float]()
    section.warn(RECORDING, *(text for part in parts for text in part.quality_warnings))
    texts = ["the demonstrations differ: their mean is a motion that nobody performed"] * (
        grade != "agree"
    )
    section.warn(
        "demonstrations-differ",
        *texts,
        *[f"{outlier} differs from the other demonstrations"] * bool(outlier),
    )
    about = "Mean distance to the mean ellipsoid of the same time; 0.1 is one axis 5 % too long."
    text = f"{after:.2f} after alignment, {before:.2f} before"
    section.add(
        "Dispersion", "dispersion", {"before": before, "after": after}, text, about, main=True
    )
    about, text = "Share of all variance.", f"{100 * agreement.share:.0f} %"
    section.add(
        "Variance between demonstrations", "variance_share", agreement.share, text, about, main=True
    )
    if held:
        means = {name: float(np.mean(distances)) for name, distances in held.items()}
        text = listed(f"{value:.2f} to {name.replace('_', ' ')}" for name, value in means.items())
        section.add(
            "Leave-one-out distance",
            "held_out",
            means,
            text,
            "Mean over the demonstrations.",
            main=True,
        )
    section.add("Gaussians", "gaussians", learned.model.n_components_)
    spec = learned.config.spec
    kind, about = {"kind": spec.kind, "part": spec.part}, "Trunk frame (x forward, y left, z up)."
    section.add(
        "Ellipsoids", "ellipsoids", kind, f"{len(learned.time)}, {spec.kind}, {spec.part}", about
    )
    section.numbers(
        duration_s=round(seconds, 3),
        reference=learned.alignment.reference,
        outlier=agreement.outlier,
    )
    names = tuple(str(arm.side) for arm in learned.arms)
    mirrored = listed(part.name for part in parts if part.motion.names != names)
    section.note(*[f"mirrored to the {names[0]} arm: {mirrored}"] * bool(mirrored))
    section.note(f"all ellipsoids are those of arms of mean lengths: {' and '.join(names)}")
    section.metrics += tuple(software(learned.config.seed))
    values = [
        {"name": part.name, "start_s": float(part.motion.time[0]), "stop_s": float(part.motion.time[-1]),
         "frames": len(part.motion), "side": listed(part.motion.names), "from_others": float(agreement.alone[i]),
         "held_out": float(held["learned"][i]) if held else np.nan,
         "segment_lengths_m": {fit.arm.side: fit.segment_lengths for fit in part.motion.arms}}
        for i, part in enumerate(parts)
    ]  # fmt: skip
    columns = {
        "demonstration": "{name}",
        "frames": "{frames}",
        "arm": "{side}",
        "from the others": "{from_others:.2f}",
    }
    columns |= {"held out": "{held_out:.2f}"} if held else {}
    caption = (
        "Mean distances after alignment: from the others, and from the profile learned without it."
    )
    section.tables = (Table.of(values, columns, caption, "demonstrations"),)
    lead = (
        f"{len(parts)} demonstrations, aligned to the {seconds:.1f} s of {learned.reference.name}. Each of "
        f"{len(learned.time)} times has a mean ellipsoid, its covariance, and a position of the hand."
    )
    cause, advice = (
        f"The mean distance to the mean ellipsoid of the same time is {after:.2f} ({in_axes(after)}).",
        "",
    )
    if outlier:
        cause, advice = (
            f"{cause} {outlier} is an outlier.",
            f"Leave out {outlier}, or give it a profile of its own.",
        )
    elif means and means["learned"] > means["plain_mean"]:
        advice = f"More Gaussians may predict better: {argument('components', 2 * learned.model.n_components_)}."
    outcome = f"The demonstrations {grade}."
    return Report(
        f"A profile of {len(parts)} demonstrations", lead, (section,), outcome, cause, advice
    )
