"""Reports of arms, and of files of robots."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.chain import (
    IGNORED_GRAVITY,
    IGNORED_INCLUDES,
    IGNORED_SOFT_LIMITS,
    IMPLAUSIBLE_INERTIA,
    PRISMATIC,
    SOFT_LIMITS,
)
from maniport.arms.collisions import CheckedShapes, Collisions
from maniport.arms.loaders.model import Limb
from maniport.arms.loaders.packages import arm_names
from maniport.errors import argument
from maniport.motion.motion_limits import DERIVATIVES, MotionLimits
from maniport.motion.trajectory import Clearance
from maniport.report.values import Metric, Report, Section, Severity, Table, listed

REMARKS: dict[str, tuple[Severity, str]] = {
    SOFT_LIMITS: (
        "note",
        "position limits of these joints are the soft limits of their safety controllers: {}",
    ),
    IGNORED_SOFT_LIMITS: ("warning", "soft limits of safety controllers are ignored: {}"),
    IGNORED_INCLUDES: (
        "warning",
        "files that this URDF includes with xacro are ignored: {}. If they contain links, let the name of the robot "
        "file end in .xacro",
    ),
    IMPLAUSIBLE_INERTIA: (
        "warning",
        "moments of inertia do not fit the masses of these links, and torques are wrong: {}. Correct them in the "
        "robot's description",
    ),
    IGNORED_GRAVITY: (
        "note",
        "the description is of a simulation without gravity; torques are those with gravity, downward: {}",
    ),
}
"""Severity and text of remarks about the description of a robot."""


def arm_report(arm: Arm) -> Report:
    """Describe an arm: its joints with their limits, fixed joints, and frames."""
    section = Section("", tables=(_joint_table(arm),))
    text = arm.name
    if arm.side:
        text = f"{arm.name}, a human {arm.side} arm"
    section.add("Arm", "arm", arm.name, text)
    section.add("Degrees of freedom", "degrees_of_freedom", arm.dof)
    section.metrics += chain_metrics(arm)
    if not arm.side:
        _add_mass(section, arm)
        limits = MotionLimits.of(arm, joint_limit_margin=0.0)  # no motion of a person is planned
        warn_of_limits(section, limits)
    section.add("Frames", "frames", list(arm.frames))
    return Report(arm.name, "", (section,))


def _joint_table(arm: Arm) -> Table:
    """Return the joints of an arm with their limits."""
    unknown = np.full(arm.dof, np.inf)
    speeds = unknown if arm.velocity_limits is None else arm.velocity_limits
    efforts = unknown if arm.effort_limits is None else arm.effort_limits
    rows = []
    limits = {}
    for i, name in enumerate(arm.joint_names):
        low = arm.lower[i]
        high = arm.upper[i]
        unit = arm.joint_units[i]
        effort_unit = "N"
        positions = f"{low:.3f} to {high:.3f} {unit}"
        if unit == "rad":
            effort_unit = "N m"
            positions += f" ({np.degrees(low):.0f}° to {np.degrees(high):.0f}°)"
        speed = _limit(speeds[i], f"{unit}/s")
        effort = _limit(efforts[i], effort_unit)
        rows.append((name, positions, speed, effort))
        limits[name] = [float(low), float(high)]

    columns = ("joint", "position limits", "velocity limit", "effort limit")
    return Table(columns, tuple(rows), key="joints", value=limits)


def _limit(value: float, unit: str) -> str:
    if value < np.inf:
        return f"{value:.3g} {unit}"
    return "unknown"


def _add_mass(section: Section, arm: Arm) -> None:
    inertia = arm.chain.inertia
    if inertia is None:
        section.add("Moving mass", "moving_mass_kg", None, "unknown")
        return
    mass = float(inertia[1:, 0, 0].sum())
    section.add("Moving mass", "moving_mass_kg", mass, f"{mass:.3g} kg")


def chain_metrics(arm: Arm) -> tuple[Metric, Metric, Metric]:
    """Return base frame, end effector and fixed joints."""
    chain = arm.chain
    base = chain.base or _first_frame_at_base(arm)
    sliding = {joint.name for joint in chain.joints if joint.kind == PRISMATIC}
    locked = {}
    texts = []
    for name, position in chain.locked.items():
        value = float(position)
        locked[name] = value
        if name in sliding:
            texts.append(f"{name} at {value:.3g} m")
        else:
            texts.append(f"{name} at {np.degrees(value):.3g}°")
    return (
        Metric("Base", base, "Frame of positions and directions.", "base", base),
        Metric("End effector", arm.frame, "", "frame", arm.frame),
        Metric("Fixed joints", listed(texts), "", "fixed_joints", locked),
    )


def _first_frame_at_base(arm: Arm) -> str:
    """Return the name of the base where none was chosen: the first frame that stands there."""
    for name, frame in arm.chain.frames.items():
        if not frame.joint and np.allclose(frame.placement, np.eye(4)):
            return name
    return "the base"


UNITS_OF_RATES = {"position": "", "velocity": "/s", "acceleration": "/s²", "jerk": "/s³"}


def warn_of_limits(section: Section, limits: MotionLimits) -> None:
    """Warn of limits that are assumed, with their values and how to give real ones, and of unchecked torques.

    Notes and warnings about limits and masses in the robot's description are added.
    """
    arm = limits.arm
    advice = f"Give the real ones with {argument('motion_limits', option='--limits')}"
    for quantity in ("position", *DERIVATIVES):
        texts = []
        for value, joints in _joints_by_assumed_limit(limits, quantity).items():
            names = "all joints"
            if len(joints) < arm.dof:
                names = listed(joints)
            texts.append(f"{value} for {names}")
        if texts:
            text = f"{quantity} limits are assumed: {'; '.join(texts)}. {advice}"
            section.warn(f"assumed-{quantity}-limits", text)
    warn_of_description(section, arm)

    unlimited = []
    for name, effort in zip(arm.joint_names, limits.effort, strict=True):
        if np.isinf(effort):
            unlimited.append(name)
    unknown = listed(unlimited)
    if limits.dynamics is None:
        text = "torques are not checked: the robot's description has no masses"
        section.warn("unchecked-torques", text)
    elif unknown:
        text = f"torques of {unknown} are not checked: effort limits are unknown. {advice}"
        section.warn("unchecked-torques", text)


def _joints_by_assumed_limit(limits: MotionLimits, quantity: str) -> dict[str, list[str]]:
    """Return the joints with an assumed limit of a quantity, by the limit with its unit."""
    arm = limits.arm
    joints: dict[str, list[str]] = {}
    for name in limits.assumed[quantity]:
        i = arm.joint_names.index(name)
        if quantity == "position":
            value = f"{arm.lower[i]:.3g} to {arm.upper[i]:.3g}"
        else:
            value = f"{getattr(limits, quantity)[i]:.4g}"
        text = f"{value} {arm.joint_units[i]}{UNITS_OF_RATES[quantity]}"
        joints.setdefault(text, []).append(name)
    return joints


def warn_of_description(section: Section, arm: Arm | ArmGroup) -> None:
    """Warn of masses in a robot's description that are impossible, and note how its limits are read."""
    for member in as_group(arm).arms:
        chain = member.chain
        moving = set[str]()
        for name, frame in chain.frames.items():
            if frame.joint:
                moving.add(name)
        for name, body in (chain.others or {}).items():
            if body.joint:
                moving.add(name)
        concerned = {
            SOFT_LIMITS: chain.coordinates,
            IGNORED_SOFT_LIMITS: chain.coordinates,
            IMPLAUSIBLE_INERTIA: moving,
        }
        for kind, (severity, text) in REMARKS.items():
            details = dict(chain.remarks.get(kind, {}))
            if kind in concerned:
                for name in set(details).difference(concerned[kind]):
                    del details[name]
            if details:
                section.warn(kind, text.format(_detailed(details)), severity=severity)


def _detailed(details: Mapping[str, str], most: int = 8) -> str:
    """List names with their details."""
    texts = []
    for name, detail in details.items():
        texts.append(f"{name} ({detail})" if detail else name)
    if len(texts) > most:
        texts[most:] = [f"{len(texts) - most} more"]
    return listed(texts)


def warn_of_collisions(
    section: Section, result: Collisions | Clearance, unchecked: Sequence[str] = ()
) -> None:
    """Warn of what is not checked for collisions; `unchecked`: links without a shape, and pairs of links."""
    if not result.checked:
        section.warn("unchecked-collisions", f"collisions are not checked: {result.reason}")
        return
    shapes = result.shapes
    if result.stand_ins:
        meshes = f"meshes of {listed(result.stand_ins)} are missing"
        section.warn("missing-meshes", f"{meshes}; these links are drawn by their collision shapes")
    if shapes.replaced:
        meshes = f"collision shapes of {listed(shapes.replaced)} cannot be read"
        reason = next(iter(shapes.replaced.values()))
        text = f"{meshes}; their visual shapes are checked instead: {reason}"
        section.warn("missing-meshes", text)
    if unchecked:
        reason = "their shapes are unknown, convex hulls always meet, or the description excludes contacts"
        if shapes.missing:
            reason = next(iter(shapes.missing.values()))
        text = f"not checked for collisions: {listed(unchecked)}; {reason}"
        section.warn("unchecked-links", text)


def add_collision_shapes(section: Section, shapes: CheckedShapes) -> None:
    """Add which shapes are checked for collisions, and which pairs of links are not."""
    if not shapes.collision and not shapes.visual:
        return
    text = str(shapes)
    if shapes.excluded:
        text += f"; {len(shapes.excluded)} pairs of links excluded by the description"
    if shapes.overlapping:
        pairs = listed(" and ".join(pair) for pair in shapes.overlapping)
        text += f"; not checked, since they always overlap: {pairs}"
    value = {
        "collision": list(shapes.collision),
        "visual": list(shapes.visual),
        "excluded": [list(pair) for pair in shapes.excluded],
        "overlapping": [list(pair) for pair in shapes.overlapping],
    }
    section.add("Collision shapes", "collision_shapes", value, text)


def robot_report(name: str, limbs: Sequence[Limb], arm: Arm | None) -> Report:
    """Describe the file of a robot: the chosen chain, if there is one, and the other end effectors."""
    if arm is None:
        lead = "Several limbs are of equal length: choose one with --frame"
        arms = " or ".join(arm_names(name))
        if arms:
            lead += f", or name {arms}"
        return Report(name, f"{lead}.", _limb_sections("Ends", limbs))

    others = [limb for limb in limbs if limb.frame != arm.frame]
    report = arm_report(arm)
    section = report.sections[0]
    chosen = [limb for limb in limbs if limb.frame == arm.frame]
    if chosen:
        metrics = []
        for metric in section.metrics:
            if metric.key == "frame":
                metric = replace(metric, text=f"{metric.text} ({chosen[0].reason})")
            metrics.append(metric)
        section.metrics = tuple(metrics)
    if not arm.side:
        collisions = Collisions.of(arm)
        add_collision_shapes(section, collisions.shapes)
        warn_of_collisions(section, collisions, collisions.unchecked)
    return replace(report, sections=(*report.sections, *_limb_sections("Other ends", others)))


def _limb_sections(title: str, limbs: Sequence[Limb]) -> tuple[Section, ...]:
    """Return a section with a table of limbs, if there are any."""
    if not limbs:
        return ()
    rows = []
    value = {}
    for limb in limbs:
        ends = dict.fromkeys((limb.joints[0], limb.joints[-1]))  # one, where both are the same
        rows.append((limb.frame, str(len(limb.joints)), " … ".join(ends), limb.fork or ""))
        value[limb.frame] = {"joints": list(limb.joints), "fork": limb.fork}
    columns = ("--frame", "joints", "from … to", "--base")
    table = Table(columns, tuple(rows), key="ends", value=value)
    text = "Fingers are omitted. With --base the chain begins at a branch."
    return (Section(title, tables=(table,), text=text),)
