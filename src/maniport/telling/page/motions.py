"""The moving part of a page: arms with their ellipsoids, curves and the map of the domains."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from maniport.bodies import Arm, EllipsoidSpec
from maniport.bodies.chain import LEFT
from maniport.bodies.human import BREADTH
from maniport.bodies.mirroring import mirrored
from maniport.defaults import DAMPING
from maniport.errors import FileFormatError, ManiportError
from maniport.pipeline import TransferResult
from maniport.pipeline.execution import Execution
from maniport.spd.ellipsoid import lengths
from maniport.subsample import evenly_spaced
from maniport.telling.diffusion import DOTS, DiffusionMap, map_of
from maniport.telling.of_motion import DISTANCE, FLOOR, GAP, GAP_MEANING, TOGETHER
from maniport.telling.page.content import Body, DomainMap, Line, Motion, Panel, Part
from maniport.telling.page.profiles import domain_map, ellipsoid_panels
from maniport.telling.roles import ACHIEVED, PERSON, REFERENCE, ROLES, TARGET
from maniport.tracking import feasibility_gap
from maniport.validation import Array

ELLIPSOIDS, NEARNESS, PERSONS_JOINTS = "Ellipsoids", "How near the robot comes", "Joints of the person"
USUAL = 0.25
"""The page opens at one of so many of the moments, those whose distance is nearest to the median."""
LEAST_ERROR = 1e-2
"""Smaller errors of the tip are drawn as this [mm]: the axis is logarithmic."""
LOW = -0.15
"""Corners below this hang from the shoulder [m]."""
EDGE = 0.06
"""How far beyond a joint's limits its panel reaches, as a part of its range."""


def motion_of(result: TransferResult | Execution, found: "Charted | None" = None) -> Motion:
    """Show what moves in a result: person and robot under the person's clock, or the robot alone under its own."""
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
        person, why = body_of(run.fit.arm, run.fit.joint_angles, at_hand, name="Person")
        bodies.append((replace(person, figure=trunk_and_head(run.fit.arm)), why))
    if execution is not None:
        motion = execution.motion
        followed = {TARGET.name: motion.target, ACHIEVED.name: motion.achieved}
        shown |= followed
        robot, why = body_of(execution.robot, motion.joint_positions, followed if drawn else {}, motion.path)
        bodies.append((robot if run is None else replace(robot, turn=turn_of(run)), why))
        panels[NEARNESS] = _nearness(execution)
    elif run is not None:
        shown[TARGET.name] = _velocity(run.target_profile, spec)
        if gap := _gap_lines(_gap_of_target(run)):
            panels[NEARNESS] = (Panel(GAP, "", gap, f"{GAP_MEANING} As a distance {DISTANCE}"),)
    if drawn:
        panels[ELLIPSOIDS] = ellipsoid_panels(shown, _names(result.robot), spec.velocity.unit)
    if execution is not None:
        joints = _joints(execution.robot, execution.motion.joint_positions, ACHIEVED.name)
        panels[robots_joints(result.robot)] = joints
    if run is not None:
        panels[PERSONS_JOINTS] = _joints(run.fit.arm, run.fit.joint_angles, PERSON.name)
    return Motion(
        asked.time,
        tuple(body for body, _ in bodies),
        panels,
        None if run is None else _map(run, found or charted(*seen(run))),
        unit=spec.velocity.unit,
        clocks={"robot": execution.motion.time} if run is not None and execution is not None else {},
        legend={role: ROLES[role].about for role in shown} if drawn else {},
        note=_note(spec, execution is not None, *(why for _, why in bodies)),
        states=() if execution is None else execution.motion.status,
        opening=None if execution is None else opening(asked.time, [execution.motion.distance], [first(shown)]),
    )


def robots_joints(robot: Arm) -> str:
    """What the panels of a robot's joints are about."""
    return f"Joints of {robot.name}"


def turn_of(result: TransferResult) -> Array:
    """Rotation from the person's trunk frame to the one in which the robot's motion is, shape (3, 3)."""
    placement = None if result.execution is None else result.execution.placement
    return result.mounting if placement is None else placement.rotation @ result.mounting


def first(profiles: Mapping[str, Array]) -> Array:
    """The ellipsoids of the first role that there is."""
    return next(iter(profiles.values()))


def opening(time: Array, distances: Sequence[Array], profiles: Sequence[Array]) -> float:
    """Find a moment as good as most, at which much is to be seen: where it is near the median, the roundest."""
    away = np.sum([np.abs(distance - np.median(distance)) for distance in distances], axis=0)
    semi_axes = np.stack([lengths(one) for one in profiles])
    roundness = (semi_axes[..., 0] / semi_axes[..., -1]).min(axis=0)
    return float(time[np.argmax(np.where(away <= np.quantile(away, USUAL), roundness, -1.0))])


def trunk_and_head(arm: Arm) -> Array:
    """Rods of a trunk and a head beside a person's arm, shape (k, 7): what `Body` calls its figure."""
    if arm.side == LEFT:
        figure = trunk_and_head(Arm(mirrored(arm.chain)))
        figure[:, [1, 4]] *= -1.0
        return figure
    corners = arm.skeleton(np.clip(np.zeros(arm.dof), arm.lower, arm.upper))
    right = corners[np.argmin(corners[:, 1] + (corners[:, 2] < LOW))]
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


def body_of(
    arm: Arm,
    joint_positions: Array,
    ellipsoids: Mapping[str, Array] | None = None,
    path: Array | None = None,
    name: str | None = None,
) -> tuple[Body, str]:
    """Draw an arm at each time, with ellipsoids at its tip."""
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
    lines = [Line("achieved", motion.distance), Line(FLOOR.lower(), execution.plan.node_floor, REFERENCE.name, 1)]
    lines += _gap_lines(execution.gap)
    meaning = f"{DISTANCE} {FLOOR}: the smallest found with the tip on its path; {GAP.lower()}: wherever the tip is."
    panels = [Panel("Distance from target to achieved", "", tuple(lines), meaning)]
    if motion.position_error is not None:
        error = Line("tip", np.maximum(1e3 * motion.position_error, LEAST_ERROR))
        panels.append(Panel("Tip beside its path", "mm", (error,), TOGETHER, logarithmic=True))
    return tuple(panels)


def _gap_lines(gap: Array | None) -> tuple[Line, ...]:
    return () if gap is None else (Line(GAP.lower(), gap, REFERENCE.name, 2),)


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


def _joints(arm: Arm, positions: Array, role: str) -> tuple[Panel, ...]:
    """Make a panel for each joint, its limits shaded; positions (n, dof) [rad or m], angles are shown in degrees."""
    panels = []
    for k, name in enumerate(arm.joint_names):
        unit, factor = ("°", 180.0 / np.pi) if arm.joint_units[k] == "rad" else (arm.joint_units[k], 1.0)
        low, high = factor * float(arm.lower[k]), factor * float(arm.upper[k])
        line = Line("", factor * np.asarray(positions[:, k], dtype=float), role)
        if np.isfinite(high - low):
            margin = EDGE * (high - low)
            limits, span = (low, high), (low - margin, high + margin)
            meaning = f"Limits {_signed(low)} and {_signed(high)}; what is beyond them is shaded."
            panels.append(Panel(name, unit, (line,), meaning, limits=limits, span=span, strip=True))
        else:
            panels.append(Panel(name, unit, (line,), "No limits.", strip=True))
    return tuple(panels)


def _signed(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


class Charted(NamedTuple):
    """Domains and profiles of a run by role, as the fit saw them: regularised; and the map that is fitted to them.

    `places` are the coordinates of the domains' ellipsoids there, of `DOTS` of them at most, evenly.
    """

    domains: dict[str, Array]
    profiles: dict[str, Array]
    chart: DiffusionMap
    places: dict[str, Array]


def seen(result: TransferResult) -> tuple[dict[str, Array], dict[str, Array]]:
    """Domains and profiles of a run by role, regularised, since singular ellipsoids are infinitely far away."""
    at = result.spec.rotation(result.mounting)  # all stand in the frame of the robot's base
    student = result.adapter.student_side

    def teacher(points: Array) -> Array:
        return np.asarray(at @ result.adapter.teacher_side(points) @ at.T)

    domains = {PERSON.name: teacher(result.teacher_domain), ACHIEVED.name: student(result.student_domain)}
    profiles = {PERSON.name: teacher(result.demonstrated_profile), TARGET.name: student(result.target_profile)}
    return domains, profiles


def charted(domains: dict[str, Array], profiles: dict[str, Array]) -> Charted:
    """Fit a map to domains and profiles, and place the domains there."""
    chart = map_of([*domains.values(), *profiles.values()])
    places = {role: chart.transform(points[evenly_spaced(len(points), DOTS)]) for role, points in domains.items()}
    return Charted(domains, profiles, chart, places)


def _map(result: TransferResult, on_map: Charted) -> DomainMap:
    """Make the map of a run, with what the robot was asked for at its place and what it achieves."""
    execution, names, profiles = result.execution, _names(result.robot), dict(on_map.profiles)
    gap = None
    if execution is not None and result.spec.kind == "velocity":
        placed = np.eye(3) if execution.placement is None else execution.placement.rotation
        back = result.spec.rotation(placed.T)  # the domain is that of the base as it was before the path was placed
        found = {TARGET.name: execution.motion.target, ACHIEVED.name: execution.motion.achieved}
        profiles |= {role: result.adapter.student_side(back @ points @ back.T, role) for role, points in found.items()}
        gap = execution.gap
    return domain_map(
        {role: (names[role], points) for role, points in on_map.domains.items()},
        {role: (names[role], points) for role, points in profiles.items()},
        "Ellipsoids stand here as they were fitted: damped a little, for flat ones are infinitely far from all others.",
        on_map.chart,
        gap,
        on_map.places,
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
        f"one scale, and alike looks alike: where the path was turned, so is the camera."
    )
    if spec.kind == "force":
        note += " Force ellipsoids were transferred; their inverses, the velocity ellipsoids, are drawn."
    return note


def _velocity(profile: Array, spec: EllipsoidSpec) -> Array:
    """Velocity ellipsoids: these, or the inverses of force ellipsoids."""
    return np.asarray(np.linalg.inv(profile)) if spec.kind == "force" else profile
