"""Content of the page of a result: arms with their ellipsoids and curves over time."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from maniport.arms import Arm, EllipsoidSpec, Surface
from maniport.arms.human import middle_of
from maniport.errors import FileFormatError
from maniport.evaluation import Capability
from maniport.learning.alignment import axis_deviations
from maniport.motion import ArmMotion
from maniport.pipeline import LearnedProfile
from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult
from maniport.report.describe.motions import ALONG, STATISTICS
from maniport.report.page.content import (
    ACHIEVED,
    HUMAN_JOINTS,
    LONGEST_ARROW,
    PERSON,
    REFERENCE,
    STATES,
    TARGET,
    Animation,
    Arrow,
    ArrowKind,
    Body,
    Line,
    Panel,
    Part,
    Stage,
)
from maniport.spd.ellipsoid import lengths
from maniport.util.validation import Array

TORSO = np.array(
    [
        (-0.02, 0.0, 0.20, -0.02, 0.0, 0.23, 0.09),
        (-0.04, 0.0, 0.00, -0.03, 0.0, 0.10, 0.045),
        (-0.04, -0.16, 0.00, -0.04, 0.16, 0.00, 0.045),
        (-0.06, -0.09, -0.10, -0.06, -0.07, -0.42, 0.07),
        (-0.06, 0.09, -0.10, -0.06, 0.07, -0.42, 0.07),
    ]
)
"""Rods of head, neck, shoulders and trunk about the middle of the neck: start, end and radius [m]."""

MEANINGS = {
    "velocity": "An ellipsoid shows how fast the end effector {} in each direction at {}.",
    "force": "Drawn are the inverses of the force ellipsoids: they are long in directions in which the arm is weak.",
}

UNITS = {"force": "N", "velocity": "m/s"}
"""Units of capabilities by kind."""

USUAL_ARROW = 0.4  # Largest length of an arrow, but for 5 % of the values [m]
ARROW_STEP = 0.1  # Length that a round value has [m]


def animation_of(result: TransferResult | MotionResult | LearnedProfile) -> Animation:
    """Return the arms that move in a result, with curves: at demonstrated times, or at those of the robot alone."""
    if isinstance(result, LearnedProfile):
        return _animation_of_learned(result)
    spec = result.arms[0].spec
    moved = [arm.motion for arm in result.arms if arm.motion is not None]
    notes = _notes(spec)
    persons = []
    for arm in result.arms:
        if isinstance(arm, ArmTransfer):
            persons.append(_person(arm, spec, _rotation(result, arm)))
    stages = []
    if persons:
        stages.append(Stage("Person", tuple(persons), torso=TORSO))
    if moved:
        stages.append(_robot(result, spec, notes))
    else:
        notes.append("The robot was not moved.")
    arrows = _arrow_kinds(result)
    notes += _notes_of_arrows(result, arrows)

    clocks = {}
    if isinstance(result, TransferResult):
        time = result.time
        if moved:
            clocks["robot"] = moved[0].time
    else:
        time = moved[0].time
    return Animation(
        time,
        tuple(stages),
        _curves(result, spec),
        unit=spec.bounded.unit,
        arrows=arrows,
        clocks=clocks,
        note=" ".join(notes),
        states=_worst_states(moved),
    )


def _animation_of_learned(result: LearnedProfile) -> Animation:
    """Return the curves of a learned profile; nothing moves."""
    topics: dict[str, list[Sequence[Panel]]] = {}
    for learned in result.each_arm():
        for topic, panels in _panels_of_learned(learned).items():
            topics.setdefault(topic, []).append(panels)
    sides = [str(arm.side) for arm in result.arms]
    curves = {}
    for topic, panels_of_arms in topics.items():
        curves[topic] = _alternated(panels_of_arms, sides)
    return Animation(result.alignment.time, (), curves, unit=result.config.spec.unit)


def _notes(spec: EllipsoidSpec) -> list[str]:
    """Return what ellipsoids show, and how large they are drawn."""
    if spec.part == "full":
        return ["Ellipsoids of six dimensions cannot be drawn; their distances can."]
    moves = "rotates"
    if spec.part == "translation":
        moves = "translates"
    speed = "the joint speeds of its weights"
    if spec.joint_weights is None:
        speed = "unit joint speed"
    return [
        MEANINGS[spec.kind].format(moves, speed),
        f"A semi-axis of 1 {spec.bounded.unit} is drawn 0.25 m long.",
    ]


def _curves(
    result: TransferResult | MotionResult, spec: EllipsoidSpec
) -> dict[str, tuple[Panel, ...]]:
    """Return the panels of all arms by topic."""
    topics: dict[str, list[list[Panel]]] = {}
    for arm in result.arms:
        for topic, panels in panels_of(result, arm, spec):
            topics.setdefault(topic, []).append(panels)
    names = [arm.name for arm in result.arms]
    curves = {}
    for topic, panels_of_arms in topics.items():
        curves[topic] = _alternated(panels_of_arms, names)
    return curves


def _worst_states(motions: Sequence[ArmMotion]) -> tuple[str, ...]:
    """Return the worst state of all arms at each time."""
    order = list(STATES)
    statuses = [motion.status for motion in motions]
    states = []
    for of_arms in zip(*statuses, strict=True):
        states.append(max(of_arms, key=order.index))
    return tuple(states)


def _capabilities(arm: ArmResult) -> tuple[Capability, ...]:
    """Return force and speed of an arm along lines; none of a motion without a person."""
    return arm.capabilities if isinstance(arm, ArmTransfer) else ()


def _rotation(result: TransferResult | MotionResult, arm: ArmResult) -> Array | None:
    """Return the rotation (3, 3) from the person's trunk frame to the base frame, of an arm of a transfer."""
    if not isinstance(result, TransferResult):
        return None
    rotation = result.config.known_rotation
    if rotation is None and isinstance(arm, ArmTransfer):
        rotation = arm.adapter.map_rotation_[:3, :3]
    assert rotation is not None
    if arm.placement is None:
        return rotation
    return np.asarray(arm.placement.rotation @ rotation)


def _arrow_kinds(result: TransferResult | MotionResult) -> dict[str, ArrowKind]:
    """Return the quantities of arrows, each with a scale that suits all arms of person and robot at all times."""
    values: dict[str, list[Array]] = {}
    titles: dict[str, str] = {}
    for arm in result.arms:
        for capability in _capabilities(arm):
            values.setdefault(capability.kind, []).extend(_known_values(capability))
            titles[capability.kind] = _title_of_capability(capability)
    kinds = {}
    for kind, parts in values.items():
        joined = np.concatenate(parts)
        usual = float(np.percentile(joined, 95)) if len(joined) else 0.0
        size = ARROW_STEP / _round_above(usual * ARROW_STEP / USUAL_ARROW)
        kinds[kind] = ArrowKind(titles[kind], UNITS[kind], size)
    return kinds


def _title_of_capability(capability: Capability) -> str:
    """Return what is shown along which lines, as in the summary."""
    name = "Force" if capability.kind == "force" else "Speed"
    return f"{name} {ALONG[capability.along][capability.kind]}"


def _known_values(capability: Capability) -> list[Array]:
    """Return the finite values of a capability that arrows show."""
    known = []
    for values in (capability.robot, capability.position_only, capability.person):
        if values is not None:
            known.append(values[np.isfinite(values)])
    return known


def _round_above(value: float) -> float:
    """Return the smallest of 1, 2 and 5 times a power of ten that is not below a value; 1 for values of 0."""
    if value <= 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    for factor in (1, 2, 5):
        if factor * power >= value:
            return float(factor * power)
    return float(10 * power)


def _notes_of_arrows(
    result: TransferResult | MotionResult, kinds: Mapping[str, ArrowKind]
) -> list[str]:
    """Return what the arrows mean and how long they are."""
    if not kinds:
        return []
    scales = " or ".join(f"{ARROW_STEP / kind.size:g} {kind.unit}" for kind in kinds.values())
    notes = [
        "Arrows at the hands show force and speed along the lines of the panels below.",
        f"From the hand to a head, {ARROW_STEP:g} m stand for {scales}.",
    ]
    is_cut = False
    for arm in result.arms:
        for capability in _capabilities(arm):
            kind = kinds[capability.kind]
            for values in _known_values(capability):
                is_cut |= bool(np.any(values * kind.size > kind.longest))
    if is_cut:
        notes.append(f"Longer arrows than {LONGEST_ARROW:g} m are cut; their numbers hold.")
    if "velocity" in kinds:
        notes.append(
            "For speed the person has a line without heads: human arms have no speed limits here."
        )
    return notes


def _arrows_of_person(arm: ArmTransfer, rotation: Array | None) -> tuple[Arrow, ...]:
    """Return the person's force, and the line of the speed, in the trunk frame."""
    assert rotation is not None
    arrows = []
    for capability in arm.capabilities:
        lines = capability.lines @ rotation
        arrows.append(Arrow(capability.kind, PERSON.name, lines, capability.person))
    return tuple(arrows)


def _arrows_of_robot(arm: ArmResult) -> tuple[Arrow, ...]:
    """Return force and speed of a motion and, dashed, of the one through the positions alone."""
    arrows = []
    for capability in _capabilities(arm):
        kind = capability.kind
        lines = capability.lines
        arrows.append(Arrow(kind, ACHIEVED.name, lines, capability.robot))
        if capability.position_only is not None:
            reference = capability.position_only
            arrows.append(Arrow(kind, REFERENCE.name, lines, reference, dashed=True))
    return tuple(arrows)


def _person(arm: ArmTransfer, spec: EllipsoidSpec, rotation: Array | None) -> Body:
    """Return an arm of the person, about the middle of the neck."""
    model = arm.fit.arm
    neck = np.array([0.0, middle_of(model), 0.0])
    skeleton = model.skeleton(arm.fit.joint_angles) - neck
    profiles = _profiles_of(arm, spec)
    drawn = {}
    if PERSON.name in profiles:
        drawn[PERSON.name] = profiles[PERSON.name]
    return Body("Person", skeleton, drawn, arrows=_arrows_of_person(arm, rotation))


def _robot(result: TransferResult | MotionResult, spec: EllipsoidSpec, notes: list[str]) -> Stage:
    """Return the arms of the robot; links that several arms share are drawn once."""
    bodies: list[Body] = []
    motions = [arm.motion for arm in result.arms if arm.motion is not None]
    robots = [arm.robot for arm in result.arms]
    first = [motion.joint_positions[0] for motion in motions]
    surfaces, reason = surfaces_of(robots, first)
    if reason:  # the page is useful without surfaces
        notes.append(f"{result.robot.name} is drawn as a skeleton: {reason}.")
    for arm, motion, surfaces_of_arm in zip(result.arms, motions, surfaces, strict=True):
        poses = arm.robot.link_poses(motion.joint_positions)
        skeleton = arm.robot.skeleton(motion.joint_positions)
        parts = []
        for surface in surfaces_of_arm:
            parts.append(Part(*_joined(surface), poses[:, surface.joint]))
        drawn = _profiles_of(arm, spec)
        drawn.pop(PERSON.name, None)
        arrows = _arrows_of_robot(arm)
        body = Body(arm.robot.name, skeleton, drawn, motion.path, tuple(parts), arrows)
        bodies.append(body)
    rotation = _rotation(result, result.arms[0])
    note = _note_of_placement(result.arms[0], rotation)
    return Stage(result.robot.name, tuple(bodies), rotation, note=note)


def _note_of_placement(arm: ArmResult, rotation: Array | None) -> str:
    """Return in which size and rotation the robot has the person's path, and what it means for the camera."""
    sentences = []
    if arm.placement is not None and arm.motion is not None and arm.motion.path is not None:
        scale = f"{arm.placement.scale:.2f}"
        owner = "person's" if arm.teacher is None else "teacher's"
        sentences.append(f"Path scale: the robot's path has {scale} times the size of the {owner}.")
    if rotation is not None:
        angle = round(float(np.degrees(Rotation.from_matrix(rotation).magnitude())))
        if angle:
            sentences.append(
                f"Camera: the placement rotates the path by {angle}°, and this camera with it,"
                " so that both views show the motion from the same side."
            )
    return " ".join(sentences)


def _joined(surface: Surface) -> tuple[Array, NDArray[np.integer]]:
    """Return points and triangles with each point once, so that the script of the page finds triangles that meet."""
    corners = np.asarray(surface.points, dtype="<f4")[surface.triangles].reshape(-1, 3)
    points, places = np.unique(corners, axis=0, return_inverse=True)
    return points, places.reshape(-1, 3)


def surfaces_of(
    arms: Sequence[Arm], configurations: Sequence[Array]
) -> tuple[list[list[Surface]], str]:
    """Return the surfaces of each arm of a robot, those that arms share once, or none and the reason in one line.

    Surfaces of two arms with one pose at their configurations (dof,) and bounds that differ by less than 1 cm are the
    same; they may be simplified differently.
    """
    chosen = list[list[Surface]]()
    before = list[Array]()
    for arm, q in zip(arms, configurations, strict=True):
        try:
            surfaces = arm.surfaces()
            reason = f"the description of {arm.name} names no shapes"
        except FileFormatError as error:
            surfaces = ()
            reason = " ".join(str(error).split())
        if not surfaces:
            return [[] for _ in arms], reason
        poses = arm.link_poses(q)
        looks = []
        new = []
        for surface in surfaces:
            corners = (surface.points.min(axis=0), surface.points.max(axis=0))
            look = np.concatenate([poses[surface.joint].ravel(), *corners])
            looks.append(look)
            if not any(np.abs(look - other).max() < 0.01 for other in before):
                new.append(surface)
        chosen.append(new)
        before += looks
    return chosen, ""


def _profiles_of(arm: ArmResult, spec: EllipsoidSpec) -> dict[str, Array]:
    """Return velocity ellipsoids of an arm by role, none of six dimensions; those of force are the inverses."""
    profiles: dict[str, Array] = {}
    if spec.part == "full":
        return profiles
    if isinstance(arm, ArmTransfer):
        profiles = {PERSON.name: arm.demonstrated_profile, TARGET.name: arm.target_profile}
        if spec.kind == "force":
            for role, profile in profiles.items():
                profiles[role] = np.asarray(np.linalg.inv(profile))
    if arm.motion is not None:
        profiles |= {TARGET.name: arm.motion.target, ACHIEVED.name: arm.motion.achieved}
    return profiles


def panels_of(
    result: TransferResult | MotionResult, arm: ArmResult, spec: EllipsoidSpec
) -> Iterator[tuple[str, list[Panel]]]:
    """Yield panels of curves of an arm by topic."""
    motion = arm.motion
    capabilities = _capabilities(arm)
    if capabilities:
        yield "Force and speed", list(map(capability_panel, capabilities))
    if motion is not None:
        yield "Distance and position error", _error_panels(motion)
    profiles = _profiles_of(arm, spec)
    if profiles:
        panels = semi_axis_panels(profiles, spec.bounded.unit)
        if motion is not None:
            panels.insert(0, _angle_panel(arm, spec))
        yield "Ellipsoids", panels
    if motion is not None:
        robot = result.robot
        names = [robot.joint_names[column] for column in robot.columns[result.arms.index(arm)]]
        shared = []
        unshared = []
        for panel in _joints(arm.robot, motion.joint_positions, ACHIEVED.name, names):
            if panel.title in robot.shared:
                shared.append(panel)
            else:
                unshared.append(panel)
        if robot.shared and arm is result.arms[0]:
            yield f"Shared joints of {robot.name}", shared
        yield f"Joints of {robot.name}", unshared
    if isinstance(arm, ArmTransfer):
        person = arm.fit.arm
        yield (
            HUMAN_JOINTS,
            _joints(person, arm.fit.joint_angles, PERSON.name, person.joint_names),
        )


def _error_panels(motion: ArmMotion) -> list[Panel]:
    """Return panels of the distance to the targets, and of the position error where there is a path."""
    lines = [Line("achieved", motion.distance)]
    best = motion.pointwise_best
    if best is not None and not np.array_equal(best, motion.distance):
        lines.append(Line("best pointwise distance found", best, REFERENCE.name, 1))
    label, unit, meaning = STATISTICS["distance"]
    panels = [Panel(label, unit, tuple(lines), meaning)]
    if motion.position_error is not None:
        # the axis is logarithmic
        line = Line("end effector", np.maximum(1e3 * motion.position_error, 1e-2))
        tolerance = np.full(len(motion.time), 1e3 * motion.position_tolerance)
        lines = [line, Line("tolerance", tolerance, REFERENCE.name, 1)]
        label, unit, meaning = STATISTICS["position_error"]
        panels.append(Panel(label, unit, tuple(lines), meaning, logarithmic=True))
    return panels


def _angle_panel(arm: ArmResult, spec: EllipsoidSpec) -> Panel:
    """Return a panel of the angle between the longest axes of target and achieved ellipsoids."""
    angle = Line("longest axis", np.degrees(arm.major_axis_angle))
    meaning = "Between target and achieved. The line breaks where two axes have one length."
    if spec.kind == "force":
        meaning += " The longest axes of force are the shortest ones of the drawn inverses."
    title = STATISTICS["major_axis_angle"][0]
    return Panel(title, "°", (angle,), meaning, span=(0.0, 90.0))


def capability_panel(capability: Capability) -> Panel:
    """Return a panel of force or speed along the person's lines, of the motion and of those to compare it with."""
    lines = [Line("robot", capability.robot)]
    if capability.position_only is not None:
        lines.append(Line("positions only", capability.position_only, REFERENCE.name, 1))
    if capability.person is not None:
        lines.append(Line("person", capability.person, PERSON.name))
    title = _title_of_capability(capability)
    unit = UNITS[capability.kind]
    meaning = "In the weaker sense of the line, within the limits of all joints."
    return Panel(title, unit, tuple(lines), meaning)


def _alternated(panels: Sequence[Sequence[Panel]], names: Sequence[str]) -> tuple[Panel, ...]:
    """Alternate panels of arms and name the arm in titles."""
    if len(panels) == 1:
        return tuple(panels[0])
    alternated = []
    for row in zip_longest(*panels):
        for name, panel in zip(names, row, strict=True):
            if panel is not None:
                title = f"{name.capitalize()}: {panel.title}"
                alternated.append(replace(panel, title=title))
    return tuple(alternated)


def _joints(arm: Arm, positions: Array, role: str, names: Sequence[str]) -> list[Panel]:
    """Return a panel for each joint with its limits; positions (n, dof) [rad or m], angles are drawn in degrees."""
    panels = []
    for k, name in enumerate(names):
        unit = arm.joint_units[k]
        factor = 1.0
        if unit == "rad":
            unit = "°"
            factor = 180.0 / np.pi
        low = factor * float(arm.lower[k])
        high = factor * float(arm.upper[k])
        line = Line("", factor * positions[:, k], role)
        panel = Panel(name, unit, (line,), "No limits.", strip=True)
        if np.isfinite(high - low):
            margin = 0.06 * (high - low)
            meaning = f"Limits {low:.3g} and {high:.3g} {unit}.".replace("-", "−")
            span = (low - margin, high + margin)
            panel = replace(panel, meaning=meaning, limits=(low, high), span=span)
        panels.append(panel)
    return panels


def semi_axis_panels(profiles: Mapping[str, Array], unit: str) -> list[Panel]:
    """Return panels of each semi-axis of profiles (n, d, d) by role, the longest first."""
    curves = {role: lengths(profile)[:, ::-1] for role, profile in profiles.items()}
    d = next(iter(curves.values())).shape[1]
    words = ("Longest", "Middle", "Shortest") if d == 3 else ("Longest", "Shortest")
    panels = []
    for k, word in enumerate(words):
        lines = []
        for role, semi_axes in curves.items():
            wide = role == TARGET.name and len(curves) > 1
            lines.append(Line(role, semi_axes[:, k], role, wide=wide))
        panels.append(Panel(f"{word} semi-axis", unit, tuple(lines)))
    return panels


def _panels_of_learned(learned: LearnedProfile) -> dict[str, tuple[Panel, ...]]:
    """Return the curves of demonstrations and of the profile that is learned from them."""
    deviations = axis_deviations(learned.profile, learned.covariance)
    semi_axes = lengths(learned.profile)
    demonstrated = lengths(learned.alignment.ellipsoids)
    d = semi_axes.shape[1]
    unit = learned.config.spec.unit
    axis_panels = []
    for k in reversed(range(d)):
        values = semi_axes[:, k]
        factor = np.exp(deviations[:, k])
        curves = {
            "learned": values,
            "+ 1 deviation": values * factor,
            "− 1 deviation": values / factor,
        }
        lines = _demonstrated_lines(learned, demonstrated[..., k])
        lines += _learned_lines(learned, curves)
        axis_panels.append(Panel(f"Semi-axis {d - k}", unit, tuple(lines)))

    hand_panels = []
    for k, name in enumerate(("x forward", "y left", "z up")):
        lines = _demonstrated_lines(learned, learned.paths[..., k])
        lines += _learned_lines(learned, {"learned": learned.path[:, k]})
        hand_panels.append(Panel(f"Hand, {name}", "m", tuple(lines)))
    return {"Learned ellipsoids": tuple(axis_panels), "Learned path": tuple(hand_panels)}


def _demonstrated_lines(learned: LearnedProfile, curves: Array) -> list[Line]:
    """Return a line for each demonstration (m, n); that of an outlier is dashed."""
    lines = []
    for k, (name, values) in enumerate(zip(learned.names, curves, strict=True)):
        if k == learned.agreement.outlier:
            lines.append(Line(name, values, REFERENCE.name, 1))
        else:
            lines.append(Line(name, values, PERSON.name, 2))
    return lines


def _learned_lines(learned: LearnedProfile, curves: Mapping[str, Array]) -> list[Line]:
    """Return lines of learned curves by name, at the times of the demonstrations; deviations are dashed."""
    lines = []
    for name, curve in curves.items():
        values = np.interp(learned.alignment.time, learned.time, curve)
        style = 1
        if name == "learned":
            style = 0
        lines.append(Line(name, values, style=style))
    return lines
