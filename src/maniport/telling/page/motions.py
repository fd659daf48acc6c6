"""The moving part of a page: arms with their ellipsoids, curves and the map of the domains."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from maniport.bodies import Arm, EllipsoidSpec
from maniport.defaults import DAMPING
from maniport.errors import FileFormatError, ManiportError
from maniport.pipeline import TransferResult
from maniport.pipeline.execution import Execution
from maniport.telling.diffusion import DiffusionMap, map_of
from maniport.telling.of_motion import DISTANCE, FLOOR, FLOOR_MEANING, GAP, GAP_MEANING, TOGETHER
from maniport.telling.page.content import Body, DomainMap, Line, Motion, Panel, Part
from maniport.telling.page.profiles import domain_map, ellipsoid_panels
from maniport.telling.roles import ACHIEVED, PERSON, ROLES, TARGET
from maniport.tracking import feasibility_gap
from maniport.validation import Array

ELLIPSOIDS, NEARNESS = "Ellipsoids", "How near the robot comes"
EDGE = 0.06
"""How far beyond a joint's limits its panel reaches, as a part of its range."""


def motion_of(result: TransferResult | Execution, charted: "Charted | None" = None) -> Motion:
    """Show what moves in a result: person and robot under the person's clock, or the robot alone under its own.

    `charted` is what `charted_of` gives for a run; default: it is computed.
    """
    run = result if isinstance(result, TransferResult) else None
    execution = result.execution if isinstance(result, TransferResult) else result
    asked = result.motion if isinstance(result, Execution) else result
    spec, drawn = asked.spec, asked.spec.part != "full"
    shown: dict[str, Array] = {}
    bodies: list[tuple[Body, str]] = []
    panels: dict[str, tuple[Panel, ...]] = {}
    if run is not None:
        shown[PERSON.name] = _velocity(run.demonstrated_profile, spec)
        at_hand = dict(shown) if drawn else {}
        bodies.append(body_of(run.fit.arm, run.fit.joint_angles, at_hand, name="Person"))
    if execution is not None:
        motion = execution.motion
        followed = {TARGET.name: motion.target, ACHIEVED.name: motion.achieved}
        shown |= followed
        bodies.append(body_of(execution.robot, motion.joint_positions, followed if drawn else {}, motion.path))
        panels[NEARNESS] = _nearness(execution)
    elif run is not None:
        shown[TARGET.name] = _velocity(run.target_profile, spec)
        if gap := _gap_lines(_gap_of_target(run)):
            panels[NEARNESS] = (Panel(GAP, "", gap, f"{GAP_MEANING} As a distance {DISTANCE}"),)
    if drawn:
        panels[ELLIPSOIDS] = ellipsoid_panels(shown, _names(result.robot), spec.velocity.unit)
    if execution is not None:
        motion = execution.motion
        joints = _joints(execution.robot, motion.joint_positions, ACHIEVED.name, motion.joint_units)
        panels[f"Joints of {result.robot.name}"] = joints
    if run is not None:
        angles, arm = np.degrees(run.fit.joint_angles), run.fit.arm
        panels["Joints of the person"] = _joints(arm, angles, PERSON.name, ("°",) * arm.dof)
    return Motion(
        asked.time,
        tuple(body for body, _ in bodies),
        panels,
        None if run is None else _map(run, charted or charted_of(run)),
        unit=spec.velocity.unit,
        clocks={"robot": execution.motion.time} if run is not None and execution is not None else {},
        legend={role: ROLES[role].about for role in shown} if drawn else {},
        note=_note(spec, execution is not None, *(why for _, why in bodies)),
    )


def body_of(
    arm: Arm,
    joint_positions: Array,
    ellipsoids: Mapping[str, Array] | None = None,
    path: Array | None = None,
    name: str | None = None,
) -> tuple[Body, str]:
    """Draw an arm at each time, with ellipsoids at its tip.

    With the surfaces of its links where there are any, else as a skeleton.

    Parameters
    ----------
    arm : Arm
    joint_positions : ndarray, shape (n, dof)
        [rad] or [m].
    ellipsoids, path
        See `maniport.telling.page.Body`.
    name : str, optional
        By default the arm's.

    Returns
    -------
    body : Body
    note : str
        Why it is a skeleton although its description names surfaces; empty where nothing is missing.
    """
    body = Body(name or arm.name, arm.skeleton(joint_positions), ellipsoids or {}, path)
    try:
        surfaces = arm.surfaces()
    except FileFormatError as error:  # what was computed is worth its page without them
        return body, f"{body.name} is drawn as a skeleton: {error}"
    poses = arm.link_poses(joint_positions)
    parts = tuple(Part(one.points, one.triangles, poses[:, one.joint]) for one in surfaces)
    return replace(body, parts=parts), ""


def _names(robot: Arm) -> dict[str, str]:
    return {PERSON.name: "person", TARGET.name: "target", ACHIEVED.name: robot.name}


def _nearness(execution: Execution) -> tuple[Panel, ...]:
    """Make panels of the distance from target to achieved, the smallest there could be, and the tip's error."""
    motion = execution.motion
    lines = [Line("achieved", motion.distance), Line(FLOOR.lower(), execution.plan.node_floor, TARGET.name, 1)]
    meaning = f"As a distance {DISTANCE} {FLOOR}: {FLOOR_MEANING[0].lower()}{FLOOR_MEANING[1:]}"
    lines += _gap_lines(execution.gap)
    meaning += f" {GAP}: {GAP_MEANING[0].lower()}{GAP_MEANING[1:]}"
    panels = [Panel(f"Distance from target to achieved, and {GAP.lower()}", "", tuple(lines), meaning)]
    if motion.position_error is not None:
        error = Line("tip", 1e3 * motion.position_error)
        panels.append(Panel("Tip beside its path", "mm", (error,), TOGETHER))
    return tuple(panels)


def _gap_lines(gap: Array | None) -> tuple[Line, ...]:
    return () if gap is None else (Line(GAP.lower(), gap, TARGET.name, 2),)


def _gap_of_target(result: TransferResult) -> Array | None:
    """Feasibility gap of a target that nobody follows, shape (n,); None where it cannot be searched for."""
    # as for a motion: inverses are as far from one another, and a damping of forces is none of velocities
    spec, own = result.spec, result.adapter.student_regularization
    damping = own if own.epsilon > 0.0 and spec.kind == "velocity" else DAMPING
    try:
        return feasibility_gap(
            result.robot, _velocity(result.target_profile, spec), damping=damping, spec=spec.velocity
        )
    except ManiportError:  # ellipsoids that are always flat: the page shows what else there is
        return None


def _joints(arm: Arm, values: Array, role: str, units: tuple[str, ...]) -> tuple[Panel, ...]:
    """Make a panel for each joint, its limits shaded; values (n, dof) in °, or the joints' own units."""
    panels = []
    for k, (name, unit) in enumerate(zip(arm.joint_names, units, strict=True)):
        factor = 180.0 / np.pi if unit == "°" else 1.0
        low, high = factor * float(arm.lower[k]), factor * float(arm.upper[k])
        line = Line("", np.asarray(values[:, k], dtype=float), role)
        if np.isfinite(high - low):
            margin = EDGE * (high - low)
            limits, span = (low, high), (low - margin, high + margin)
            meaning = f"Limits {_signed(low)} and {_signed(high)}; what is beyond them is shaded."
            panels.append(Panel(name, unit, (line,), meaning, limits=limits, span=span))
        else:
            panels.append(Panel(name, unit, (line,), "No limits."))
    return tuple(panels)


def _signed(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


class Charted(NamedTuple):
    """Domains and profiles of a run by role, as the fit saw them: regularised; and the map that is fitted to them."""

    domains: dict[str, Array]
    profiles: dict[str, Array]
    chart: DiffusionMap


def charted_of(result: TransferResult) -> Charted:
    """Regularise what a run's map shows, since singular ellipsoids are infinitely far away, and fit the map."""
    teacher, student = result.adapter.teacher_side, result.adapter.student_side
    domains = {PERSON.name: teacher(result.teacher_domain), ACHIEVED.name: student(result.student_domain)}
    profiles = {PERSON.name: teacher(result.demonstrated_profile), TARGET.name: student(result.target_profile)}
    return Charted(domains, profiles, map_of([*domains.values(), *profiles.values()]))


def _map(result: TransferResult, charted: Charted) -> DomainMap:
    """Make the map of a run, with what the robot was asked for at its place and what it achieves."""
    execution, names, profiles = result.execution, _names(result.robot), dict(charted.profiles)
    if execution is not None and result.spec.kind == "velocity":
        found = {TARGET.name: execution.motion.target, ACHIEVED.name: execution.motion.achieved}
        profiles |= {role: result.adapter.student_side(points, role) for role, points in found.items()}
    return domain_map(
        {role: (names[role], points) for role, points in charted.domains.items()},
        {role: (names[role], points) for role, points in profiles.items()},
        "Ellipsoids stand here as they were fitted: damped a little, for flat ones are infinitely far from all others.",
        charted.chart,
    )


def _note(spec: EllipsoidSpec, moved: bool, *missing: str) -> str:
    """Say what the picture shows; `missing` tells what could not be drawn."""
    sentences = [_picture(spec)] + ([] if moved else ["The robot was not moved."])
    return " ".join([*sentences, *filter(None, missing)])


def _picture(spec: EllipsoidSpec) -> str:
    if spec.part == "full":
        return "Ellipsoids of six dimensions cannot be drawn; their distances can."
    moves = "can move" if spec.part == "translation" else "can turn"
    note = (
        f"An ellipsoid shows how fast the hand {moves} in each direction while the joints move at unit speed; a "
        f"semi-axis of 1 {spec.velocity.unit} is drawn 0.25 m long. Rings mark its principal planes. Both arms have "
        f"one scale and are seen from one direction (x forward, y left, z up)."
    )
    if spec.kind == "force":
        note += " Force ellipsoids were transferred; their inverses, the velocity ellipsoids, are drawn."
    return note


def _velocity(profile: Array, spec: EllipsoidSpec) -> Array:
    """Velocity ellipsoids: these, or the inverses of force ellipsoids."""
    return np.asarray(np.linalg.inv(profile)) if spec.kind == "force" else profile
