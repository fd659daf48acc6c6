"""Reports of recordings, of the human arm fitted to one, and of what is learned from several."""

import json
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

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
    Value,
    in_axes,
    listed,
    software,
)
from maniport.util.defaults import AUTO


def recording_report(
    recording: Recording,
    markers: Mapping[str, object] | None = None,
    side: str = AUTO,
    command: str = "",
) -> Report:
    """Describe a recording and the roles of its points."""
    side_of_markers = RIGHT if side == AUTO else side
    names_of = {}
    roles_of: dict[str, Roles] = {}
    for arm in SIDES:
        own_markers = markers if arm == side_of_markers else None
        names_of[arm], roles_of[arm] = assigned_roles(recording, own_markers, arm)
    best, reason = _best_side(recording, roles_of, markers, side)

    section = Section("Roles of the points", key="arms")
    if markers and set(roles_of[best]) <= set(markers):
        section.add("Names", "names", "markers", f"all assigned by {argument('markers')}")
    elif any(roles_of.values()):
        section.add("Names", "names", names_of[best], f"as in {names_of[best]}")
    if reason:
        section.add("Fitted arm", "fitted", best, f"the {best} arm: {reason}")
    exchanged = body_sides(recording, roles_of[best], best).warnings()
    section.warn("sides", *exchanged)
    for arm in SIDES:
        if not exchanged and not missing_roles(roles_of[arm]):
            own_markers = markers if arm == side_of_markers else None
            try:
                assign_roles(recording, own_markers, arm)
            except RecordingError as error:
                section.warn("markers", str(error))
        _add_arm(section, recording, roles_of[arm], arm)
    missing = missing_roles(roles_of[best])
    if missing:
        section.warn("arm-incomplete", "No arm is complete, so that none can be fitted")
    section.tables = (_role_table(roles_of),)

    sections = [recording_section(recording, points=True), section]
    if missing:
        sections.append(_completion(recording, roles_of[best], names_of[best], best, command))
    return Report(recording.source or "A recording", sections=tuple(sections))


def _best_side(
    recording: Recording,
    roles_of: Mapping[str, Roles],
    markers: Mapping[str, object] | None,
    side: str,
) -> tuple[str, str]:
    """Return the side of the arm that is fitted, and why; where none can be, that with most joints."""
    try:
        best, reason, _ = find_side(recording, markers, side)
    except RecordingError:
        best = max(SIDES, key=lambda name: len(roles_of[name].keys() & {"elbow", "wrist"}))
        reason = ""
    return best, reason


def _role_table(roles_of: Mapping[str, Roles]) -> Table:
    """Return the points of each role for each side."""
    rows = []
    for role in ROLES:
        cells = [_point_names(role, roles_of[name]) for name in SIDES]
        rows.append((role, *cells))
    columns = [f"{name} arm" for name in SIDES]
    return Table(("role", *columns), tuple(rows))


def _point_names(role: str, roles: Roles) -> str:
    """Write the points of a role; a direction has two groups of them."""
    points = roles.get(role, ())
    if not points:
        return "–"
    if role in DIRECTIONS:
        groups = [" + ".join(group) for group in points]
        return " to ".join(groups)
    return " + ".join(points)


def recording_section(recording: Recording, points: bool = False) -> Section:
    """Describe a recording, with the names of its points where they are requested."""
    section = Section("Recording", key="recording", folded=not points)
    names = list(recording.names)
    count = len(recording)
    section.add("File", "source", Path(recording.source).name)
    section.add("Format", "format", recording.format, recording.format.removeprefix(".").upper())
    rate = recording.rate if count > 1 else None
    rounded_rate = rate
    text = "1"
    if rate:
        rounded_rate = round(rate, 3)
        text = f"{count}, {recording.duration:.2f} s at {rate:.4g} Hz"
    section.add("Frames", "frames", count, text)
    section.numbers(duration_s=round(recording.duration, 3), rate_hz=rounded_rate)
    if points:
        section.add("Points", "points", names, f"{len(names)}: {listed(names)}")

    gaps = {}
    for name, share in zip(names, recording.missing, strict=True):
        if share:
            gaps[name] = float(share)
    text = _percentages(gaps, 1) if points else ""
    section.add("Missing", "missing", gaps, text, "Share of the frames.")
    section.warn(RECORDING, *recording.quality_warnings)
    section.note(*recording.notes)
    return section


def _percentages(shares: Mapping[str, float], digits: int = 0) -> str:
    return listed(f"{name} {100 * share:.{digits}f} %" for name, share in shares.items())


SEGMENTS = {"upper arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist")}
"""Roles at the ends of segments."""

SHORTEST_BODY = 0.85 * 1.4
TALLEST_BODY = 1.15 * 2.1
"""Heights of adults of which segments are a share: 1.4 to 2.1 m, ± 15 % [m]."""


def _add_arm(section: Section, recording: Recording, roles: Roles, side: str) -> None:
    """Describe one arm: its missing roles and its lengths."""
    missing = missing_roles(roles)
    lengths = _segment_lengths(recording, roles)
    texts = ["complete"]
    if missing:
        texts = [f"lacks {listed(missing)}"]
    for name, length in lengths.items():
        texts.append(f"{name} {length:.3f} m")
    value = {"complete": not missing, "lacks": missing, "lengths_m": lengths, "markers": roles}
    section.add(f"{side.title()} arm", side, value, listed(texts))

    for name, length in lengths.items():
        low = SHORTEST_BODY * FRACTIONS[name]
        high = TALLEST_BODY * FRACTIONS[name]
        if not low <= length <= high:
            range_text = f"those of adults are {low:.2f} to {high:.2f} m"
            text = f"the {side} arm: the {name} is {length:.3f} m long, {range_text}"
            section.warn("segment-lengths", text)


def _segment_lengths(recording: Recording, roles: Roles) -> dict[str, float]:
    """Return the median length of each segment whose ends are recorded [m]."""
    lengths = {}
    for name, (start, end) in SEGMENTS.items():
        if start not in roles or end not in roles:
            continue
        step = role_position(recording, roles[end]) - role_position(recording, roles[start])
        length = np.linalg.norm(step, axis=-1)
        if np.isfinite(length).any():
            lengths[name] = round(float(np.nanmedian(length)), 4)
    return lengths


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
        likely = likely_points(recording, role, roles, family, side)
        here = escaped(listed(likely)) or "none"
        lines.append(f"- {role}: usually {usual}; here perhaps {here}")

    template = example_markers(missing)
    file = command or shlex.quote(recording.source or "FILE")
    option = ""
    if side == "left":
        option = " --side left"
    lines.append("Replace the capitalized words with point names and save as markers.json:")
    lines.append(f"`{json.dumps(template)}`")
    transfer = f"maniport transfer {file} --markers markers.json{option} -o results"
    lines.append(f"Then run `{transfer}`")
    section = Section("Missing roles", key="to_complete", text="\n".join(lines))
    section.numbers(markers=template)
    return section


def fit_report(fit: HumanMotion) -> Report:
    """Describe the fits of the arms of a person."""
    sections = []
    for arm in fit.arms:
        section = person_section(arm)
        title = f"Human {arm.arm.side} arm"
        sections.append(replace(section, title=title, key=str(arm.arm.side)))
    names = " and ".join(arm.arm.name for arm in fit.arms)
    return Report(f"{names}, fitted to a person", sections=tuple(sections))


RESIDUAL_COLUMNS = {
    "direction of [°]": "{name}",
    "median": "{median:.2f}",
    "95th percentile": "{p95:.2f}",
    "max": "{max:.2f}",
    TIME_COLUMN: "{max_at_s:.1f}",
}
"""Format strings of the columns of the table of residuals."""


def person_section(fit: ArmFit) -> Section:
    """Describe the fit of a human arm and what the recording does not determine."""
    section = Section("Human arm", key="person", folded=True)
    section.tables = (_residual_table(fit),)
    for text in fit.quality_warnings:
        section.warn(FIT if text in fit.model_warnings else RECORDING, text)
    names_by_reason: dict[str, list[str]] = {}
    for name, reason in fit.unobservable.items():
        names_by_reason.setdefault(reason, []).append(name)
    for reason, names in names_by_reason.items():
        text = f"The recording does not determine {listed(names)}: {reason}"
        section.warn("undetermined-joints", text)

    arm = fit.arm
    frames = f"{arm.name}, {len(fit)} frames, {fit.time[0]:.2f} to {fit.time[-1]:.2f} s"
    section.add("Model", "model", arm.name, frames)
    section.add("Arm", "side", arm.side, f"{arm.side}: {fit.side_reason}")
    section.numbers(frames=len(fit), joints_not_determined=fit.unobservable)
    lengths = {name: round(float(length), 4) for name, length in fit.segment_lengths.items()}
    text = listed(f"{name} {length:.3f} m" for name, length in lengths.items())
    about = "The model is scaled to these lengths."
    section.add("Segments", "segment_lengths", lengths, text, about, unit="m")
    at_limit = {}
    for name, share in zip(arm.joint_names, fit.at_limit, strict=True):
        if share > 0:
            at_limit[name] = float(share)
    about = "Share of the frames; the true angle may exceed the limit."
    section.add("Saturated joints", "fraction_at_limit", at_limit, _percentages(at_limit), about)
    section.note(*fit.notes)
    return section


def _residual_table(fit: ArmFit) -> Table:
    residuals = fit.residual_summary()
    records = [{"name": name, **numbers} for name, numbers in residuals.items()]
    caption = "Angle between measured and modelled direction of each segment, and about its own axis where it is known."
    table = Table.of(records, RESIDUAL_COLUMNS, caption, "residual_deg")
    return replace(table, value=residuals)


AGREEMENT = {"agree": 0.2, "agree in part": 0.5, "do not agree": np.inf}
"""Largest shares of the variance between demonstrations by words."""


def learned_report(learned: LearnedProfile) -> Report:
    """Report a learned profile, agreement of the demonstrations first."""
    agreement = learned.agreement
    demonstrations = learned.demonstrations
    count = len(demonstrations)
    seconds = float(np.ptp(learned.time))
    grade = next(words for words, bound in AGREEMENT.items() if agreement.share <= bound)
    outlier = ""
    if agreement.outlier is not None:
        outlier = learned.names[agreement.outlier]

    section = Section("Learned profile", key="profile")
    for demonstration in demonstrations:
        section.warn(RECORDING, *demonstration.quality_warnings)
    if grade != "agree":
        text = "the demonstrations differ: their mean is a motion that nobody performed"
        section.warn("demonstrations-differ", text)
    if outlier:
        section.warn("demonstrations-differ", f"{outlier} differs from the other demonstrations")
    _add_agreement(section, learned)
    _add_profile(section, learned, seconds)
    section.tables = (_demonstration_table(learned),)

    lead = (
        f"{count} demonstrations, aligned to the {seconds:.1f} s of {learned.reference.name}. Each of "
        f"{len(learned.time)} times has a mean ellipsoid, its covariance, and a position of the hand."
    )
    after = agreement.after
    distance = "The mean distance to the mean ellipsoid of the same time is"
    cause = f"{distance} {after:.2f} ({in_axes(after)})."
    advice = ""
    held_out = _held_out_means(learned)
    if outlier:
        cause += f" {outlier} is an outlier."
        advice = f"Leave out {outlier}, or give it a profile of its own."
    elif held_out and held_out["learned"] > held_out["plain_mean"]:
        more = argument("components", 2 * learned.model.n_components_)
        advice = f"More Gaussians may predict better: {more}."
    return Report(
        f"A profile of {count} demonstrations",
        lead,
        (section,),
        outcome=f"The demonstrations {grade}.",
        cause=cause,
        advice=advice,
    )


def _held_out_means(learned: LearnedProfile) -> dict[str, float]:
    """Return the mean distance of demonstrations to each profile learned without them."""
    held_out = learned.agreement.held_out or {}
    return {name: float(np.mean(distances)) for name, distances in held_out.items()}


def _add_agreement(section: Section, learned: LearnedProfile) -> None:
    """Add how far the demonstrations are from their mean, and from a profile learned without them."""
    agreement = learned.agreement
    value = {"before": agreement.before, "after": agreement.after}
    text = f"{agreement.after:.2f} after alignment, {agreement.before:.2f} before"
    about = "Mean distance to the mean ellipsoid of the same time; 0.1 is one axis 5 % too long."
    section.add("Dispersion", "dispersion", value, text, about, main=True)
    title = "Variance between demonstrations"
    text = f"{100 * agreement.share:.0f} %"
    about = "Share of all variance."
    section.add(title, "variance_share", agreement.share, text, about, main=True)
    means = _held_out_means(learned)
    if means:
        text = listed(f"{mean:.2f} to {name.replace('_', ' ')}" for name, mean in means.items())
        about = "Mean over the demonstrations."
        section.add("Leave-one-out distance", "held_out", means, text, about, main=True)


def _add_profile(section: Section, learned: LearnedProfile, seconds: float) -> None:
    """Add the settings of a learned profile and what was done to the demonstrations."""
    section.add("Gaussians", "gaussians", learned.model.n_components_)
    spec = learned.config.spec
    kind = {"kind": spec.kind, "part": spec.part}
    text = f"{len(learned.time)}, {spec.kind}, {spec.part}"
    about = "Trunk frame (x forward, y left, z up)."
    section.add("Ellipsoids", "ellipsoids", kind, text, about)
    section.numbers(
        duration_s=round(seconds, 3),
        reference=learned.alignment.reference,
        outlier=learned.agreement.outlier,
    )
    sides = tuple(str(arm.side) for arm in learned.arms)
    mirrored = [item.name for item in learned.demonstrations if item.motion.names != sides]
    if mirrored:
        section.note(f"mirrored to the {sides[0]} arm: {listed(mirrored)}")
    section.note(f"all ellipsoids are those of arms of mean lengths: {' and '.join(sides)}")
    section.metrics += tuple(software(learned.config.seed))


def _demonstration_table(learned: LearnedProfile) -> Table:
    """Return the demonstrations with their distances from one another."""
    agreement = learned.agreement
    held_out = agreement.held_out
    records = []
    for i, demonstration in enumerate(learned.demonstrations):
        motion = demonstration.motion
        record: dict[str, Value] = {
            "name": demonstration.name,
            "start_s": float(motion.time[0]),
            "stop_s": float(motion.time[-1]),
            "frames": len(motion),
            "side": listed(motion.names),
            "from_others": float(agreement.alone[i]),
            "held_out": float(held_out["learned"][i]) if held_out else np.nan,
            "segment_lengths_m": {fit.arm.side: fit.segment_lengths for fit in motion.arms},
        }
        records.append(record)

    columns = {
        "demonstration": "{name}",
        "frames": "{frames}",
        "arm": "{side}",
        "from the others": "{from_others:.2f}",
    }
    if held_out:
        columns["held out"] = "{held_out:.2f}"
    caption = (
        "Mean distances after alignment: from the others, and from the profile learned without it."
    )
    return Table.of(records, columns, caption, "demonstrations")
