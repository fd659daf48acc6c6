"""Reports of arms, of files of robots, and of placements."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from maniport.arms import Arm
from maniport.arms.chain import PRISMATIC
from maniport.arms.collisions import Collisions
from maniport.arms.loaders.model import Limb
from maniport.arms.loaders.packages import arm_names
from maniport.errors import argument
from maniport.motion import Placement
from maniport.motion.motion_limits import DERIVATIVES, MotionLimits
from maniport.motion.trajectory import Clearance
from maniport.report.values import Metric, Report, Section, Table, describe, info, listed, numbers, table_of, warning


@describe.register
def arm_report(arm: Arm) -> Report:
    """Describe an arm: its joints with their limits, fixed joints, and frames."""
    unknown = np.full(arm.dof, np.inf)
    speeds, efforts = (unknown if own is None else own for own in (arm.velocity_limits, arm.effort_limits))

    def limit(value: float, unit: str) -> str:
        return f"{value:.3g} {unit}" if value < np.inf else "unknown"

    joints = zip(arm.joint_names, arm.joint_units, arm.lower, arm.upper, speeds, efforts, strict=True)
    rows = [
        (name, f"{low:.3f} to {high:.3f} {unit}" + f" ({np.degrees(low):.0f}° to {np.degrees(high):.0f}°)" * angle,
         limit(speed, f"{unit}/s"), limit(effort, "N m" if angle else "N"))
        for name, unit, low, high, speed, effort in joints for angle in [unit == "rad"]
    ]  # fmt: skip
    limits = dict(zip(arm.joint_names, np.transpose([arm.lower, arm.upper]).tolist(), strict=True))
    inertia = arm.chain.inertia
    mass = None if inertia is None else float(inertia[1:, 0, 0].sum())
    metrics = (
        info("Arm", "arm", arm.name, arm.name + (f", a human {arm.side} arm" if arm.side else "")),
        info("Degrees of freedom", "degrees_of_freedom", arm.dof),
        *chain_metrics(arm),
        *([] if arm.side else [info("Moving mass", "moving_mass_kg", mass, f"{mass:.3g} kg" if mass else "unknown")]),
        info("Frames", "frames", list(arm.frames)),
        # no motion of a person is planned
        *([] if arm.side else assumed_limits(MotionLimits.of(arm, joint_limit_margin=0.0))),
    )
    columns = "joint", "position limits", "velocity limit", "effort limit"
    return Report(arm.name, "", (Section("", metrics, (Table(columns, tuple(rows), key="joints", value=limits),)),))


def chain_metrics(arm: Arm) -> list[Metric]:
    """Return base frame, end effector and fixed joints."""
    chain = arm.chain
    still = (name for name, at in chain.frames.items() if not at.joint and np.allclose(at.placement, np.eye(4)))
    base = chain.base or next(still, "the base")  # the first frame at its place where none was chosen
    sliding = {joint.name for joint in chain.joints if joint.kind == PRISMATIC}
    locked = {name: float(value) for name, value in chain.locked.items()}
    texts = [f"{name} at {value:.3g} m" if name in sliding else f"{name} at {np.degrees(value):.3g}°"
             for name, value in locked.items()]  # fmt: skip
    return [
        info("Base", "base", base, description="Frame of positions and directions."),
        info("End effector", "frame", arm.frame),
        info("Fixed joints", "fixed_joints", locked, listed(texts)),
    ]


def assumed_limits(limits: MotionLimits) -> list[Metric]:
    """Warn of limits that are assumed, with their values and how to give real ones."""
    arm, warned, advice = limits.arm, [], f"Give the real ones with {argument('motion_limits', option='--limits')}"
    for suffix, quantity in zip(("", "/s", "/s²", "/s³"), ("position", *DERIVATIVES), strict=True):
        joints_of: dict[str, list[str]] = {}
        for name in limits.assumed[quantity]:
            i = arm.joint_names.index(name)
            value = (f"{limits.lower[i]:.3g} to {limits.upper[i]:.3g}" if quantity == "position"
                     else f"{getattr(limits, quantity)[i]:.4g}")  # fmt: skip
            joints_of.setdefault(f"{value} {arm.joint_units[i]}{suffix}", []).append(name)
        if joints_of:
            texts = [f"{text} for {listed(joints) if len(joints) < arm.dof else 'all joints'}"
                     for text, joints in joints_of.items()]  # fmt: skip
            text = f"{quantity} limits are assumed: {'; '.join(texts)}. {advice}"
            warned.append(warning(f"assumed-{quantity}-limits", text))
    unknown = [name for name, effort in zip(arm.joint_names, limits.effort, strict=True) if np.isinf(effort)]
    if limits.dynamics is None:
        text = "torques are not checked: the robot's description has no masses"
        warned.append(warning("unchecked-torques", text))
    elif unknown:
        text = f"torques of {listed(unknown)} are not checked: effort limits are unknown. {advice}"
        warned.append(warning("unchecked-torques", text))
    return warned


def collision_warnings(result: Collisions | Clearance, unchecked: Sequence[str] = ()) -> list[Metric]:
    """Warn of what is not checked for collisions: `unchecked` links without a shape, and pairs of links."""
    if not result.checked:
        return [warning("unchecked-collisions", f"collisions are not checked: {result.reason}")]
    links = listed(result.unchecked if isinstance(result, Collisions) else unchecked)
    text = f"meshes of {listed(result.stand_ins)} are missing; the collision shapes of these links are checked instead"
    warned = [warning("missing-meshes", text)] if result.stand_ins else []
    text = f"not checked for collisions: {links}; their shapes are unknown or convex hulls always meet"
    return [*warned, *([warning("unchecked-links", text)] if links else [])]


def robot_report(name: str, limbs: Sequence[Limb], arm: Arm | None) -> Report:
    """Describe the file of a robot: the chosen chain, if there is one, and the other end effectors."""
    others = [limb for limb in limbs if arm is None or limb.frame != arm.frame]
    rows = tuple((limb.frame, str(len(limb.joints)), " … ".join(dict.fromkeys((limb.joints[0], limb.joints[-1]))),
                  limb.fork or "") for limb in others)  # fmt: skip
    value = {limb.frame: {"joints": list(limb.joints), "fork": limb.fork} for limb in others}
    table = Table(("--frame", "joints", "from … to", "--base"), rows, key="ends", value=value)
    title, text = "Other ends" if arm else "Ends", "Fingers are omitted. With --base the chain begins at a branch."
    ends = [Section(title, (), (table,), text=text)] if others else []
    if arm is None:
        arms = " or ".join(arm_names(name))
        lead = f"Several limbs are of equal length: choose one with --frame{f', or name {arms}' if arms else ''}."
        return Report(name, lead, tuple(ends))
    own, *more = arm_report(arm).sections
    unchecked = [] if arm.side else collision_warnings(Collisions.of(arm))
    return Report(arm.name, "", (replace(own, metrics=(*own.metrics, *unchecked)), *more, *ends))


@describe.register
def placement_report(placed: Placement) -> Report:
    """Describe the placement of a path, with its alternatives."""
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
    tables = (table_of(values, columns, caption, "candidates"),) if values else ()
    section = replace(placement_section(placed), tables=tables)
    return Report(f"A path of {len(placed.path)} waypoints", "", (section,))


def placement_section(placed: Placement) -> Section:
    """Describe the placement of a path and whether the robot reaches it."""
    yaw, tilt, heading = np.degrees([placed.yaw, placed.tilt, placed.heading]).tolist()
    base = {"tilt_deg": tilt, "heading_deg": heading, "rotation": placed.base_orientation.tolist()}
    offset, out = placed.offset.tolist(), int((~placed.reachable).sum())
    far = 1e3 * float(placed.position_error.max()) if out else 0.0
    text = f"{out} of {len(placed.path)} waypoints of the path are out of reach, by up to {far:.1f} mm"
    path = (f"scale {placed.scale:.3f}, yaw {yaw:.1f}°, middle at ({listed(f'{value:.3f}' for value in offset)}) m "
            "in the base frame")  # fmt: skip
    metrics = (
        *([warning("path-out-of-reach", text)] if out else []),
        Metric("Path", path, "The target ellipsoids are rotated with the path."),
        info("Base", "base_orientation", base,
             f"tilted by {tilt:.1f}° toward {heading:.1f}° from its x axis to its y axis" if tilt else "",
             "Rotation from the upright base about a horizontal axis."),
        *numbers(scale=float(placed.scale), yaw_deg=yaw, offset_m=offset, points_out_of_reach=out,
                 farthest_out_of_reach_mm=far),
    )  # fmt: skip
    return Section("Placement", metrics, key="placement")
