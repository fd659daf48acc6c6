"""The numbers of a run of the main job, and the page that tells them to a reader."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from maniport import __version__
from maniport.demonstrations import ArmFit, Recording
from maniport.evaluation.page import in_words
from maniport.pipeline.execution import motion_lines
from maniport.transfer.icp.rotation import rotation_angle
from maniport.transfer.rigid_map import transport_rotation

if TYPE_CHECKING:
    from maniport.pipeline.result import TransferResult


def numbers(result: "TransferResult") -> dict[str, Any]:
    """Collect all numbers of a run, ready for JSON."""
    return {
        "maniport": __version__,
        "recording": _recording_numbers(result.recording),
        "person": _person_numbers(result.fit),
        "robot": {"name": result.robot.name, "joints": result.robot.dof, "frame": result.robot.frame},
        "ellipsoids": {"kind": result.spec.kind, "part": result.spec.part, "count": len(result.time)},
        "adapter": _adapter_numbers(result),
        "execution": None if result.execution is None else result.execution.summary(),
        "evaluation": result.evaluation.as_dict(),
        "verdict": in_words(result.evaluation.verdict),
        "random_state": result.random_state,
        "warnings": list(result.warnings),
    }


def _recording_numbers(recording: Recording) -> dict[str, Any]:
    return {
        "source": Path(recording.source).name,
        "frames": len(recording),
        "seconds": round(recording.duration, 3),
        "rate_hz": round(recording.rate, 3),
        "notes": list(recording.notes),
    }


def _person_numbers(fit: ArmFit) -> dict[str, Any]:
    return {
        "model": fit.arm.name,
        "segment_lengths_m": {name: round(float(v), 4) for name, v in fit.segment_lengths.items()},
        "frames": len(fit.time),
        "residual_deg": fit.residual_summary(),
        "largest_joint_step_deg": fit.largest_step,
        "joints_not_determined": fit.undetermined,
        "fraction_at_limit": {n: float(v) for n, v in zip(fit.joint_names, fit.at_limit, strict=True) if v > 0},
        "notes": list(fit.notes),
    }


def _adapter_numbers(result: "TransferResult") -> dict[str, Any]:
    adapter = result.adapter
    knowledge = getattr(adapter, "identifiability_", None)
    start = transport_rotation(adapter.teacher_mean_, adapter.student_mean_)
    return {
        "method": result.method,
        "damping": adapter.damping,
        "floor": adapter.floor,
        "teacher_damping": float(adapter.teacher_damping_),
        "student_damping": float(adapter.student_damping_),
        "released_damping": float(adapter.released_damping_),
        "teacher_samples": len(result.teacher_domain),
        "student_samples": len(result.student_domain),
        "teacher_dispersion": float(adapter.teacher_dispersion_),
        "student_dispersion": float(adapter.student_dispersion_),
        "dispersion_ratio": float(adapter.dispersion_ratio_),
        "rotation_from_transport_deg": float(np.degrees(rotation_angle(adapter.rotation_, start))),
        "iterations": int(adapter.n_iter_),
        "converged": bool(adapter.converged_),
        "stop_reason": adapter.stop_reason_,
        "identifiability": None if knowledge is None else knowledge.in_words(),
        "cost_start": float(adapter.history_[0]),
        "cost": float(adapter.cost_),
        "seconds": round(result.seconds_to_fit, 3),
    }


def as_markdown(summary: Mapping[str, Any]) -> str:
    """Write the numbers as a short page to read."""
    recording, person, adapter = summary["recording"], summary["person"], summary["adapter"]
    robot, ellipsoids = summary["robot"], summary["ellipsoids"]
    lines = [
        f"# {recording['source']} → {robot['name']}",
        "",
        f"{ellipsoids['count']} {ellipsoids['kind']} ellipsoids ({ellipsoids['part']}) of a person's right arm, "
        f"adapted to {robot['name']} at {robot['frame']} by {adapter['method']}.",
        "",
    ]
    if summary["warnings"] or person["joints_not_determined"]:
        lines += ["## Mind", ""]
        lines += [f"- {text}" for text in summary["warnings"]]
        lines += [f"- {text}" for text in _open_joints(person["joints_not_determined"])]
        lines += [""]
    lines += ["## The person", ""]
    lines += [
        f"- Recording: {recording['frames']} frames, {recording['seconds']} s at {recording['rate_hz']} Hz.",
        f"- Arm: {person['model']}, "
        + ", ".join(f"{name} {value:.3f} m" for name, value in person["segment_lengths_m"].items())
        + f"; {person['frames']} frames fitted.",
        "",
        "| direction of | median | 95 % | largest |",
        "|---|---|---|---|",
        *(
            f"| {name} | {r['median']:.2f}° | {r['p95']:.2f}° | {r['max']:.2f}° |"
            for name, r in person["residual_deg"].items()
        ),
        "",
        "Angle between the measured and the modelled direction.",
        "",
    ]
    if person["fraction_at_limit"]:
        share = ", ".join(f"{name} {100 * value:.0f} %" for name, value in person["fraction_at_limit"].items())
        lines += [f"Frames with a joint at its limit: {share}.", ""]
    lines += [f"- {note}" for note in (*recording["notes"], *person["notes"])]
    lines += ["", "## The adapter", "", *_adapter_lines(adapter), ""]
    lines += ["## Is it better than doing less?", ""]
    lines += [
        "| | mean feasibility gap | identity test |",
        "|---|---|---|",
        *(
            f"| {row['name']} | {row['feasibility_gap']['mean']:.3f} | {row['identity']:.3f} |"
            for row in summary["evaluation"]["rows"]
            if row["feasibility_gap"]
        ),
        "",
        *([f"**{summary['verdict']}**", ""] if summary["verdict"] else []),
        *(["## The robot's motion", "", *motion_lines(summary["execution"])] if summary["execution"] else []),
        f"maniport {summary['maniport']}, seed {summary['random_state']}.",
        "",
    ]
    return "\n".join(lines)


def _open_joints(reasons: Mapping[str, str]) -> list[str]:
    """Name the joints that are not determined, once for each reason."""
    grouped: dict[str, list[str]] = {}
    for name, reason in reasons.items():
        grouped.setdefault(reason, []).append(name)
    return [f"Not determined: {', '.join(names)}: {reason}." for reason, names in grouped.items()]


def _adapter_lines(adapter: Mapping[str, Any]) -> list[str]:
    if adapter["damping"] is not None:
        remedy = (
            f"damping {adapter['damping']:g} adds {adapter['teacher_damping']:.4g} to the person's ellipsoids and "
            f"{adapter['student_damping']:.4g} to the robot's; {adapter['released_damping']:.4g} is taken off results"
        )
    else:
        remedy = "none" if adapter["floor"] is None else f"eigenvalues below {adapter['floor']:g} are lifted to it"
    return [
        f"- Domains: {adapter['teacher_samples']} samples of the person, {adapter['student_samples']} of the robot.",
        f"- Singular ellipsoids: {remedy}.",
        f"- Dispersion: person {adapter['teacher_dispersion']:.3f}, robot {adapter['student_dispersion']:.3f}; "
        f"ratio {adapter['dispersion_ratio']:.3f}.",
        f"- Rotation: {adapter['rotation_from_transport_deg']:.2f}° from parallel transport.",
        f"- Fit: {adapter['iterations']} iterations in {adapter['seconds']:.2f} s, cost {adapter['cost_start']:.4f} → "
        f"{adapter['cost']:.4f}; ended because: {adapter['stop_reason']}.",
        *([f"- Mounting: taken as known, since {adapter['identifiability']}."] if adapter["identifiability"] else []),
    ]
