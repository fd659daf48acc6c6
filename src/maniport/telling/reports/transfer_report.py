"""The report of the main job: a person's motion, what the robot shall make of it, and what it makes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from maniport.telling.page import Fact, Report, Section, Table
from maniport.telling.reports.execution_report import motion_facts, motion_warnings, robot_facts
from maniport.telling.reports.feasibility import gap_facts, gap_of_transfer, gap_warnings
from maniport.telling.reports.motions import of_transfer as motion_of
from maniport.telling.reports.versions import seed, versions
from maniport.validation import Array

if TYPE_CHECKING:
    from maniport.pipeline.result import TransferResult


def of_transfer(result: TransferResult) -> Report:
    """Tell what was done and what came out, warnings first."""
    numbers, robot = result.summary(), result.robot
    recording, ellipsoids = numbers["recording"], numbers["ellipsoids"]
    motion, gap = numbers["execution"], gap_of_transfer(result)
    sections = [
        Section("The motion", "", (motion_of(result, gap),)),
        Section("What the numbers mean", "", (*_meanings(numbers, gap),)),
        Section("What was done", "", (_done(result, numbers), *_fit_table(numbers["person"]))),
    ]
    return Report(
        f"{recording['source'] or 'Recording'} → {robot.name}",
        f"{ellipsoids['count']} {ellipsoids['kind']} ellipsoids ({ellipsoids['part']}) of a person's right arm, "
        f"adapted to {robot.name} by {numbers['adapter']['method']}"
        + (f" and followed in {motion['motion']['seconds']:.1f} s." if motion else "."),
        tuple(_warnings(result, numbers, gap)),
        tuple(sections),
    )


def _warnings(result: TransferResult, numbers: Mapping[str, Any], gap: Array) -> list[str]:
    """Say what bears on the result, the worst first; what was mended in the recording comes last, in one go."""
    found = motion_warnings(numbers["execution"]) if result.execution is not None else []
    found += [*gap_warnings(gap), *([numbers["verdict"]] if numbers["verdict"] else [])]
    grouped: dict[str, list[str]] = {}
    for name, reason in numbers["person"]["joints_not_determined"].items():
        grouped.setdefault(reason, []).append(name)
    found += [f"The recording does not determine {', '.join(names)}: {reason}." for reason, names in grouped.items()]
    known = numbers["adapter"]["identifiability"]
    found += [f"The mounting is taken as known, since {known}."] if known else []
    found += list(numbers["warnings"])
    notes = list(numbers["person"]["notes"])
    found += [f"In the recording: {'; '.join(notes)}."] if notes else []
    return [text[:1].upper() + text[1:] for text in found]


def _meanings(numbers: Mapping[str, Any], gap: Array) -> list[tuple[Fact, ...] | Table]:
    adapter = numbers["adapter"]
    facts = list(motion_facts(numbers["execution"])) if numbers["execution"] else []
    facts += [
        *gap_facts(gap),
        Fact(
            "Dispersion",
            f"person {adapter['teacher_dispersion']:.3f}, {numbers['robot']['name']} "
            f"{adapter['student_dispersion']:.3f}, ratio {adapter['dispersion_ratio']:.3f}",
            "How widely each body's ellipsoids scatter about their mean; the profile is stretched by the ratio.",
        ),
        Fact(
            "Rotation",
            f"{adapter['rotation_from_transport_deg']:.2f}°",
            "How far the fitted rotation is from that of plain parallel transport.",
        ),
        Fact(
            "Fit",
            f"{adapter['iterations']} iterations, {adapter['seconds']:.2f} s, cost {adapter['cost_start']:.4f} → "
            f"{adapter['cost']:.4f}",
            f"It ended because: {adapter['stop_reason']}.",
        ),
    ]
    gaps = Table(
        ("what is asked of the robot", "mean feasibility gap", "identity test"),
        tuple(
            (row["name"], f"{row['feasibility_gap']['mean']:.3f}", f"{row['identity']:.3f}")
            for row in numbers["evaluation"]["rows"]
            if row["feasibility_gap"]
        ),
        "Is it better than doing less?",
    )
    return [tuple(facts), gaps]


def _done(result: TransferResult, numbers: Mapping[str, Any]) -> tuple[Fact, ...]:
    recording, person, adapter = numbers["recording"], numbers["person"], numbers["adapter"]
    lengths = ", ".join(f"{name} {value:.3f} m" for name, value in person["segment_lengths_m"].items())
    facts = [
        Fact(
            "Recording",
            f"{recording['source']}: {recording['frames']} frames, {recording['seconds']:g} s at "
            f"{recording['rate_hz']:.4g} Hz",
            "; ".join(recording["notes"]),
        ),
        Fact("Person", f"{person['model']}, {person['frames']} frames fitted", f"Scaled to {lengths}."),
        Fact(
            "Ellipsoids",
            f"{result.spec.kind}, {result.spec.part}",
            "The person's are in the trunk frame (x forward, y left, z up), the robot's in its base frame.",
        ),
        Fact("Method", adapter["method"], _settings(result)),
        Fact("Mounting", _mounting(result), "Rotation from the person's trunk frame to the robot's base frame."),
        Fact(
            "Domains", f"{adapter['teacher_samples']} samples of the person, {adapter['student_samples']} of the robot"
        ),
        Fact("Singular ellipsoids", _remedy(adapter), "A stretched arm loses a direction; distances need all of them."),
    ]
    moved, arm = result.execution, result.robot
    facts += robot_facts(moved) if moved else [Fact("Robot", f"{arm.name}, {arm.dof} joints, tip {arm.frame}")]
    return (*facts, seed(result.random_state), *versions())


def _settings(result: TransferResult) -> str:
    """What the adapter was told; the mounting and what is done with singular ellipsoids have their own lines."""
    told = result.adapter.get_params(deep=False).items()
    apart = {"mounting", "damping", "floor"}
    return ", ".join(f"{name} {value}" for name, value in told if name not in apart and value is not None)


def _mounting(result: TransferResult) -> str:
    turn = result.adapter.mounting_
    if turn is None or np.allclose(turn, np.eye(len(turn))):
        return "the robot faces where the person faces"
    rows = "; ".join(" ".join(f"{value:.3f}" for value in row) for row in turn[:3, :3])
    return f"[{rows}]"


def _remedy(adapter: Mapping[str, Any]) -> str:
    if adapter["damping"] is not None:
        return f"damping {adapter['damping']:g}"
    return "none" if adapter["floor"] is None else f"eigenvalues below {adapter['floor']:g} are lifted to it"


def _fit_table(person: Mapping[str, Any]) -> list[Table]:
    rows = tuple(
        (name, f"{one['median']:.2f}°", f"{one['p95']:.2f}°", f"{one['max']:.2f}°")
        for name, one in person["residual_deg"].items()
    )
    caption = "How well the arm fits the person: angle between the measured and the modelled direction of each segment."
    tables = [Table(("segment", "median", "95 %", "largest"), rows, caption)]
    if person["fraction_at_limit"]:
        share = tuple((name, f"{100 * value:.1f} %") for name, value in person["fraction_at_limit"].items())
        tables.append(
            Table(("joint", "frames at a limit"), share, "A joint at its limit may have wanted to go further.")
        )
    return tables
