"""Panels of curves over time: errors, ellipsoids and joints."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np
from numpy.typing import ArrayLike

import maniport.report.motion  # noqa: F401  registers the metrics
from maniport.arms import Arm, EllipsoidSpec
from maniport.learning.agreement import axis_deviations
from maniport.pipeline import LearnedProfile
from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult
from maniport.report.metrics import METRICS
from maniport.report.page.content import Line, Panel
from maniport.report.roles import ACHIEVED, PERSON, REFERENCE, TARGET
from maniport.report.series import profile_curves
from maniport.spd.ellipsoid import lengths, line_angles
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
        profiles = profiles_of(arm, spec)
        yield ELLIPSOIDS, ellipsoid_panels(profiles, {role: role for role in profiles}, spec.velocity.unit)
    if arm.motion is not None:
        names = _joint_names(result, arm)
        panels = _joints(arm.robot, arm.motion.joint_positions, ACHIEVED.name, names)
        shared = () if isinstance(result.robot, Arm) else result.robot.shared
        if shared and arm is result.arms[0]:
            yield f"Shared joints of {result.robot.name}", [panel for panel in panels if panel.title in shared]
        yield f"Joints of {result.robot.name}", [panel for panel in panels if panel.title not in shared]
    if isinstance(arm, ArmTransfer):
        yield HUMAN_JOINTS, _joints(arm.fit.arm, arm.fit.joint_angles, PERSON.name, arm.fit.arm.joint_names)


def _joint_names(result: TransferResult | MotionResult, arm: ArmResult) -> Sequence[str]:
    """Return the names of the joints of an arm in its robot."""
    if isinstance(result.robot, Arm):
        return arm.robot.joint_names
    return [result.robot.joint_names[column] for column in result.robot.columns[result.arms.index(arm)]]


def alternated(panels: Sequence[Sequence[Panel]], names: Sequence[str]) -> tuple[Panel, ...]:
    """Alternate panels of arms and name the arm in titles."""
    if len(panels) == 1:
        return tuple(panels[0])
    alternated: list[Panel] = []
    for row in zip_longest(*panels):
        for name, panel in zip(names, row, strict=True):
            if panel is not None:
                title = panel.title if panel.strip else f"{panel.title[:1].lower()}{panel.title[1:]}"
                alternated.append(replace(panel, title=f"{name.capitalize()}: {title}"))
    return tuple(alternated)


def _errors(arm: ArmResult) -> list[Panel]:
    """Return panels of the distance, with the best pointwise one, and of the position error."""
    motion, distance, error = arm.motion, METRICS["distance"][0], METRICS["position_error"][0]
    assert motion is not None
    lines = [Line("achieved", motion.distance)]
    if motion.pointwise_best is not None:
        lines.append(Line(METRICS["pointwise_best"][0].label.lower(), motion.pointwise_best, REFERENCE.name, 1))
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


def ellipsoid_panels(profiles: Mapping[str, ArrayLike], names: Mapping[str, str], unit: str) -> list[Panel]:
    """Return panels of each semi-axis of profiles by role, and of the angles between target and achieved axes."""
    curves = profile_curves({role: np.asarray(points) for role, points in profiles.items()})
    d, panels = next(iter(curves.values())).semi_axes.shape[1], []
    if {TARGET.name, ACHIEVED.name} <= set(curves):
        target, achieved = curves[TARGET.name], curves[ACHIEVED.name]
        pairs = {"longest": (target.longest, achieved.longest), "shortest": (target.shortest, achieved.shortest)}
        angles = {f"{name} axis": np.degrees(line_angles(*pair)) for name, pair in pairs.items()}
        lines = tuple(Line(name, angle, ACHIEVED.name, k) for k, (name, angle) in enumerate(angles.items()))
        meaning = "Between target and achieved. A line breaks where two axes have one length."
        panels.append(Panel("Angle between the axes", "°", lines, meaning, span=(0.0, 90.0)))
    for k, word in enumerate(("Longest", "Middle", "Shortest") if d == 3 else ("Longest", "Shortest")):
        lines = tuple(Line(names[role], one.semi_axes[:, d - 1 - k], role, wide=role == TARGET.name and len(curves) > 1)
                      for role, one in curves.items())  # fmt: skip
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
