"""The moving part of a page: arms with their ellipsoids, curves and the map of the domains."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from maniport.bodies import Arm, EllipsoidSpec
from maniport.errors import FileFormatError, ManiportError
from maniport.pipeline import TransferResult
from maniport.pipeline.execution import Execution
from maniport.telling.of_motion import DISTANCE, FLOOR, FLOOR_MEANING, GAP, GAP_MEANING, TOGETHER
from maniport.telling.page.content import Body, DomainMap, Line, Motion, Panel, Part
from maniport.telling.page.profiles import domain_map, ellipsoid_panels
from maniport.telling.roles import ACHIEVED, PERSON, ROLES, TARGET
from maniport.tracking import feasibility_gap
from maniport.tracking.objective import DAMPING
from maniport.validation import Array

ELLIPSOIDS, NEARNESS = "Ellipsoids", "How near the robot comes"
EDGE = 0.06
"""How far beyond a joint's limits its panel reaches, as a part of its range."""


def motion_of(result: TransferResult | Execution) -> Motion:
    """Show what moves in a result: person and robot under the person's clock, or the robot alone under its own."""
    return _of_run(result) if isinstance(result, TransferResult) else _of_execution(result)


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


def _of_run(result: TransferResult) -> Motion:
    fit, execution, spec = result.fit, result.execution, result.spec
    drawn = spec.part != "full"
    shown = {PERSON.name: _velocity(result.demonstrated_profile, spec)}
    if execution is None:
        shown[TARGET.name] = _velocity(result.target_profile, spec)
    else:
        shown |= {TARGET.name: execution.motion.target, ACHIEVED.name: execution.motion.achieved}
    at_hand = {PERSON.name: shown[PERSON.name]} if drawn else {}
    bodies = [body_of(fit.arm, fit.joint_angles, at_hand, name="Person")]
    panels = {}
    if execution is not None:
        bodies.append(_robot_body(execution))
        panels[NEARNESS] = _nearness(execution)
    elif gap := _gap_lines(_gap_of_target(result)):
        panels[NEARNESS] = (Panel(GAP, "", gap, f"{GAP_MEANING} As a distance {DISTANCE}"),)
    if drawn:
        panels[ELLIPSOIDS] = ellipsoid_panels(shown, _names(result.robot), spec.velocity.unit)
    if execution is not None:
        panels[f"Joints of {result.robot.name}"] = _robot_joints(execution)
    panels["Joints of the person"] = _joints(fit.arm, np.degrees(fit.joint_angles), PERSON.name, ("°",) * fit.arm.dof)
    slower = execution is not None and execution.tempo != 1.0
    return Motion(
        result.time,
        tuple(body for body, _ in bodies),
        panels,
        _map(result),
        unit=spec.velocity.unit,
        clocks={"robot": 1.0 / execution.tempo} if execution is not None and slower else {},
        legend=_legend(shown) if drawn else {},
        note=_note(spec, execution is not None, *(why for _, why in bodies)),
    )


def _of_execution(execution: Execution) -> Motion:
    motion, robot, spec = execution.motion, execution.robot, execution.motion.spec
    drawn = spec.part != "full"
    shown = {TARGET.name: motion.target, ACHIEVED.name: motion.achieved}
    panels = {NEARNESS: _nearness(execution)}
    if drawn:
        panels[ELLIPSOIDS] = ellipsoid_panels(shown, _names(robot), spec.unit)
    panels[f"Joints of {robot.name}"] = _robot_joints(execution)
    body, why = _robot_body(execution)
    return Motion(
        motion.time,
        (body,),
        panels,
        unit=spec.unit,
        legend=_legend(shown) if drawn else {},
        note=_note(spec, True, why),
    )


def _names(robot: Arm) -> dict[str, str]:
    return {PERSON.name: "person", TARGET.name: "target", ACHIEVED.name: robot.name}


def _legend(shown: Mapping[str, Array]) -> dict[str, str]:
    return {role: ROLES[role].about for role in shown}


def _nearness(execution: Execution) -> tuple[Panel, ...]:
    """Make panels of the distance from target to achieved, the smallest there could be, and the tip's error."""
    motion, floor = execution.motion, execution.best_distance
    lines, meaning = [Line("achieved", motion.distance)], f"As a distance {DISTANCE}"
    if floor is not None:
        lines.append(Line(FLOOR.lower(), floor, TARGET.name, 1))
        meaning += f" {FLOOR}: {FLOOR_MEANING[0].lower()}{FLOOR_MEANING[1:]}"
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


def _robot_joints(execution: Execution) -> tuple[Panel, ...]:
    motion = execution.motion
    return _joints(execution.robot, motion.joint_positions, ACHIEVED.name, motion.joint_units)


def _robot_body(execution: Execution) -> tuple[Body, str]:
    motion = execution.motion
    ellipsoids = (
        {TARGET.name: motion.target, ACHIEVED.name: motion.achieved} if execution.motion.spec.part != "full" else {}
    )
    return body_of(execution.robot, motion.joint_positions, ellipsoids, motion.path)


def _signed(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


def _map(result: TransferResult) -> DomainMap:
    """Domains and profiles as the fit saw them: regularised, since singular ones are infinitely far away."""
    adapter, execution, names = result.adapter, result.execution, _names(result.robot)
    teacher, student = adapter.teacher_side, adapter.student_side
    sides = {PERSON.name: teacher, TARGET.name: student, ACHIEVED.name: student}
    domains = {PERSON.name: result.teacher_domain, ACHIEVED.name: result.student_domain}
    profiles = {PERSON.name: result.demonstrated_profile, TARGET.name: result.target_profile}
    if execution is not None and result.spec.kind == "velocity":
        profiles |= {TARGET.name: execution.motion.target, ACHIEVED.name: execution.motion.achieved}
    return domain_map(
        {role: (names[role], sides[role](points, role)) for role, points in domains.items()},
        {role: (names[role], sides[role](points, role)) for role, points in profiles.items()},
        "Ellipsoids stand here as they were fitted: damped a little, for flat ones are infinitely far from all others.",
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
