"""Facts of a recording: what it holds, which point plays which role, and what completes an arm."""

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from maniport.bodies import myoarm
from maniport.bodies.anthropometry import adult_range
from maniport.bodies.chain import RIGHT, SIDES
from maniport.defaults import AUTO
from maniport.demonstrations import Recording
from maniport.demonstrations.data_quality import open_joints
from maniport.demonstrations.marker_sets import DIRECTIONS, ROLES
from maniport.demonstrations.roles import (
    assign_roles,
    example_markers,
    find_side,
    lacking,
    played,
    role_position,
    usual_names,
)
from maniport.errors import RecordingError, nearest_first
from maniport.telling.facts import Fact, Facts, Section, Table, listed, notes, numbers, told, warning, warnings_of
from maniport.telling.renderings import escaped

RECORDING = "recording"
"""Key of warnings about a recording."""

NEAREST = 3
"""So many names are shown that are nearest to the usual ones."""


@told.register
def recording_facts(
    recording: Recording, markers: Mapping[str, Any] | None = None, side: str = AUTO, command: str = ""
) -> Facts:
    """Tell what a recording holds, and what the points of it are."""
    roles = {one: played(recording, markers if one == _meant(side) else None, one) for one in SIDES}
    whole = [one for one in SIDES if not lacking(roles[one][1])]
    taken = _taken(recording, markers, side)
    fitted = taken[0].value if taken else None
    best = max(SIDES, key=lambda one: (one == fitted, one in whole, len(roles[one][1].keys() & {"elbow", "wrist"})))
    sections = (
        recording_section(recording, points=True),
        _arms(recording, {one: found for one, (_, found) in roles.items()}, roles[best][0], markers, side),
        _completion(recording, *roles[best], best, command or shlex.quote(recording.source or "FILE")),
    )
    return Facts(recording.source or "A recording", sections=sections, doubts=warnings_of(RECORDING, recording.doubts))


def recording_section(recording: Recording, points: bool = False) -> Section:
    """Tell of a recording, with the names of its points where they are asked for."""
    source = Path(recording.source).name
    gaps = {name: float(part) for name, part in zip(recording.names, recording.missing, strict=True) if part}
    rate = recording.rate if len(recording) > 1 else None
    frames = f"{len(recording)}, {recording.duration:.2f} s at {rate:.4g} Hz" if rate else "1"
    facts = [
        Fact("File", source, key="source", value=source),
        Fact("Format", recording.format.removeprefix(".").upper(), key="format", value=recording.format),
        Fact("Frames", frames, key="frames", value=len(recording)),
        *numbers(duration_s=round(recording.duration, 3), rate_hz=rate and round(rate, 3)),
        Fact("Up", recording.up, key="up", value=recording.up),
    ]
    if points:
        every = list(recording.names)
        facts.append(Fact("Points", f"{len(every)}: {listed(every)}", key="points", value=every))
    missing = listed([f"{name} {100 * part:.1f} %" for name, part in gaps.items()])
    facts.append(Fact("Missing", missing if points else "", "Part of the frames.", key="missing", value=gaps))
    return Section("The recording", (*facts, *notes(recording.notes)), key="recording")


def _arms(
    recording: Recording, roles: Mapping[str, Any], family: str, markers: Mapping[str, Any] | None, side: str
) -> Section:
    """Tell which point plays which role."""
    facts, meant = _taken(recording, markers, side), _meant(side)
    for one in SIDES:
        missing, lengths = lacking(roles[one]), _lengths(recording, roles[one])
        text = f"lacks {listed(missing)}" if missing else "complete"
        value = {"complete": not missing, "lacks": missing, "lengths_m": lengths, "markers": roles[one]}
        told_lengths = [f"{name} {length:.3f} m" for name, length in lengths.items()]
        facts.append(Fact(f"{one.title()} arm", listed([text, *told_lengths]), key=one, value=value))
        facts += _contradicted(recording, markers if one == meant else None, one) if not missing else []
        facts += warnings_of("segment-lengths", [f"the {one} arm: {text}" for text in _strange(lengths)])
    if all(lacking(found) for found in roles.values()):
        facts.append(warning("arm-incomplete", "No arm is complete, so that none can be fitted"))
    arm = [role for role in ROLES if not role.startswith("trunk")]
    shown = Table(("role", *(f"{one} arm" for one in SIDES)),
                  tuple((role, *(_names(role, roles[one].get(role)) for one in SIDES)) for role in arm))  # fmt: skip
    trunk = {role: found[role] for found in roles.values() for role in ROLES if role in found and role not in arm}
    rows = tuple((role, *(" + ".join(group) for group in pair)) for role, pair in trunk.items())
    known = Fact("Names", f"as those of {family}", key="names", value=family) if any(roles.values()) else Fact("", "")
    tables = (shown, *([Table(("trunk", "from", "to"), rows)] if rows else []))
    return Section("Which point plays which role", (known, *facts), tables, key="arms")


def _completion(recording: Recording, family: str, roles: Mapping[str, Any], side: str, command: str) -> Section:
    """Tell how a user gives what is missing."""
    required = lacking(roles)
    wanted = required or [role for role in ("hand", "elbow_axis", "wrist_axis") if role not in roles]
    if not wanted:
        return Section("")
    if required:
        title, lines = "To complete it", [f"The {side} arm lacks {listed(required)}."]
        for role in required:
            usual = usual_names(role, family, side)
            near = nearest_first(usual.replace("'", ""), recording.seen)[:NEAREST]
            lines.append(f"- {role}: usually {usual}; nearest here: {escaped(listed(near)) or 'none'}")
    else:
        arm = myoarm()
        held = listed([arm.joint_names[joint] for joint in open_joints(arm, roles)])
        title = "What would tell more"
        lines = [
            f"The {side} arm can be fitted as it is{f', but {held} stay open: held near neutral' if held else ''}."
        ]
        lines.append(f"Points for {listed(wanted)} would tell more, where the recording has them.")
    template = example_markers(wanted)
    lines += [
        "Write names of points instead of the words in capitals into a file markers.json:",
        f"`{json.dumps(template)}`",
        f"and give it: `maniport transfer {command} --markers markers.json"
        f"{' --arm left' if side == 'left' else ''} -o results`",
    ]
    return Section(title, tuple(numbers(markers=template)), key="to_complete", text="\n".join(lines))


def _names(role: str, names: Any) -> str:
    if names is None:
        return "–"
    return " to ".join(" + ".join(group) for group in names) if role in DIRECTIONS else " + ".join(names)


def _lengths(recording: Recording, roles: Mapping[str, Any]) -> dict[str, float]:
    """Median lengths of the segments whose ends are there [m]."""
    found = {}
    for name, (start, end) in {"upper arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist")}.items():
        if start in roles and end in roles:
            step = role_position(recording, roles[end]) - role_position(recording, roles[start])
            length = np.linalg.norm(step, axis=-1)
            if np.isfinite(length).any():
                found[name] = round(float(np.nanmedian(length)), 4)
    return found


def _strange(lengths: Mapping[str, float]) -> list[str]:
    """Tell of segments that no adult has."""
    found = []
    for name, length in lengths.items():
        low, high = adult_range(name)
        if not low <= length <= high:
            found.append(f"the {name} is {length:.3f} m long, those of adults are {low:.2f} to {high:.2f} m")
    return found


def _meant(side: str) -> str:
    """Whose roles the user's choice is about."""
    return RIGHT if side == AUTO else side


def _taken(recording: Recording, markers: Mapping[str, Any] | None, side: str) -> list[Fact]:
    """Tell which arm is fitted; nothing where none can be, of which it is told why."""
    try:
        taken, reason, _ = find_side(recording, markers, side)
    except RecordingError:
        return []
    return [Fact("Fitted is", f"the {taken} arm: {reason}", key="fitted", value=taken)]


def _contradicted(recording: Recording, markers: Mapping[str, Any] | None, side: str) -> list[Fact]:
    """Tell why the points of an arm that seems complete cannot be its own."""
    try:
        assign_roles(recording, markers, side)
    except RecordingError as error:
        return [warning("markers", str(error))]
    return []
