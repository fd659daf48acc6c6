"""Panels of curves over time: errors, ellipsoids and joints."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from maniport.arms import Arm, EllipsoidSpec
from maniport.learning.agreement import axis_deviations
from maniport.pipeline import LearnedProfile
from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult
from maniport.report.metrics import METRICS
from maniport.report.page.content import Line, Panel
from maniport.report.roles import ACHIEVED, PERSON, REFERENCE, TARGET
from maniport.spd.ellipsoid import lengths
from maniport.util.validation import Array

ERRORS, ELLIPSOIDS, HUMAN_JOINTS = "Distance and position error", "Ellipsoids", "Joints of the person"


def profiles_of(arm: ArmResult, spec: EllipsoidSpec) -> dict[str, Array]:
    """Return velocity ellipsoids of an arm by role."""
    profiles: dict[str, Array] = {}
    if isinstance(arm, ArmTransfer):
        profiles[PERSON.name] = velocity_ellipsoids(arm.demonstrated_profile, spec)
    if arm.motion is not None:
        profiles |= {TARGET.name: arm.motion.target, ACHIEVED.name: arm.motion.achieved}
    elif isinstance(arm, ArmTransfer):
        profiles[TARGET.name] = velocity_ellipsoids(arm.target_profile, spec)
    return profiles


def velocity_ellipsoids(profile: Array, spec: EllipsoidSpec) -> Array:
    """Return velocity ellipsoids: the profile, or the inverses of force ellipsoids."""
    return np.asarray(np.linalg.inv(profile)) if spec.kind == "force" else profile


def panels_of(
    result: TransferResult | MotionResult, arm: ArmResult, spec: EllipsoidSpec
) -> Iterator[tuple[str, list[Panel]]]:
    """Yield groups of panels of an arm by title."""
    if arm.motion is not None:
        yield ERRORS, _errors(arm)
    if spec.part != "full":
        panels = semi_axis_panels(profiles_of(arm, spec), spec.velocity.unit)
        if arm.motion is not None:
            angle = Line("longest axis", np.degrees(arm.motion.major_axis_angle))
            meaning = "Between target and achieved. The line breaks where two axes have one length."
            panels.insert(0, Panel("Angle between longest axes", "°", (angle,), meaning, span=(0.0, 90.0)))
        yield ELLIPSOIDS, panels
    if arm.motion is not None:
        names = [result.robot.joint_names[column] for column in result.robot.columns[result.arms.index(arm)]]
        panels, shared = _joints(arm.robot, arm.motion.joint_positions, ACHIEVED.name, names), result.robot.shared
        if shared and arm is result.arms[0]:
            yield f"Shared joints of {result.robot.name}", [panel for panel in panels if panel.title in shared]
        yield f"Joints of {result.robot.name}", [panel for panel in panels if panel.title not in shared]
    if isinstance(arm, ArmTransfer):
        yield HUMAN_JOINTS, _joints(arm.fit.arm, arm.fit.joint_angles, PERSON.name, arm.fit.arm.joint_names)


def alternated(panels: Sequence[Sequence[Panel]], names: Sequence[str]) -> tuple[Panel, ...]:
    """Alternate panels of arms and name the arm in titles."""
    if len(panels) == 1:
        return tuple(panels[0])
    rows = zip_longest(*panels)
    pairs = (pair for row in rows for pair in zip(names, row, strict=True) if pair[1] is not None)
    return tuple(replace(panel, title=f"{name.capitalize()}: {panel.title}") for name, panel in pairs)


def _errors(arm: ArmResult) -> list[Panel]:
    """Return panels of the distance, with the best pointwise one, and of the position error."""
    motion, distance, error = arm.motion, METRICS["distance"], METRICS["position_error"]
    assert motion is not None
    lines = [Line("achieved", motion.distance)]
    if motion.pointwise_best is not None:
        lines.append(Line("best pointwise distance found", motion.pointwise_best, REFERENCE.name, 1))
    panels = [Panel(distance.label, "", tuple(lines), distance.description)]
    if motion.position_error is not None:
        line = Line("end effector", np.maximum(1e3 * motion.position_error, 1e-2))  # the axis is logarithmic
        panels.append(Panel(error.label, error.unit, (line,), error.description, logarithmic=True))
    return panels


def _joints(arm: Arm, positions: Array, role: str, names: Sequence[str]) -> list[Panel]:
    """Return a panel for each joint with its limits; positions (n, dof) [rad or m], angles are drawn in degrees."""
    panels = []
    for k, name in enumerate(names):
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
    return panels


def semi_axis_panels(profiles: Mapping[str, Array], unit: str) -> list[Panel]:
    """Return panels of each semi-axis of profiles (n, d, d) by role, the longest first."""
    curves = {role: lengths(points) for role, points in profiles.items()}
    d = next(iter(curves.values())).shape[1]
    panels = []
    for k, word in enumerate(("Longest", "Middle", "Shortest") if d == 3 else ("Longest", "Shortest")):
        lines = tuple(Line(role, axes[:, d - 1 - k], role, wide=role == TARGET.name and len(curves) > 1)
                      for role, axes in curves.items())  # fmt: skip
        panels.append(Panel(f"{word} semi-axis", unit, lines))
    return panels


def panels_of_learned(learned: LearnedProfile) -> dict[str, tuple[Panel, ...]]:
    """Return the curves of demonstrations and of the profile that is learned from them."""
    time, deviations = learned.alignment.time, axis_deviations(learned.profile, learned.covariance)
    semi_axes, each = lengths(learned.profile), lengths(learned.alignment.ellipsoids)
    d, unit, outlier = semi_axes.shape[1], learned.spec.unit, learned.agreement.outlier

    def panel(title: str, unit: str, several: Array, values: Array, deviation: Array | None = None) -> Panel:
        lines = [Line(name, one, REFERENCE.name if k == outlier else PERSON.name, 1 if k == outlier else 2)
                 for k, (name, one) in enumerate(zip(learned.names, several, strict=True))]  # fmt: skip
        factors: list[tuple[str, Array | float, int]] = [("learned", 1.0, 0)]
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
    return {"Learned ellipsoids": tuple(axes), "Learned path": tuple(hand)}
