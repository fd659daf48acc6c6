"""Content of the page of a result: arms with their ellipsoids, curves and the map of the domains."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from maniport.arms import Arm, EllipsoidSpec, Surface
from maniport.arms.human import middle_of
from maniport.errors import FileFormatError
from maniport.pipeline import LearnedProfile
from maniport.pipeline.results import ArmTransfer, MotionResult, TransferResult
from maniport.report.page.content import STATES, Animation, Body, Cloud, DomainMap, Panel, Part, Stage
from maniport.report.page.panels import alternated, panels_of, panels_of_learned, profiles_of
from maniport.report.roles import ACHIEVED, PERSON, ROLES, TARGET
from maniport.spd.diffusion_map import map_of
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array

TORSO = np.array([
    (-0.02, 0.0, 0.20, -0.02, 0.0, 0.23, 0.09),
    (-0.04, 0.0, 0.00, -0.03, 0.0, 0.10, 0.045),
    (-0.04, -0.16, 0.00, -0.04, 0.16, 0.00, 0.045),
    (-0.06, -0.09, -0.10, -0.06, -0.07, -0.42, 0.07),
    (-0.06, 0.09, -0.10, -0.06, 0.07, -0.42, 0.07),
])  # fmt: skip
"""Rods of head, neck, shoulders and trunk about the middle of the neck: start, end and radius [m]."""


def animation_of(result: TransferResult | MotionResult | LearnedProfile) -> Animation:
    """Return the arms that move in a result, with curves: at demonstrated times, or at those of the robot alone."""
    if isinstance(result, LearnedProfile):
        parts = [panels_of_learned(part) for part in result.each_arm()]
        sides = [str(arm.side) for arm in result.arms]
        curves = {group: alternated([part[group] for part in parts], sides) for group in parts[0]}
        return Animation(result.alignment.time, (), curves, unit=result.spec.unit)
    transfer = result if isinstance(result, TransferResult) else None
    moved = [arm.motion for arm in result.arms if arm.motion is not None]
    time = transfer.time if transfer is not None else moved[0].time
    spec = transfer.spec if transfer is not None else moved[0].spec
    stages, notes, chart = [], [_ellipsoid_note(spec)], None
    if transfer is not None:
        stages.append(_person(transfer.arms, spec, notes))
        if len(transfer.arms) == 1:
            chart = _map(transfer.arms[0], spec, transfer.base_rotation)
    if moved:
        stages.append(_robot(result, spec, notes))
    else:
        notes.append("The robot was not moved.")
    groups: dict[str, list[list[Panel]]] = {}
    for arm in result.arms:
        for group, panels in panels_of(result, arm, spec):
            groups.setdefault(group, []).append(panels)
    order = list(STATES)
    return Animation(
        time,
        tuple(stages),
        {group: alternated(panels, [arm.name for arm in result.arms]) for group, panels in groups.items()},
        chart,
        unit=spec.velocity.unit,
        clocks={"robot": moved[0].time} if transfer is not None and moved else {},
        legend={role: ROLES[role].about for role in profiles_of(result.arms[0], spec)} if spec.part != "full" else {},
        note=" ".join(notes),
        states=tuple(max(worst, key=order.index) for worst in zip(*(one.status for one in moved), strict=True)),
    )


def _person(arms: Sequence[ArmTransfer], spec: EllipsoidSpec, notes: list[str]) -> Stage:
    """Return the arms of the person, about the middle of the neck."""
    bodies = []
    for arm in arms:
        drawn = {PERSON.name: profiles_of(arm, spec)[PERSON.name]} if spec.part != "full" else {}
        body = body_of(arm.fit.arm, arm.fit.joint_angles, drawn, name="Person", notes=notes)
        bodies.append(_shifted(body, np.array([0.0, -middle_of(arm.fit.arm), 0.0])))
    return Stage("Person", tuple(bodies), torso=TORSO)


def _robot(result: TransferResult | MotionResult, spec: EllipsoidSpec, notes: list[str]) -> Stage:
    """Return the arms of the robot; links that several arms share are drawn once."""
    bodies: list[Body] = []
    for arm in result.arms:
        assert arm.motion is not None
        drawn = {TARGET.name: arm.motion.target, ACHIEVED.name: arm.motion.achieved} if spec.part != "full" else {}
        body = body_of(arm.robot, arm.motion.joint_positions, drawn, arm.motion.path, notes=notes)
        drawn_parts = [part for other in bodies for part in other.parts]
        own = tuple(part for part in body.parts if not any(_is_same(part, other) for other in drawn_parts))
        bodies.append(replace(body, parts=own))
    rotation = None
    if isinstance(result, TransferResult):
        placement = result.arms[0].placement
        rotation = result.base_rotation if placement is None else placement.rotation @ result.base_rotation
    return Stage(result.robot.name, tuple(bodies), rotation)


def body_of(
    arm: Arm,
    joint_positions: Array,
    ellipsoids: Mapping[str, Array] | None = None,
    path: Array | None = None,
    name: str | None = None,
    notes: list[str] | None = None,
) -> Body:
    """Return an arm at each time with ellipsoids at its end effector; a note is added if it has no surfaces."""
    body = Body(name or arm.name, arm.skeleton(joint_positions), ellipsoids or {}, path)
    try:
        surfaces = arm.surfaces()
    except FileFormatError as error:  # the page is useful without surfaces
        if notes is not None:
            notes.append(f"{body.name} is drawn as a skeleton: {error}")
        return body
    poses = arm.link_poses(joint_positions)
    return replace(body, parts=tuple(_part(surface, poses[:, surface.joint]) for surface in surfaces))


def _part(surface: Surface, poses: Array) -> Part:
    """Return a surface with each point once, so that the script of the page finds triangles that meet."""
    corners = np.asarray(surface.points, dtype="<f4")[surface.triangles].reshape(-1, 3)
    points, places = np.unique(corners, axis=0, return_inverse=True)
    return Part(points, places.reshape(-1, 3), poses)


def _shifted(body: Body, offset: Array) -> Body:
    pose = np.eye(4)
    pose[:3, 3] = offset
    parts = tuple(replace(part, poses=pose @ part.poses) for part in body.parts)
    return replace(body, skeleton=body.skeleton + offset, parts=parts)


def _is_same(part: Part, other: Part) -> bool:
    """Return whether two surfaces move alike and have the same bounds [m]; they may be simplified differently."""
    first, second = ((one.points.min(axis=0), one.points.max(axis=0)) for one in (part, other))
    return np.allclose(part.poses, other.poses, atol=1e-6) and np.allclose(first, second, atol=0.01)


def _ellipsoid_note(spec: EllipsoidSpec) -> str:
    if spec.part == "full":
        return "Ellipsoids of six dimensions cannot be drawn; their distances can."
    moves = "translates" if spec.part == "translation" else "rotates"
    note = (
        f"An ellipsoid shows how fast the end effector {moves} in each direction at unit joint speed; a semi-axis of "
        f"1 {spec.velocity.unit} is drawn 0.25 m long."
    )
    return note + (" Drawn are the inverses of the force ellipsoids." if spec.kind == "force" else "")


def _map(arm: ArmTransfer, spec: EllipsoidSpec, base_rotation: Array, fitted: int = 40, dots: int = 300) -> DomainMap:
    """Return the map of the domains, regularized as in the fit, in the robot's base frame; fitted to few points."""
    rotation, student = spec.rotation(base_rotation), arm.adapter.student_side
    human, robot = (one[evenly_spaced(len(one), dots)] for one in (arm.teacher_domain, arm.student_domain))
    human, demonstrated = (
        rotation @ arm.adapter.teacher_side(points) @ rotation.T for points in (human, arm.demonstrated_profile)
    )
    domains = {PERSON.name: human, ACHIEVED.name: student(robot)}
    profiles = {PERSON.name: demonstrated, TARGET.name: student(arm.target_profile)}
    chart = map_of([*domains.values(), *profiles.values()], fitted)
    if arm.motion is not None and spec.kind == "velocity":
        placed = np.eye(3) if arm.placement is None else arm.placement.rotation
        back = spec.rotation(placed.T)  # the domain is that of the base before the path was placed
        moved = {TARGET.name: arm.motion.target, ACHIEVED.name: arm.motion.achieved}
        profiles |= {role: student(back @ points @ back.T, role) for role, points in moved.items()}
    names = {PERSON.name: "person", TARGET.name: "target", ACHIEVED.name: arm.robot.name}
    clouds, lines = (
        tuple(Cloud(names[role], role, chart.transform(points), points if points.shape[-1] <= 3 else None)
              for role, points in sets.items())
        for sets in (domains, profiles)
    )  # fmt: skip
    return DomainMap(clouds, lines, "Ellipsoids are regularized as in the fit.")
