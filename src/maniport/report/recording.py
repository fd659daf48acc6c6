"""Reports of a recording and of the human arm fitted to it."""

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
    info,
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
    quality_warnings = warnings_of(RECORDING, recording.quality_warnings)
    return Report(recording.source or "A recording", sections=sections, data_warnings=quality_warnings)


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
        low, high = adult_range(name)
        if not low <= length <= high:
            text = f"the {name} is {length:.3f} m long, those of adults are {low:.2f} to {high:.2f} m"
            warned.append(warning("segment-lengths", f"the {side} arm: {text}"))
    return [info(f"{side.title()} arm", side, value, listed(texts)), *warned]


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
        joints = listed([arm.joint_names[joint] for joint in unobservable_joints(arm, roles)])
        undetermined = f"; unobservable joints stay near neutral: {joints}" if joints else ""
        title = "Additional roles"
        lines = [f"The {side} arm has all required points{undetermined}.",
                 f"Points for {listed(wanted)} would add information, if the recording has them."]  # fmt: skip
    template = example_markers(wanted)
    lines += [
        "Replace the capitalized words with point names and save as markers.json:",
        f"`{json.dumps(template)}`",
        f"Then run `maniport transfer {command} --markers markers.json"
        f"{' --side left' if side == 'left' else ''} -o results`",
    ]
    return Section(title, tuple(numbers(markers=template)), key="to_complete", text="\n".join(lines))


@describe.register
def fit_report(fit: ArmFit | HumanMotion) -> Report:
    """Describe the fit of one or both human arms."""
    data_warnings = warnings_of(FIT, fit.quality_warnings)
    if isinstance(fit, ArmFit):
        return Report(f"{fit.arm.name}, fitted to a person", "", (person_section(fit),), data_warnings=data_warnings)
    both = []
    if len(fit.arms) > 1:
        apart = np.linalg.norm(fit.hands[1] - fit.hands[0], axis=-1)
        distance = statistics("Distance between the hands", "between_hands", apart, fit.time, "m")
        both.append(Section("Both arms", (distance,)))
    arms = [replace(person_section(own), title=f"Human {own.arm.side} arm", key=str(own.arm.side)) for own in fit.arms]
    title = f"{' and '.join(own.arm.name for own in fit.arms)}, fitted to a person"
    return Report(title, sections=(*both, *arms), data_warnings=data_warnings)


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
