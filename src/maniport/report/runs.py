"""Reports of a transfer and of a robot's motion, for one or several arms."""

import contextlib
import platform
from collections.abc import Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import numpy as np

from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult
from maniport.report.metrics import describe, listed, numbers, warning, warnings_of
from maniport.report.motion import Run, group_section, infeasible_targets, motion_section
from maniport.report.recording import FIT, RECORDING, person_section, recording_section
from maniport.report.robot import chain_metrics, placement_section
from maniport.report.summary import summary_of
from maniport.report.transfer import adapter_section, evaluation_section, label
from maniport.report.values import INFO, Metric, Report, Section
from maniport.transfer.rigid_adapter import RigidAdapter, transport_rotation
from maniport.transfer.rotation_group import rotation_angle
from maniport.version import __version__

OF_ALL_ARMS = frozenset({"duration", "collisions"})
WARNINGS_OF_ALL_ARMS = frozenset({"collision", "unchecked-collisions", "missing-meshes", "unchecked-links"})
"""Keys of metrics and of warnings that concern all arms together."""

STEP = "step"  # Key of warnings that a stage of the run gave


@describe.register
def transfer_report(result: TransferResult) -> Report:
    """Report a transfer."""
    source = Path(result.recording.source).stem or "A recording"
    spec, person = result.spec, " and ".join(str(arm.fit.arm.side) for arm in result.arms)
    methods = " and ".join(dict.fromkeys(label(arm.method) for arm in result.arms))
    lead = (
        f"{np.ptp(result.time):.1f} s of the {person} arm{'s'[: len(result.arms) > 1]}, {len(result.time)} {spec.kind} "
        f"ellipsoids ({spec.part}), transferred to {result.robot.name} by the method {methods}."
    )
    sections = [
        *_group_sections(result),
        *(section for arm in result.arms for section in _named(result, arm, _transfer_sections(arm))),
        replace(recording_section(result.recording), folded=True),
        _settings(result),
    ]
    sections.sort(key=lambda section: section.folded)
    prefixes = [f"{arm.name.capitalize()} arm: " if len(result.arms) > 1 else "" for arm in result.arms]
    pairs = zip(prefixes, result.arms, strict=True)
    fits = [f"{prefix}{text}" for prefix, arm in pairs for text in arm.fit.quality_warnings]
    data_warnings = (*warnings_of(RECORDING, result.recording.quality_warnings), *warnings_of(FIT, fits))
    title = f"{source[:1].upper()}{source[1:]} → {display_name(result.robot.name)}: transfer result"
    report = Report(title, lead, tuple(sections), data_warnings=data_warnings)
    return replace(report, summary=summary_of(result, report))


@describe.register
def motion_report(result: MotionResult) -> Report:
    """Report a robot's motion along target ellipsoids."""
    assert result.motion is not None
    robot, trajectory = result.robot.name, result.motion.trajectory
    lead = f"{len(trajectory.time)} target ellipsoids, followed by {robot} in {np.ptp(trajectory.control_time):.1f} s."
    title = f"{Path(result.sources[0]).stem} → {robot}" if result.sources else f"The motion of {robot}"
    sections = [
        *_group_sections(result),
        *(section for arm in result.arms for section in _named(result, arm, _motion_sections(arm))),
        _settings(result),
    ]
    report = Report(title, lead, tuple(sorted(sections, key=lambda section: section.folded)))
    return replace(report, summary=summary_of(result, report))


def display_name(name: str) -> str:
    """Write the name of a robot with a capital letter, unless it has capitals of its own."""
    return name if name != name.lower() else name[:1].upper() + name[1:]


def _motion_sections(arm: ArmResult) -> list[Section]:
    """Describe the motion of an arm and the placement of its path."""
    motion = arm.motion
    if motion is None:
        evaluation = arm.evaluation if isinstance(arm, ArmTransfer) else None
        gap = None if evaluation is None else evaluation.adapter.feasibility_gap
        warned = [] if gap is None else [warning(*texts) for texts in infeasible_targets(gap.median)]
        return [Section("Robot motion", tuple(warned), key="motion", text="The robot was not moved.")]
    time = arm.time if isinstance(arm, ArmTransfer) else motion.time
    section = motion_section(Run(motion, time, arm))
    return [section] if arm.placement is None else [section, replace(placement_section(arm.placement), folded=True)]


def _transfer_sections(arm: ArmTransfer) -> list[Section]:
    """Describe all that belongs to one arm of a transfer."""
    compared = [] if arm.evaluation is None else [evaluation_section(arm.evaluation, choice=arm.choice)]
    details = [*compared, _adapter(arm), person_section(arm.fit)]
    return [*_motion_sections(arm), *(replace(section, folded=True) for section in details)]


def _named(result: TransferResult | MotionResult, arm: ArmResult, sections: Sequence[Section]) -> list[Section]:
    """Name the arm in all texts of its sections, and fold these, if there are several arms."""
    if len(result.arms) == 1:
        return list(sections)
    name = arm.name.capitalize()

    def named(metric: Metric) -> Metric:
        if metric.severity != INFO and metric.text:
            return replace(metric, text=f"{name} arm: {metric.text}")
        if metric.key in OF_ALL_ARMS:
            return replace(metric, text="", main=False)
        return replace(metric, label=f"{name}: {metric.label[:1].lower()}{metric.label[1:]}") if metric.main else metric

    return [
        replace(
            section,
            title=f"{name} arm: {section.title[:1].lower()}{section.title[1:]}",
            key=f"{arm.name}_{section.key}",
            metrics=tuple(named(metric) for metric in section.metrics if metric.key not in WARNINGS_OF_ALL_ARMS),
            folded=True,
        )
        for section in sections
    ]


def _group_sections(result: TransferResult | MotionResult) -> list[Section]:
    """Describe what concerns several arms together."""
    if result.motion is None or len(result.arms) == 1:
        return []
    time = result.time if isinstance(result, TransferResult) else result.motion.trajectory.time
    collisions = result.arms[0].collisions
    return [group_section(result.motion, time, () if collisions is None else collisions.unchecked)]


def _settings(result: TransferResult | MotionResult) -> Section:
    """Describe the robot and the settings of a run."""
    metrics: list[Metric] = []
    if isinstance(result, TransferResult):
        spec = result.spec
        frames = "Human: trunk frame (x forward, y left, z up); robot: base frame."
        value = {"kind": spec.kind, "part": spec.part, "count": len(result.time)}
        metrics += [
            *warnings_of(STEP, result.warnings),
            Metric("Ellipsoids", f"{len(result.time)}, {spec.kind}, {spec.part}", frames, "ellipsoids", value),
            *numbers(method=[arm.method for arm in result.arms], base_rotation=result.base_rotation.round(6).tolist()),
        ]
    else:
        metrics.append(Metric("Files", listed(result.sources), key="sources", value=list(result.sources)))
    for arm in result.arms:
        chain = chain_metrics(arm.robot)
        base, _, fixed = (metric.text for metric in chain)
        text = f"{arm.robot.name}, {arm.robot.dof} joints, from {base} to {arm.robot.frame}"
        value = {"name": arm.robot.name, "joints": arm.robot.dof, **{metric.key: metric.value for metric in chain}}
        key = "robot" if len(result.arms) == 1 else f"{arm.name}_robot"
        metrics.append(Metric("Robot", text, f"Fixed joints: {fixed}" if fixed else "", key, value))
    motion = result.arms[0].motion
    if motion is not None:
        rate = float((len(motion.control_time) - 1) / np.ptp(motion.control_time))
        metrics += numbers(control_rate_hz=rate, damping=motion.damping.epsilon)
    return Section("Settings", (*metrics, *software(result.random_state)), key="run", folded=True)


def software(seed: int | None) -> list[Metric]:
    """Return the seed and the versions of the software."""
    versions = {"maniport": __version__, "Python": platform.python_version()}
    for package, name in {"numpy": "NumPy", "scipy": "SciPy", "pin": "Pinocchio", "pin-pink": "Pink"}.items():
        with contextlib.suppress(metadata.PackageNotFoundError):  # it is installed by other means than a package
            versions[name] = metadata.version(package)
    about = "The same seed and versions give the same numbers."
    return [
        Metric("Seed", "none" if seed is None else str(seed), about, "random_state", seed),
        Metric("Versions", listed(map(" ".join, versions.items())), key="versions", value=versions),
    ]


def _adapter(arm: ArmTransfer) -> Section:
    """Describe the adapter, the samples that it was fitted to, and its rotation relative to parallel transport."""
    adapter, human, robot = arm.adapter, len(arm.teacher_domain), len(arm.student_domain)
    more = [
        Metric("Domains", f"{human} samples of the person, {robot} samples of the robot", "", "samples",
               {"teacher": human, "student": robot}),
        Metric("Time to fit", f"{arm.seconds_to_fit:.2f} s"),  # not for JSON: the same seed gives the same bytes
    ]  # fmt: skip
    if isinstance(adapter, RigidAdapter):
        start = transport_rotation(adapter.teacher_mean_, adapter.student_mean_)
        angle = float(np.degrees(rotation_angle(adapter.rotation_, start)))
        more.append(
            Metric("Rotation from parallel transport", f"{angle:.2f}°", "", "rotation_from_transport", angle, "°")
        )
    return adapter_section(adapter, *more, mounted=True)
