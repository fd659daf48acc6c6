"""Content of the page of a result: arms with their ellipsoids, curves and the map of the domains."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.chain import LEFT
from maniport.arms.human import BREADTH
from maniport.arms.restriction import mirrored
from maniport.errors import FileFormatError
from maniport.learning.agreement import axis_deviations
from maniport.pipeline import LearnedProfile, TransferResult
from maniport.pipeline.execution import Execution
from maniport.report.metrics import DEFINITIONS
from maniport.report.page.content import Body, Cloud, DomainMap, Line, Motion, Panel, Part
from maniport.report.roles import ACHIEVED, PERSON, REFERENCE, ROLES, TARGET
from maniport.report.series import Course, courses, map_of
from maniport.spd.ellipsoid import lengths, line_angles
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array

ERRORS, ELLIPSOIDS, HUMAN_JOINTS = "Distance and position error", "Ellipsoids", "Joints of the person"


def motion_of(result: TransferResult | Execution) -> Motion:
    """Return what moves in a result: person and robot with the person's clock, or the robot alone with its own."""
    run = result if isinstance(result, TransferResult) else None
    execution = result.execution if isinstance(result, TransferResult) else result
    source = result.motion if isinstance(result, Execution) else result
    spec, drawn = source.spec, source.spec.part != "full"
    shown: dict[str, Array] = {}
    bodies: list[tuple[Body, str]] = []
    panels: dict[str, tuple[Panel, ...]] = {}
    if run is not None:
        shown[PERSON.name] = velocity_ellipsoids(run.demonstrated_profile, spec)
        person, why = body_of(run.fit.arm, run.fit.joint_angles, dict(shown) if drawn else {}, name="Person")
        bodies.append((replace(person, figure=trunk_and_head(run.fit.arm)), why))
    if execution is not None:
        motion = execution.motion
        followed = {TARGET.name: motion.target, ACHIEVED.name: motion.achieved}
        shown |= followed
        robot, why = body_of(execution.robot, motion.joint_positions, followed if drawn else {}, motion.path)
        bodies.append((robot if run is None else replace(robot, turn=_camera(run)), why))
        panels[ERRORS] = _errors(execution)
    elif run is not None:
        shown[TARGET.name] = velocity_ellipsoids(run.target_profile, spec)
    if drawn:
        names = {PERSON.name: "person", TARGET.name: "target", ACHIEVED.name: result.robot.name}
        panels[ELLIPSOIDS] = ellipsoid_panels(shown, names, spec.velocity.unit)
    if execution is not None:
        joints = _joints(execution.robot, execution.motion.joint_positions, ACHIEVED.name)
        panels[f"Joints of {result.robot.name}"] = joints
    if run is not None:
        panels[HUMAN_JOINTS] = _joints(run.fit.arm, run.fit.joint_angles, PERSON.name)
    distances = [] if execution is None else [execution.motion.distance]
    return Motion(
        source.time,
        tuple(body for body, _ in bodies),
        panels,
        None if run is None else _map(run),
        unit=spec.velocity.unit,
        clocks={"robot": execution.motion.time} if run is not None and execution is not None else {},
        legend={role: ROLES[role].about for role in shown} if drawn else {},
        note=" ".join([_picture(spec), *(["The robot was not moved."] if execution is None else []),
                       *(why for _, why in bodies if why)]),
        states=() if execution is None else execution.motion.status,
        opening=opening_time(source.time, distances, [next(iter(shown.values()))]) if distances else None,
    )  # fmt: skip


def velocity_ellipsoids(profile: Array, spec: EllipsoidSpec) -> Array:
    """Return velocity ellipsoids: the profile, or the inverses of force ellipsoids."""
    return np.asarray(np.linalg.inv(profile)) if spec.kind == "force" else profile


def body_of(
    arm: Arm,
    joint_positions: Array,
    ellipsoids: Mapping[str, Array] | None = None,
    path: Array | None = None,
    name: str | None = None,
) -> tuple[Body, str]:
    """Return an arm at each time with ellipsoids at its end effector, and why it has no surfaces."""
    body = Body(name or arm.name, arm.skeleton(joint_positions), ellipsoids or {}, path)
    try:
        surfaces = arm.surfaces()
    except FileFormatError as error:  # the page is useful without surfaces
        return body, f"{body.name} is drawn as a skeleton: {error}"
    poses = arm.link_poses(joint_positions)
    parts = tuple(Part(one.points, one.triangles, poses[:, one.joint]) for one in surfaces)
    return replace(body, parts=parts), ""


def _camera(result: TransferResult) -> Array:
    """Rotation from the person's trunk frame to the robot's base frame after placement, shape (3, 3)."""
    placement = None if result.execution is None else result.execution.placement
    return result.base_rotation if placement is None else placement.rotation @ result.base_rotation


def opening_time(time: Array, distances: Sequence[Array], profiles: Sequence[Array]) -> float:
    """Find a representative time: of the quarter with distances nearest to the median, the roundest ellipsoid."""
    away = np.sum([np.abs(distance - np.median(distance)) for distance in distances], axis=0)
    semi_axes = np.stack([lengths(one) for one in profiles])
    roundness = (semi_axes[..., 0] / semi_axes[..., -1]).min(axis=0)
    return float(time[np.argmax(np.where(away <= np.quantile(away, 0.25), roundness, -1.0))])


def trunk_and_head(arm: Arm) -> Array:
    """Return rods of a trunk and a head next to a human arm, shape (k, 7): start, end and radius [m]."""
    if arm.side == LEFT:
        figure = trunk_and_head(Arm(mirrored(arm.chain)))
        figure[:, [1, 4]] *= -1.0
        return figure
    corners = arm.skeleton(np.clip(np.zeros(arm.dof), arm.lower, arm.upper))
    right = corners[np.argmin(corners[:, 1] + (corners[:, 2] < -0.15))]  # lower corners hang from the shoulder
    shoulder = max(-float(right[1]), 0.0) or BREADTH
    middle, top = (0.0 if right[1] < 0.0 else BREADTH), float(right[2])
    x = float(right[0]) - 0.02
    rods = [
        (x, middle - 0.6 * shoulder, top - 0.08, x, middle - 0.45 * shoulder, top - 0.42, 0.07),
        (x, middle + 0.6 * shoulder, top - 0.08, x, middle + 0.45 * shoulder, top - 0.42, 0.07),
        (x, middle, top - 0.06, x, middle, top - 0.45, 0.08),
        (x, middle - 0.8 * shoulder, top, x, middle + shoulder, top, 0.045),
        (x, middle, top, x + 0.01, middle, top + 0.1, 0.045),
        (x + 0.02, middle, top + 0.2, x + 0.01, middle, top + 0.23, 0.09),
        (x, middle + 1.15 * shoulder, top - 0.02, x, middle + 1.3 * shoulder, top - 0.3, 0.035),
    ]
    return np.array(rods)


def _picture(spec: EllipsoidSpec) -> str:
    if spec.part == "full":
        return "Ellipsoids of six dimensions cannot be drawn; their distances can."
    moves = "translate" if spec.part == "translation" else "rotate"
    note = (
        f"An ellipsoid shows how fast the end effector can {moves} in each direction at unit joint speed; a semi-axis "
        f"of 1 {spec.velocity.unit} is drawn 0.25 m long. Where the path was rotated, the camera is rotated with it."
    )
    return note + (" Drawn are the inverses of the force ellipsoids." if spec.kind == "force" else "")


def _errors(execution: Execution) -> tuple[Panel, ...]:
    """Return panels of the distance, with its two pointwise references, and of the position error."""
    motion, (title, _, meaning) = execution.motion, DEFINITIONS["distance"]
    lines = (
        Line("achieved", motion.distance),
        Line(DEFINITIONS["pointwise_best"][0].lower(), np.asarray(execution.plan.pointwise_best), REFERENCE.name, 1),
        Line(DEFINITIONS["feasibility_gap"][0].lower(), execution.gap, REFERENCE.name, 2),
    )
    panels = [Panel(title, "", lines, meaning)]
    if motion.position_error is not None:
        title, unit, meaning = DEFINITIONS["tip_error"]
        error = Line("end effector", np.maximum(1e3 * motion.position_error, 1e-2))  # the axis is logarithmic
        panels.append(Panel(title, unit, (error,), meaning, logarithmic=True))
    return tuple(panels)


def _joints(arm: Arm, positions: Array, role: str) -> tuple[Panel, ...]:
    """Return a panel for each joint with its limits; positions (n, dof) [rad or m], angles are drawn in degrees."""
    panels = []
    for k, name in enumerate(arm.joint_names):
        unit, factor = ("°", 180.0 / np.pi) if arm.joint_units[k] == "rad" else (arm.joint_units[k], 1.0)
        low, high = factor * float(arm.lower[k]), factor * float(arm.upper[k])
        line = Line("", factor * np.asarray(positions[:, k], dtype=float), role)
        limits = span = None
        meaning = "No limits."
        if np.isfinite(high - low):
            margin = 0.06 * (high - low)
            limits, span = (low, high), (low - margin, high + margin)
            meaning = f"Limits {low:.3g} and {high:.3g} {unit}.".replace("-", "−")
        panels.append(Panel(name, unit, (line,), meaning, limits=limits, span=span, strip=True))
    return tuple(panels)


def ellipsoid_panels(profiles: Mapping[str, ArrayLike], names: Mapping[str, str], unit: str) -> tuple[Panel, ...]:
    """Return panels of each semi-axis of profiles by role, and of the angles between target and achieved axes."""
    found = courses({role: np.asarray(points) for role, points in profiles.items()})
    d = next(iter(found.values())).semi_axes.shape[1]
    order = ("Longest", "Middle", "Shortest") if d == 3 else ("Longest", "Shortest")
    panels = _axis_angles(found)
    for k, word in enumerate(order):
        lines = tuple(Line(names[role], one.semi_axes[:, d - 1 - k], role, wide=role == TARGET.name and len(found) > 1)
                      for role, one in found.items())  # fmt: skip
        panels.append(Panel(f"{word} semi-axis", unit, lines))
    return tuple(panels)


def _axis_angles(found: Mapping[str, Course]) -> list[Panel]:
    if not {TARGET.name, ACHIEVED.name} <= set(found):
        return []
    target, achieved = found[TARGET.name], found[ACHIEVED.name]
    angles = {"longest axis": (target.longest, achieved.longest), "shortest axis": (target.shortest, achieved.shortest)}
    lines = tuple(
        Line(name, np.degrees(line_angles(*pair)), ACHIEVED.name, k) for k, (name, pair) in enumerate(angles.items())
    )
    meaning = "Between target and achieved. A line breaks where two axes have one length."
    return [Panel("Angle between the axes", "°", lines, meaning, span=(0.0, 90.0))]


def regularized(result: TransferResult) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return domains and profiles of a run by role, regularized as in the fit, in the robot's base frame."""
    rotation, student = result.spec.rotation(result.base_rotation), result.adapter.student_side

    def teacher(points: Array) -> Array:
        return np.asarray(rotation @ result.adapter.teacher_side(points) @ rotation.T)

    domains = {PERSON.name: teacher(result.teacher_domain), ACHIEVED.name: student(result.student_domain)}
    profiles = {PERSON.name: teacher(result.demonstrated_profile), TARGET.name: student(result.target_profile)}
    return domains, profiles


def _map(result: TransferResult, fitted: int = 40, dots: int = 300) -> DomainMap:
    """Return the map of a run, fitted to few points such that it takes less than 0.2 s."""
    domains, profiles = regularized(replace(
        result, teacher_domain=result.teacher_domain[evenly_spaced(len(result.teacher_domain), dots)],
        student_domain=result.student_domain[evenly_spaced(len(result.student_domain), dots)],
    ))  # fmt: skip
    chart = map_of([*domains.values(), *profiles.values()], fitted)
    execution, gap = result.execution, None
    if execution is not None and result.spec.kind == "velocity":
        placed = np.eye(3) if execution.placement is None else execution.placement.rotation
        back = result.spec.rotation(placed.T)  # the domain is that of the base before the path was placed
        found = {TARGET.name: execution.motion.target, ACHIEVED.name: execution.motion.achieved}
        profiles |= {role: result.adapter.student_side(back @ points @ back.T, role) for role, points in found.items()}
        gap = execution.gap
    names = {PERSON.name: "person", TARGET.name: "target", ACHIEVED.name: result.robot.name}
    clouds = [Cloud(names[role], role, chart.transform(points), points) for role, points in domains.items()]
    lines = [Cloud(names[role], role, chart.transform(points), points, gap if role == TARGET.name else None)
             for role, points in profiles.items()]  # fmt: skip
    return DomainMap(tuple(clouds), tuple(lines), "Ellipsoids are regularized as in the fit.")


def motion_of_learned(learned: LearnedProfile) -> Motion:
    """Return the curves of demonstrations and of the profile that is learned from them, on common times."""
    time, deviations = learned.alignment.time, axis_deviations(learned.profile, learned.covariance)
    semi_axes, each = lengths(learned.profile), lengths(learned.alignment.ellipsoids)
    d, unit, odd = semi_axes.shape[1], learned.spec.unit, learned.agreement.outlier

    def panel(title: str, unit: str, several: Array, values: Array, deviation: Array | None = None) -> Panel:
        lines = [Line(name, one, REFERENCE.name if k == odd else PERSON.name, 1 if k == odd else 2)
                 for k, (name, one) in enumerate(zip(learned.names, several, strict=True))]  # fmt: skip
        factors: list[tuple[str, Any, int]] = [("learned", 1.0, 0)]
        if deviation is not None:
            factors += [("+ 1 deviation", np.exp(deviation), 1), ("− 1 deviation", np.exp(-deviation), 1)]
        lines += [Line(name, np.interp(time, learned.time, values * factor), ACHIEVED.name, style)
                  for name, factor, style in factors]  # fmt: skip
        return Panel(title, unit, tuple(lines))

    axes = [
        panel(f"Semi-axis {d - k}", unit, each[..., k], semi_axes[:, k], deviations[:, k]) for k in reversed(range(d))
    ]
    hand = [panel(f"Hand, {name}", "m", learned.paths[..., k], learned.path[:, k])
            for k, name in enumerate(("x forward", "y left", "z up"))]  # fmt: skip
    return Motion(time, (), {"Learned ellipsoids": tuple(axes), "Learned path": tuple(hand)}, unit=unit)
