"""Metrics of a recording and of the human arm fitted to it."""

import json
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from maniport.arms import myoarm
from maniport.arms.chain import RIGHT, SIDES
from maniport.arms.human import adult_range
from maniport.errors import RecordingError, nearest_first
from maniport.mocap import ArmFit, HumanMotion, Recording
from maniport.mocap.data_quality import unobservable_joints
from maniport.mocap.marker_sets import DIRECTIONS, ROLES
from maniport.mocap.roles import (
    assign_roles,
    assigned_roles,
    example_markers,
    find_side,
    missing_roles,
    role_position,
    usual_names,
)
from maniport.report.metrics import describe
from maniport.report.renderings import escaped
from maniport.report.values import (
    Metric,
    Report,
    Section,
    Table,
    at_time,
    listed,
    notes,
    numbers,
    statistics,
    table_of,
    warning,
    warnings_of,
)
from maniport.util.defaults import AUTO

RECORDING, FIT = "recording", "human-model"
"""Keys of warnings about a recording, and about the difference between model and person."""


@describe.register
def recording_report(
    recording: Recording, markers: Mapping[str, Any] | None = None, side: str = AUTO, command: str = ""
) -> Report:
    """Describe a recording and the roles of its points."""
    meant = RIGHT if side == AUTO else side
    roles = {one: assigned_roles(recording, markers if one == meant else None, one) for one in SIDES}
    whole = [one for one in SIDES if not missing_roles(roles[one][1])]
    fitted = _fitted_side(recording, markers, side)
    taken = fitted[0].value if fitted else None
    best = max(SIDES, key=lambda one: (one == taken, one in whole, len(roles[one][1].keys() & {"elbow", "wrist"})))
    assigned = {one: found for one, (_, found) in roles.items()}
    family = roles[best][0]
    named = any(assigned.values())
    metrics = [Metric("Names", f"as in {family}" if named else "", key="names" if named else "", value=family), *fitted]
    for one in SIDES:
        metrics += _arm(recording, assigned[one], markers if one == meant else None, one)
    if not whole:
        metrics.append(warning("arm-incomplete", "No arm is complete, so that none can be fitted"))
    sections = (
        recording_section(recording, points=True),
        Section("Roles of the points", tuple(metrics), (_role_table(assigned),), "arms"),
        _completion(recording, *roles[best], best, command or shlex.quote(recording.source or "FILE")),
    )
    quality_warnings = warnings_of(RECORDING, recording.quality_warnings)
    return Report(recording.source or "A recording", sections=sections, data_warnings=quality_warnings)


def recording_section(recording: Recording, points: bool = False) -> Section:
    """Describe a recording, with the names of its points where they are requested."""
    gaps = {name: float(part) for name, part in zip(recording.names, recording.missing, strict=True) if part}
    rate = recording.rate if len(recording) > 1 else None
    frames = f"{len(recording)}, {recording.duration:.2f} s at {rate:.4g} Hz" if rate else "1"
    source, names = Path(recording.source).name, list(recording.names)
    missing = listed([f"{name} {100 * part:.1f} %" for name, part in gaps.items()])
    metrics = [
        Metric("File", source, key="source", value=source),
        Metric("Format", recording.format.removeprefix(".").upper(), key="format", value=recording.format),
        Metric("Frames", frames, key="frames", value=len(recording)),
        *numbers(duration_s=round(recording.duration, 3), rate_hz=rate and round(rate, 3)),
        Metric("Vertical axis", recording.up, key="up", value=recording.up),
        *([Metric("Points", f"{len(names)}: {listed(names)}", key="points", value=names)] if points else []),
        Metric("Missing", missing if points else "", "Share of the frames.", "missing", gaps),
    ]
    return Section("Recording", (*metrics, *notes(recording.notes)), key="recording")


def _fitted_side(recording: Recording, markers: Mapping[str, Any] | None, side: str) -> list[Metric]:
    """Return the arm that is fitted; nothing where none can be."""
    try:
        taken, reason, _ = find_side(recording, markers, side)
    except RecordingError:
        return []
    return [Metric("Fitted arm", f"the {taken} arm: {reason}", key="fitted", value=taken)]


def _arm(recording: Recording, roles: Mapping[str, Any], markers: Mapping[str, Any] | None, side: str) -> list[Metric]:
    """Describe one arm: its missing roles, its lengths, and contradictions."""
    missing, lengths = missing_roles(roles), {}
    for name, (start, end) in {"upper arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist")}.items():
        if start in roles and end in roles:
            step = role_position(recording, roles[end]) - role_position(recording, roles[start])
            length = np.linalg.norm(step, axis=-1)
            if np.isfinite(length).any():
                lengths[name] = round(float(np.nanmedian(length)), 4)
    texts = [f"lacks {listed(missing)}" if missing else "complete"]
    texts += [f"{name} {length:.3f} m" for name, length in lengths.items()]
    value = {"complete": not missing, "lacks": missing, "lengths_m": lengths, "markers": roles}
    metrics = [Metric(f"{side.title()} arm", listed(texts), key=side, value=value)]
    if not missing:
        try:
            assign_roles(recording, markers, side)
        except RecordingError as error:
            metrics.append(warning("markers", str(error)))
    for name, length in lengths.items():
        low, high = adult_range(name)
        if not low <= length <= high:
            text = f"the {name} is {length:.3f} m long, those of adults are {low:.2f} to {high:.2f} m"
            metrics.append(warning("segment-lengths", f"the {side} arm: {text}"))
    return metrics


def _role_table(assigned: Mapping[str, Any]) -> Table:
    """List the points of each role of the arms, and of the trunk, which both share."""

    def names(role: str, points: Any) -> str:
        if points is None:
            return "–"
        return " to ".join(" + ".join(group) for group in points) if role in DIRECTIONS else " + ".join(points)

    rows = tuple((role, *(names(role, assigned[side].get(role)) for side in SIDES)) for role in ROLES)
    return Table(("role", *(f"{side} arm" for side in SIDES)), rows)


def _completion(recording: Recording, family: str, roles: Mapping[str, Any], side: str, command: str) -> Section:
    """Explain how to assign missing roles."""
    required = missing_roles(roles)
    wanted = required or [role for role in ("hand", "elbow_axis", "wrist_axis") if role not in roles]
    if not wanted:
        return Section("")
    if required:
        title, lines = "Missing roles", [f"The {side} arm lacks {listed(required)}."]
        for role in required:
            usual = usual_names(role, family, side)
            near = nearest_first(usual.replace("'", ""), recording.observed)[:3]
            lines.append(f"- {role}: usually {usual}; nearest here: {escaped(listed(near)) or 'none'}")
    else:
        arm = myoarm()
        held = listed([arm.joint_names[joint] for joint in unobservable_joints(arm, roles)])
        undetermined = f", but {held} are undetermined and stay near neutral" if held else ""
        title = "Additional roles"
        lines = [f"The {side} arm can be fitted as it is{undetermined}.",
                 f"Points for {listed(wanted)} would add information, if the recording has them."]  # fmt: skip
    template = example_markers(wanted)
    lines += [
        "Write names of points instead of the words in capitals into a file markers.json:",
        f"`{json.dumps(template)}`",
        f"and give it: `maniport transfer {command} --markers markers.json"
        f"{' --side left' if side == 'left' else ''} -o results`",
    ]
    return Section(title, tuple(numbers(markers=template)), key="to_complete", text="\n".join(lines))


@describe.register
def fit_report(fit: ArmFit) -> Report:
    """Describe the fit of a human arm."""
    quality_warnings = warnings_of(FIT, fit.quality_warnings)
    return Report(
        f"{fit.arm.name}, fitted to a person", sections=(person_section(fit),), data_warnings=quality_warnings
    )


@describe.register
def fits_report(fits: HumanMotion) -> Report:
    """Describe the fit of both human arms."""
    apart = np.linalg.norm(fits.hands[1] - fits.hands[0], axis=-1)
    both = Section("Both arms", (statistics("Distance between the hands", "between_hands", apart, fits.time, "m"),))
    each = [replace(person_section(fit), title=f"Human {fit.arm.side} arm", key=str(fit.arm.side)) for fit in fits.arms]
    title = f"{' and '.join(fit.arm.name for fit in fits.arms)}, fitted to a person"
    return Report(title, sections=(both, *each), data_warnings=warnings_of(FIT, fits.quality_warnings))


def person_section(fit: ArmFit) -> Section:
    """Describe the fit of a human arm and what the recording does not determine."""
    lengths = {name: round(float(length), 4) for name, length in fit.segment_lengths.items()}
    step, step_at = fit.largest_step
    at_limit = {name: float(part) for name, part in zip(fit.joint_names, fit.at_limit, strict=True) if part > 0}
    by_reason: dict[str, list[str]] = {}
    for name, reason in fit.unobservable.items():
        by_reason.setdefault(reason, []).append(name)
    texts = [f"The recording does not determine {listed(names)}: {why}" for why, names in by_reason.items()]
    metrics = [
        *warnings_of("undetermined-joints", texts),
        Metric("Model", f"{fit.arm.name}, {len(fit)} frames, {fit.time[0]:.2f} to {fit.time[-1]:.2f} s",
               key="model", value=fit.arm.name),
        Metric("Arm", f"{fit.arm.side}: {fit.side_reason}", key="side", value=fit.arm.side),
        *numbers(frames=len(fit), joints_not_determined=fit.unobservable),
        Metric("Segments", listed([f"{name} {length:.3f} m" for name, length in lengths.items()]),
               "The model is scaled to these lengths.", "segment_lengths", lengths, "m"),
        Metric("Largest joint step", f"{step:.1f}° {at_time(step_at)}", "Between successive frames.",
               "largest_joint_step", step, "°"),
        Metric("Saturated joints", listed([f"{name} {100 * part:.0f} %" for name, part in at_limit.items()]),
               "Share of the frames; the true angle may exceed the limit.", "fraction_at_limit", at_limit),
        *notes(fit.notes),
    ]  # fmt: skip
    residuals = fit.residual_summary()
    columns = {"direction of": "{name}", "median": "{median:.2f}°", "95 %": "{p95:.2f}°", "max": "{max:.2f}°",
               "when": "at {max_at_s:.1f} s"}  # fmt: skip
    table = table_of([{"name": name, **one} for name, one in residuals.items()], columns)
    caption = "Angle between measured and modelled direction of each segment, and about its own axis where it is known."
    table = replace(table, caption=caption, key="residual_deg", value=residuals)
    return Section("Human arm", tuple(metrics), (table,), "person")
