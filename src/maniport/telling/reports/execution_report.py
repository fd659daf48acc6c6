"""The report of a robot's motion along given ellipsoids."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from maniport.telling.page import Fact, Report, Section
from maniport.telling.reports.feasibility import gap_facts, gap_warnings
from maniport.telling.reports.motions import of_execution as motion_of
from maniport.telling.reports.versions import seed, versions

if TYPE_CHECKING:
    from maniport.pipeline.execution import Execution


def of_execution(execution: Execution) -> Report:
    """Tell what a robot was asked for and what it achieves."""
    numbers, robot = execution.summary(), execution.robot
    motion, gap = numbers["motion"], execution.gap
    return Report(
        f"The motion of {robot.name}",
        f"{motion['points']} wanted ellipsoids, followed by {robot.name} in {motion['seconds']:.1f} s.",
        (*motion_warnings(numbers), *gap_warnings(gap)),
        (
            Section("The motion", "", (motion_of(execution),)),
            Section("What the numbers mean", "", ((*motion_facts(numbers), *gap_facts(gap)),)),
            Section("What was done", "", (_done(execution),)),
        ),
    )


def motion_warnings(numbers: Mapping[str, Any]) -> list[str]:
    """Say where the robot could not do what was asked."""
    placement, motion = numbers["placement"], numbers["motion"]
    status, points = motion["status"], motion["points"]
    found = []
    if placement is not None and placement["points_out_of_reach"]:
        found.append(
            f"{placement['points_out_of_reach']} of {points} points of the hand path are out of reach, by up to "
            f"{1e3 * placement['farthest_out_of_reach_m']:.1f} mm."
        )
    missed = points - status.get("followed", 0)
    if missed:
        why = ", ".join(f"{word} at {count}" for word, count in status.items() if word != "followed")
        found.append(
            f"At {missed} of {points} points the robot is not within a distance of 0.1 of the wanted ellipsoid and "
            f"1 mm of its path: {why}."
        )
    if status.get("velocity limit"):
        found.append(f"The motion is too fast for the robot in places: give a tempo below {numbers['tempo']:g}.")
    if motion["held_at_s"]:
        found.append(f"At {len(motion['held_at_s'])} control steps no answer was found and the robot was held.")
    if motion["joints_without_known_velocity_limit"]:
        found.append(f"No velocity limit is known of {', '.join(motion['joints_without_known_velocity_limit'])}.")
    return found


def motion_facts(numbers: Mapping[str, Any]) -> tuple[Fact, ...]:
    """Explain each number of a motion in one sentence."""
    placement, motion = numbers["placement"], numbers["motion"]
    distance, error, jerk = motion["distance"], motion["position_error_mm"], motion["jerk"]
    facts = [
        Fact(
            "Distance of the ellipsoids",
            f"{distance['median']:.2f} (median), {distance['p95']:.2f} (95 %)",
            "From what was wanted to what the robot makes; 0.1 is one axis that is 5 % too long, 1 one that is 65 %.",
        )
    ]
    if placement is not None:
        place = ", ".join(f"{value:.3f}" for value in placement["offset_m"])
        facts += [
            Fact(
                "Best with the hand there",
                f"{placement['distance_median']:.2f} (median), {placement['distance_p95']:.2f} (95 %)",
                "The smallest such distance that was found with the hand on its path, each point by itself.",
            ),
            Fact(
                "Where the hand path lies",
                f"{placement['scale']:.3f} times as large, turned by {placement['yaw_deg']:.1f}°, at ({place}) m",
                "Size, turn and middle: where the robot can follow best. The wanted ellipsoids turned with it.",
            ),
        ]
    if error is not None:
        facts.append(
            Fact(
                "Hand beside its path",
                f"{error['median']:.2f} mm (median), {error['p95']:.2f} mm (95 %)",
                "How far the robot's hand is from where it was asked to be.",
            )
        )
    return (
        *facts,
        Fact(
            "Jerk",
            f"{jerk['rms']:.0f} rad/s³ (root mean square), {jerk['peak']:.0f} rad/s³ (peak)",
            "How abruptly the acceleration of the joints changes.",
        ),
        Fact(
            "Points",
            ", ".join(f"{count} {word}" for word, count in motion["status"].items()),
            "At each point the worst since the one before; followed means within 0.1 and 1 mm.",
        ),
    )


def _done(execution: Execution) -> tuple[Fact, ...]:
    files = (
        Fact("Files", ", ".join(execution.sources), "The wanted ellipsoids, and the hand path where there is one."),
    )
    facts = *robot_facts(execution), seed(execution.random_state), *versions()
    return (*files, *facts) if execution.sources else facts


def robot_facts(execution: Execution) -> tuple[Fact, ...]:
    """Name the robot and the settings of its motion."""
    robot, motion = execution.robot, execution.summary()["motion"]
    return (
        Fact("Robot", f"{robot.name}, {robot.dof} joints, tip {robot.frame}"),
        Fact("Tempo", f"{execution.tempo:g}", "Speed of the robot's motion over that of the wanted one."),
        Fact("Control rate", f"{motion['control_rate_hz']:.4g} Hz"),
        Fact("Damping", f"{motion['damping']:.3g}", "Added to all eigenvalues before ellipsoids are compared."),
    )
