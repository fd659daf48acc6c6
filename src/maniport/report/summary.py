"""Summary of a motion: status, outcome of position and ellipsoids, what limits it, and the next step."""

from collections.abc import Collection, Sequence

import numpy as np

from maniport.motion.follow.status import ENOUGH_DISTANCE, NEAR_DISTANCE
from maniport.pipeline import TransferResult
from maniport.pipeline.config import CONFIG, FREE, OPTIONS, Config
from maniport.pipeline.execution import Execution
from maniport.report.metrics import INFO, Metric, Report, Section, Summary, in_axes, listed
from maniport.report.motion import exceeded_limits, far_points, missed_points
from maniport.util.defaults import POSITION_TOLERANCE

GREEN, AMBER, RED = "green", "amber", "red"
"""No warning; warnings to read before the motion runs; a motion that must not run."""

RED_WARNINGS = frozenset({"collision", "limits-exceeded", "held", "constraints-violated"})
"""Keys of the warnings that make a result red. Every other warning makes it amber."""


def status_of(keys: Collection[str]) -> str:
    """Return the status of a result whose warnings have these keys."""
    if RED_WARNINGS & set(keys):
        return RED
    return AMBER if keys else GREEN


def motion_summary(execution: Execution, report: Report, transfer: TransferResult | None = None) -> Summary:
    """Summarize a motion, of which `report` has all sections."""
    motion, reasons = execution.motion, report.warning_keys
    median, status = float(np.median(motion.distance)), status_of(reasons)
    position, on_path = _position(execution)
    outcome = "; ".join(filter(None, [position, _ellipsoids(median)]))
    reached = len(motion.status) - missed_points(motion)
    advice, command = _next(execution, transfer, on_path, status)
    return Summary(
        f"{outcome[:1].upper()}{outcome[1:]}: {reached} of {len(motion.status)} waypoints reached.",
        " ".join([*_dangers(execution), *_distances(median)]),
        _jump(execution),
        advice,
        command,
        status,
        reasons,
        _main_metrics(report.sections[0]),
    )


def unmoved(transfer: TransferResult) -> Summary:
    """Summarize a transfer without a motion."""
    gap = None if transfer.evaluation is None else transfer.evaluation.adapter.feasibility_gap
    text = "" if gap is None else f"The median distance of the targets to the feasible set is {gap.median:.2f}."
    return Summary(f"{transfer.robot.name} has its targets and was not moved.", text)


def _main_metrics(section: Section) -> tuple[Metric, ...]:
    """Return errors, duration, limits, collisions and the parts of the mean distance."""
    by_key = {one.key: one for one in section.metrics if one.text and one.severity == INFO}
    used = by_key["limits"].value["used"].items()
    by_key["limits"] = Metric("Limits", listed([f"{name} {one['share']:.0%}" for name, one in used]))
    keys = ("distance", "tip_error", "orientation_error", "duration", "limits", "collisions", "mean_distance")
    return tuple(by_key[key] for key in keys if key in by_key)


def mean_distance(execution: Execution) -> Metric:
    """Return the mean distance as the sum of its parts; without a path there is no part of it."""
    infeasible, path, motion = map(float, execution.parts)
    parts = {"infeasible": infeasible, "path": path, "motion": motion}
    if execution.motion.path is None:
        parts = {"infeasible": infeasible + path, "motion": motion}
    total, values = rounded_sum(list(parts.values()))
    text = f"{total} = {' + '.join(f'{name} {value}' for name, value in zip(parts, values, strict=True))}"
    return Metric(
        "Mean distance", text,
        "Infeasible: distance to the feasible set. Path: added by the path constraint. Motion: added by limits and "
        "smoothness.",
        "mean_distance", {"mean": float(np.mean(execution.motion.distance)), **execution.parts._asdict()},
    )  # fmt: skip


def rounded_sum(parts: Sequence[float], decimals: int = 3) -> tuple[str, tuple[str, ...]]:
    """Write a sum and its parts such that the printed parts add up: the largest part takes the rounding error."""
    unit = 10**decimals
    whole, counts = round(sum(parts) * unit), [round(part * unit) for part in parts]
    counts[max(range(len(parts)), key=lambda k: parts[k])] += whole - sum(counts)
    total, *each = (f"{count / unit:.{decimals}f}" for count in (whole, *counts))
    return total, tuple(each)


def _ellipsoids(median: float) -> str:
    if median <= ENOUGH_DISTANCE:
        return "ellipsoids tracked"
    if median <= NEAR_DISTANCE:
        return "ellipsoids approximated"
    return "ellipsoids approximated in part" if median <= 1.2 else "ellipsoids not tracked"  # 1.2: one axis 82 % long


def _position(execution: Execution, few: float = 0.05) -> tuple[str, bool]:
    """Say whether the position is tracked; also whether it is at all but a few waypoints."""
    error = execution.motion.position_error
    if error is None:
        return "", True
    far = far_points(execution.motion)
    if far > few * len(error):
        return "position not tracked", False
    return ("position mostly tracked" if far else "position tracked"), True


def _distances(median: float) -> list[str]:
    if median <= ENOUGH_DISTANCE:
        return []
    return [f"The median distance {median:.2f} corresponds to {in_axes(median)}."]


def _dangers(execution: Execution) -> list[str]:
    """Say why the motion must not run on a robot."""
    room, motion = execution.room, execution.motion
    broken, held = exceeded_limits(motion, execution.plan), int(np.sum(motion.held))
    return [
        *([f"The robot collides in {room.share:.1%} of the time."] if room.known and room.share else []),
        *([f"It exceeds its limits of {listed(list(broken))}."] if broken else []),
        *([f"It was held at {held} control steps, where no answer was found."] if held else []),
    ]


def _jump(execution: Execution) -> str:
    """Say that the position error is largest at a jump of the recording."""
    error, jumps = execution.motion.position_error, execution.plan.jumps
    if error is None or not far_points(execution.motion) or not jumps[int(np.argmax(error))]:
        return ""
    elsewhere = f"; elsewhere it is up to {1e3 * error[~jumps].max():.1f} mm" if not jumps.all() else ""
    return f"The position error is largest where the recording jumps{elsewhere}."


def _next(execution: Execution, transfer: TransferResult | None, on_path: bool, status: str) -> tuple[str, str]:
    """Advise what improves the result most, with its command."""
    motion = execution.motion
    config = execution.config if transfer is None else transfer.config
    slower = _track(execution, config, "slower", speed_scale=0.5 * (config.motion.speed_scale if config else 1.0))
    if exceeded_limits(motion, execution.plan):
        return "Do not run it as it is: give it more time.", slower
    if status == RED:
        return "Do not run it as it is: see the warnings.", ""
    if not on_path and execution.placement is None:
        return "Let the path be placed where the robot reaches it.", _track(execution, config, "placed", "--place")
    if not on_path and motion.position_tolerance > POSITION_TOLERANCE:
        nearer = _track(execution, config, "nearer", position_tolerance=POSITION_TOLERANCE)
        return "The position error uses the given tolerance: reduce it.", nearer
    if not on_path:
        return "The robot is too slow for its path: give it more time.", slower
    if float(np.median(motion.distance)) <= NEAR_DISTANCE:
        first = "Run it" if status == GREEN else "Resolve the warnings before you run it"
        return f"{first}: joints.csv has the motion; --export writes it for ROS 2, MuJoCo and others.", ""
    parts = execution.parts
    if motion.path is not None and parts.path >= max(parts.no_posture, parts.way):
        return "The path constraint dominates the distance: try without it.", _track(
            execution, config, "no-path", path=False
        )
    if parts.way > parts.no_posture:
        return "Limits of the motion dominate the distance: use the whole range of the joints.", _track(
            execution, config, "all", joint_limit_margin=0.0
        )
    better, repeatable = "", config is not None and len(config.recording) == 1
    if transfer is not None and transfer.evaluation is not None and transfer.choice is None:
        better = transfer.evaluation.verdict.recommended
    if transfer is not None and better and better != transfer.method:
        command = f"maniport transfer --config {{folder}}/{CONFIG} --method {better} -o {{folder}}-{better}"
        return (
            f"The targets are infeasible: those of {better} are nearer to the feasible set.",
            command if repeatable else "",
        )
    command = f"maniport view --config {{folder}}/{CONFIG}"
    return "The targets are infeasible: try other methods and base rotations.", command if config else ""


def _track(
    execution: Execution, config: Config | None, suffix: str, *words: str, path: bool = True, **options: float
) -> str:
    """Return the command that repeats the motion with other options, into another folder."""
    if config is None:
        return ""
    changed = [word for name, value in options.items() for word in OPTIONS[name][1].words(value)]
    if isinstance(config.motion.orientation, str) and config.motion.orientation != FREE:
        changed += ["--orientation", FREE]  # a profile has no hand to follow
    with_path = path and execution.motion.path is not None
    files = [f"{{folder}}/placed_profile.npz --config {{folder}}/{CONFIG}", *["--path {folder}/path.npz"] * with_path]
    return " ".join(["maniport track", *files, *words, *changed, f"-o {{folder}}-{suffix}"])
