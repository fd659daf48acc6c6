"""Reports of arms, of files of robots, and of placements."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.chain import (
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
from maniport.motion import Placement
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
}
"""Severity and text of remarks about the description of a robot."""


def arm_report(arm: Arm) -> Report:
    """Describe an arm: its joints with their limits, fixed joints, and frames."""
    unknown, inertia = np.full(arm.dof, np.inf), arm.chain.inertia
    speeds, efforts = (
        unknown if own is None else own for own in (arm.velocity_limits, arm.effort_limits)
    )

    def limit(value: float, unit: str) -> str:
        return f"{value:.3g} {unit}" if value < np.inf else "unknown"

    joints = zip(
        arm.joint_names, arm.joint_units, arm.lower, arm.upper, speeds, efforts, strict=True
    )
    rows = tuple(
        (name, f"{low:.3f} to {high:.3f} {unit}" + f" ({np.degrees(low):.0f}° to {np.degrees(high):.0f}°)" * angle,
         limit(speed, f"{unit}/s"), limit(effort, "N m" if angle else "N"))
        for name, unit, low, high, speed, effort in joints for angle in [unit == "rad"]
    )  # fmt: skip
    limits = dict(zip(arm.joint_names, np.transpose([arm.lower, arm.upper]).tolist(), strict=True))
    columns = "joint", "position limits", "velocity limit", "effort limit"
    section = Section("", (), (Table(columns, rows, key="joints", value=limits),))
    section.add(
        "Arm", "arm", arm.name, arm.name + (f", a human {arm.side} arm" if arm.side else "")
    )
    section.add("Degrees of freedom", "degrees_of_freedom", arm.dof)
    section.metrics += tuple(chain_metrics(arm))
    if not arm.side:
        mass = None if inertia is None else float(inertia[1:, 0, 0].sum())
        section.add(
            "Moving mass", "moving_mass_kg", mass, "unknown" if mass is None else f"{mass:.3g} kg"
        )
        warn_of_limits(
            section, MotionLimits.of(arm, joint_limit_margin=0.0)
        )  # no motion of a person is planned
    section.add("Frames", "frames", list(arm.frames))
    return Report(arm.name, "", (section,))


def chain_metrics(arm: Arm) -> list[Metric]:
    """Return base frame, end effector and fixed joints."""
    chain = arm.chain
    still = (
        name
        for name, at in chain.frames.items()
        if not at.joint and np.allclose(at.placement, np.eye(4))
    )
    base = chain.base or next(
        still, "the base"
    )  # the first frame at its place where none was chosen
    sliding = {joint.name for joint in chain.joints if joint.kind == PRISMATIC}
    locked = {name: float(value) for name, value in chain.locked.items()}
    text = listed(f"{name} at {value:.3g} m" if name in sliding else f"{name} at {np.degrees(value):.3g}°"
                  for name, value in locked.items())  # fmt: skip
    return [
        Metric("Base", base, "Frame of positions and directions.", "base", base),
        Metric("End effector", arm.frame, "", "frame", arm.frame),
        Metric("Fixed joints", text, "", "fixed_joints", locked),
    ]


def warn_of_limits(section: Section, limits: MotionLimits) -> None:
    """Warn of limits that are assumed, with their values and how to give real ones, and of unchecked torques.

    Notes and warnings about limits and masses in the robot's description are added.
    """
    arm, advice = (
        limits.arm,
        f"Give the real ones with {argument('motion_limits', option='--limits')}",
    )
    for suffix, quantity in zip(("", "/s", "/s²", "/s³"), ("position", *DERIVATIVES), strict=True):
        joints_of: dict[str, list[str]] = {}
        for name in limits.assumed[quantity]:
            i = arm.joint_names.index(name)
            value = (f"{arm.lower[i]:.3g} to {arm.upper[i]:.3g}" if quantity == "position"
                     else f"{getattr(limits, quantity)[i]:.4g}")  # fmt: skip
            joints_of.setdefault(f"{value} {arm.joint_units[i]}{suffix}", []).append(name)
        texts = [f"{text} for {listed(joints) if len(joints) < arm.dof else 'all joints'}"
                 for text, joints in joints_of.items()]  # fmt: skip
        if texts:
            section.warn(
                f"assumed-{quantity}-limits",
                f"{quantity} limits are assumed: {'; '.join(texts)}. {advice}",
            )
    warn_of_description(section, arm)
    unknown = listed(
        name
        for name, effort in zip(arm.joint_names, limits.effort, strict=True)
        if np.isinf(effort)
    )
    if limits.dynamics is None:
        section.warn(
            "unchecked-torques", "torques are not checked: the robot's description has no masses"
        )
    elif unknown:
        section.warn(
            "unchecked-torques",
            f"torques of {unknown} are not checked: effort limits are unknown. {advice}",
        )


def warn_of_description(section: Section, arm: Arm | ArmGroup) -> None:
    """Warn of masses in a robot's description that are impossible, and note how its limits are read."""
    for member in as_group(arm).arms:
        chain = member.chain
        remarks = {kind: dict(details) for kind, details in chain.remarks.items()}
        for kind in (SOFT_LIMITS, IGNORED_SOFT_LIMITS):
            own = remarks.get(kind, {})
            remarks[kind] = {name: own[name] for name in own if name in chain.coordinates}
        moving = {name for name, frame in chain.frames.items() if frame.joint}
        moving |= {name for name, body in (chain.others or {}).items() if body.joint}
        own = remarks.get(IMPLAUSIBLE_INERTIA, {})
        remarks[IMPLAUSIBLE_INERTIA] = {name: own[name] for name in own if name in moving}
        for kind, (severity, text) in REMARKS.items():
            details = remarks.get(kind, {})
            if details:
                section.warn(kind, text.format(_detailed(details)), severity=severity)


def _detailed(details: Mapping[str, str], most: int = 8) -> str:
    """List names with their details."""
    parts = [f"{name} ({detail})" if detail else name for name, detail in details.items()]
    if len(parts) > most:
        parts[most:] = [f"{len(parts) - most} more"]
    return listed(parts)


def warn_of_collisions(
    section: Section, result: Collisions | Clearance, unchecked: Sequence[str] = ()
) -> None:
    """Warn of what is not checked for collisions; `unchecked`: links without a shape, and pairs of links."""
    if not result.checked:
        section.warn("unchecked-collisions", f"collisions are not checked: {result.reason}")
        return
    shapes = result.shapes
    if result.stand_ins:
        text = "these links are drawn by their collision shapes"
        section.warn("missing-meshes", f"meshes of {listed(result.stand_ins)} are missing; {text}")
    if shapes.replaced:
        reason = next(iter(shapes.replaced.values()))
        text = f"their visual shapes are checked instead: {reason}"
        section.warn(
            "missing-meshes",
            f"collision shapes of {listed(shapes.replaced)} cannot be read; {text}",
        )
    if unchecked:
        text = "their shapes are unknown, convex hulls always meet, or the description excludes contacts"
        if shapes.missing:
            text = next(iter(shapes.missing.values()))
        section.warn("unchecked-links", f"not checked for collisions: {listed(unchecked)}; {text}")


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
    others = [limb for limb in limbs if arm is None or limb.frame != arm.frame]
    rows = tuple((limb.frame, str(len(limb.joints)), " … ".join(dict.fromkeys((limb.joints[0], limb.joints[-1]))),
                  limb.fork or "") for limb in others)  # fmt: skip
    value = {limb.frame: {"joints": list(limb.joints), "fork": limb.fork} for limb in others}
    table = Table(("--frame", "joints", "from … to", "--base"), rows, key="ends", value=value)
    title, text = (
        "Other ends" if arm else "Ends",
        "Fingers are omitted. With --base the chain begins at a branch.",
    )
    ends = [Section(title, (), (table,), text=text)] if others else []
    if arm is None:
        arms = " or ".join(arm_names(name))
        lead = f"Several limbs are of equal length: choose one with --frame{f', or name {arms}' if arms else ''}."
        return Report(name, lead, tuple(ends))
    report = arm_report(arm)
    chosen = [limb for limb in limbs if limb.frame == arm.frame]
    if chosen:
        section = report.sections[0]
        metrics = []
        for metric in section.metrics:
            if metric.key == "frame":
                metric = replace(metric, text=f"{metric.text} ({chosen[0].reason})")
            metrics.append(metric)
        section.metrics = tuple(metrics)
    if not arm.side:
        collisions = Collisions.of(arm)
        add_collision_shapes(report.sections[0], collisions.shapes)
        warn_of_collisions(report.sections[0], collisions, collisions.unchecked)
    return replace(report, sections=(*report.sections, *ends))


def placement_section(placed: Placement) -> Section:
    """Describe the placement of a path, whether the robot reaches it, and alternatives."""
    values = [
        {"rank": rank, "scale": item.scale, "yaw_deg": float(np.degrees(item.yaw)), "offset_m": item.offset.tolist(),
         "tilt_deg": float(np.degrees(item.tilt)), "heading_deg": float(np.degrees(item.heading)), "rms": item.rms,
         "max": float(item.planned_distance.max())}
        for rank, item in enumerate(placed.candidates, 1)
    ]  # fmt: skip
    columns = {
        "rank": "{rank}", "scale": "{scale:.3f}", "yaw [°]": "{yaw_deg:.1f}",
        "tilt [°]": "{tilt_deg:.1f} to {heading_deg:.1f}",
        "middle [m]": "{offset_m[0]:.3f}, {offset_m[1]:.3f}, {offset_m[2]:.3f}",
        "distance, rms / max": "{rms:.2f} / {max:.2f}",
    }  # fmt: skip
    caption = "Placements by motions planned through some waypoints, the best first; of equal ones, the least rotated."
    tables = (Table.of(values, columns, caption, "candidates"),) if values else ()
    section = Section("Placement", (), tables, "placement", folded=True)
    yaw, tilt, heading = np.degrees([placed.yaw, placed.tilt, placed.heading]).tolist()
    offset, out = placed.offset.tolist(), int((~placed.reachable).sum())
    far = 1e3 * float(placed.position_error.max()) if out else 0.0
    if out:
        text = f"{out} of {len(placed.path)} waypoints of the path are out of reach, by up to {far:.1f} mm"
        section.warn("path-out-of-reach", text)
    middle = listed(f"{value:.3f}" for value in offset)
    text = f"scale {placed.scale:.3f}, yaw {yaw:.1f}°, middle at ({middle}) m in the base frame"
    section.add("Path", "", None, text, "The target ellipsoids are rotated with the path.")
    base = {"tilt_deg": tilt, "heading_deg": heading, "rotation": placed.base_orientation.tolist()}
    text = (
        f"tilted by {tilt:.1f}° toward {heading:.1f}° from its x axis to its y axis" if tilt else ""
    )
    about = "Rotation from the upright base about a horizontal axis."
    section.add("Base", "base_orientation", base, text, about)
    section.numbers(scale=float(placed.scale), yaw_deg=yaw, offset_m=offset, points_out_of_reach=out,
                    farthest_out_of_reach_mm=far)  # fmt: skip
    return section
