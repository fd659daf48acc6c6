"""The moving part of a report: arms with their ellipsoids, curves and the map of the domains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from maniport.bodies import Arm
from maniport.telling.page import Body, DomainMap, Line, Motion, Panel, domain_map, ellipsoid_panels
from maniport.telling.reports.arms import body_of
from maniport.telling.reports.feasibility import MEANING, NAME, gap_lines
from maniport.validation import Array

if TYPE_CHECKING:
    from maniport.pipeline.execution import Execution
    from maniport.pipeline.result import TransferResult

UNITS = {"translation": "m/s per rad/s", "rotation": "rad/s per rad/s"}
"""Units of semi-axes of velocity ellipsoids, for arms with revolute joints."""

DISTANCE = "Affine-invariant distance: 0.1 is one axis 5 % too long, 1 is 65 %."
ELLIPSOIDS, NEARNESS = "Ellipsoids", "How near the robot comes"
EDGE = 0.06
"""How far beyond a joint's limits its panel reaches, as a part of its range."""


def of_transfer(result: TransferResult, gap: Array) -> Motion:
    """Show the person's arm and the robot side by side, under the person's clock; `gap` (n,) as in feasibility."""
    fit, robot, execution = result.fit, result.robot, result.execution
    force = result.spec.kind == "force"
    drawn = result.spec.part != "full"
    teacher, adapted = result.demonstrated_profile, result.target_profile
    wanted = _inverse(adapted) if execution is None and force else adapted
    shown = {"teacher": _inverse(teacher) if force else teacher}
    shown |= {"wanted": wanted if execution is None else execution.motion.target}
    at_hand = {"teacher": shown["teacher"]} if drawn else {}
    bodies = [body_of(fit.arm, fit.joint_angles, at_hand, name="Person")]
    panels: dict[str, tuple[Panel, ...]] = {}
    names = {"teacher": "person", "wanted": "wanted", "student": robot.name}
    if execution is not None:
        shown["student"] = execution.motion.achieved
        bodies.append(_robot_body(execution, drawn))
        panels[NEARNESS] = nearness_panels(execution)
    else:
        panels[NEARNESS] = (_gap_panel(result, gap),)
    if drawn:
        panels[ELLIPSOIDS] = ellipsoid_panels(shown, names, UNITS[result.spec.part])
    if execution is not None:
        panels[f"Joints of {robot.name}"] = _robot_joints(execution)
    panels["Joints of the person"] = joint_panels(fit.arm, np.degrees(fit.joint_angles), "teacher", in_degrees=True)
    slower = execution is not None and execution.tempo != 1.0
    return Motion(
        result.time,
        tuple(body for body, _ in bodies),
        panels,
        _map(result, names),
        unit=UNITS.get(result.spec.part, ""),
        clocks={"robot": 1.0 / execution.tempo} if execution is not None and slower else {},
        legend=_legend(shown, robot.name) if drawn else {},
        note=_note(result.spec.part, force, execution is not None, *(why for _, why in bodies)),
    )


def of_execution(execution: Execution) -> Motion:
    """Show the robot alone, under its own clock."""
    motion, robot = execution.motion, execution.robot
    part = execution.part
    drawn = part != "full"
    shown = {"wanted": motion.target, "student": motion.achieved}
    names = {"wanted": "wanted", "student": robot.name}
    panels = {NEARNESS: nearness_panels(execution)}
    if drawn:
        panels[ELLIPSOIDS] = ellipsoid_panels(shown, names, UNITS[part])
    panels[f"Joints of {robot.name}"] = _robot_joints(execution)
    body, why = _robot_body(execution, drawn)
    return Motion(
        motion.time,
        (body,),
        panels,
        unit=UNITS.get(part, ""),
        legend=_legend(shown, robot.name) if drawn else {},
        note=_note(part, False, True, why),
    )


def nearness_panels(execution: Execution) -> tuple[Panel, ...]:
    """Make panels of the distance from wanted to achieved, the smallest there could be, and the hand's error."""
    motion, best = execution.motion, execution.best_distance
    lines, meaning = [Line("achieved", motion.distance)], DISTANCE
    if best is not None:
        lines.append(Line("best with the hand there", best, "wanted", 1))
        meaning += " Best with the hand there: the nearest that was found with the hand on its path."
    title = f"Distance from wanted to achieved, and {NAME.lower()}"
    lines += gap_lines(execution.gap)
    meaning += f" {NAME}: {MEANING[0].lower()}{MEANING[1:]}"
    panels = [Panel(title, "", tuple(lines), meaning)]
    if motion.position_error is not None:
        error = Line("hand", 1e3 * motion.position_error)
        panels.append(Panel("Hand beside its path", "mm", (error,), "The hand goes first, the ellipsoid second."))
    return tuple(panels)


def joint_panels(
    arm: Arm, values: Array, role: str, *, in_degrees: bool = False, units: tuple[str, ...] = ()
) -> tuple[Panel, ...]:
    """Make a panel for each joint, its limits shaded; values (n, dof) in degrees or in the joints' own units."""
    factor = 180.0 / np.pi if in_degrees else 1.0
    panels = []
    for k, name in enumerate(arm.joint_names):
        low, high = factor * float(arm.lower[k]), factor * float(arm.upper[k])
        known = bool(np.isfinite(high - low))
        margin = EDGE * (high - low) if known else 0.0
        unit = "°" if in_degrees else units[k] if units else "rad"
        line = Line("", np.asarray(values[:, k], dtype=float), role)
        limits, span = ((low, high), (low - margin, high + margin)) if known else (None, None)
        meaning = (
            f"Limits {_signed(low)} and {_signed(high)}; what is beyond them is shaded." if known else "No limits."
        )
        panels.append(Panel(name, unit, (line,), meaning, limits=limits, span=span))
    return tuple(panels)


def _robot_joints(execution: Execution) -> tuple[Panel, ...]:
    motion = execution.motion
    return joint_panels(execution.robot, motion.joint_positions, "student", units=motion.joint_units)


def _robot_body(execution: Execution, drawn: bool) -> tuple[Body, str]:
    motion, robot = execution.motion, execution.robot
    ellipsoids = {"wanted": motion.target, "student": motion.achieved} if drawn else {}
    return body_of(robot, motion.joint_positions, ellipsoids, motion.path)


def _gap_panel(result: TransferResult, gap: Array) -> Panel:
    """Make the panel of a robot that was not moved; of one that can only be sampled, by its samples."""
    if lines := gap_lines(gap):
        return Panel(NAME, "", lines, f"{MEANING} {DISTANCE}")
    gaps = np.asarray(result.adapter.gaps(result.demonstrated_profile, result.student_domain))
    meaning = f"From what is wanted to the nearest sample of the robot's domain, an upper bound. {DISTANCE}"
    return Panel(f"{NAME}, by samples", "", (Line("", gaps, "wanted"),), meaning)


def _signed(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


def _map(result: TransferResult, names: dict[str, str]) -> DomainMap:
    """Domains and profiles as the fit saw them: regularised, since singular ones are infinitely far from the rest."""
    adapter, execution = result.adapter, result.execution
    sides = {"teacher": adapter.teacher_side, "student": adapter.student_side}
    domains = {"teacher": result.teacher_domain, "student": result.student_domain}
    profiles = {"teacher": result.demonstrated_profile, "wanted": result.target_profile}
    if execution is not None and result.spec.kind == "velocity":
        profiles |= {"wanted": execution.motion.target, "student": execution.motion.achieved}
    own = {role: "student" if role == "wanted" else role for role in profiles}
    return domain_map(
        {role: (names[role], sides[role](points, role)) for role, points in domains.items()},
        {role: (names[role], sides[own[role]](points, role)) for role, points in profiles.items()},
        "Ellipsoids stand here as they were fitted: lifted a little, for flat ones are infinitely far from all others.",
    )


def _legend(shown: dict[str, Array], robot: str) -> dict[str, str]:
    words = {"teacher": "the person's ellipsoid", "wanted": "adapted: what the robot is asked for (shell)"}
    return {role: (words | {"student": f"what {robot} achieves"})[role] for role in shown}


def _note(part: str, force: bool, moved: bool, *missing: str) -> str:
    """Say what the picture shows; `missing` tells what could not be drawn."""
    sentences = [_picture(part, force)] + ([] if moved else ["The robot was not moved."])
    return " ".join([*sentences, *filter(None, missing)])


def _picture(part: str, force: bool) -> str:
    if part == "full":
        return "Ellipsoids of six dimensions cannot be drawn; their distances can."
    moves = "can move" if part == "translation" else "can turn"
    note = (
        f"An ellipsoid shows how fast the hand {moves} in each direction while the joints move at unit speed; a "
        f"semi-axis of 1 {UNITS[part]} is drawn 0.25 m long. Rings mark its principal planes. Both arms have one "
        f"scale and are seen from one direction (x forward, y left, z up)."
    )
    if force:
        note += " Force ellipsoids were transferred; their inverses, the velocity ellipsoids, are drawn."
    return note


def _inverse(matrices: Array) -> Array:
    return np.asarray(np.linalg.inv(matrices))
