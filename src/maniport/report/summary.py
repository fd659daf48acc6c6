"""Summary of a motion: status, outcome of position and ellipsoids of each arm, and the next step."""

import numpy as np

from maniport.motion.status import ENOUGH_DISTANCE, NEAR_DISTANCE
from maniport.pipeline.config import CONFIG, OPTIONS
from maniport.pipeline.options import FREE
from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult
from maniport.report.metrics import in_axes, listed, sentence, status_of
from maniport.report.motion import exceeded_limits, far_points, missed_points
from maniport.report.values import GREEN, RED, Metric, Report, Summary
from maniport.util.defaults import POSITION_TOLERANCE

RUN = "joints.csv has the motion; --export writes it for ROS 2, MuJoCo and others."


def summary_of(result: TransferResult | MotionResult, report: Report) -> Summary:
    """Summarize a result, of which `report` has all sections."""
    if result.motion is None:
        return _unmoved(result)
    status, several = status_of(report.warning_keys), len(result.arms) > 1
    texts = {arm.name: _outcome(arm) for arm in result.arms}
    advice, command = _next(result, status)
    return Summary(
        _joined({name: title for name, (title, _) in texts.items()}),
        _joined({name: text for name, (_, text) in texts.items()}),
        advice,
        "" if several else command,
        status,
        report.warning_keys,
        main_metrics(report),
    )


def main_metrics(report: Report) -> tuple[Metric, ...]:
    """Return the main metrics of all sections; statistics come first, those of one kind together."""
    metrics = [metric for metric in report.metrics if metric.main and metric.text]
    order = list(dict.fromkeys(metric.key for metric in metrics))
    return tuple(sorted(metrics, key=lambda metric: (not metric.is_statistics, order.index(metric.key))))


def _unmoved(result: TransferResult | MotionResult) -> Summary:
    evaluations = (arm.evaluation for arm in result.arms if isinstance(arm, ArmTransfer))
    gaps = [one.adapter.feasibility_gap for one in evaluations if one is not None]
    medians = listed(f"{gap.median:.2f}" for gap in gaps if gap is not None)
    text = f"Median distance of the targets to the feasible set: {medians}." if medians else ""
    return Summary(f"{result.robot.name} has its targets and was not moved.", text)


def _joined(texts: dict[str, str]) -> str:
    """Join texts of arms, with the name of each arm if there are several."""
    if len(texts) == 1:
        return next(iter(texts.values()))
    return " ".join(f"{name.capitalize()}: {text[:1].lower()}{text[1:]}" for name, text in texts.items() if text)


def _outcome(arm: ArmResult) -> tuple[str, str]:
    """Describe position and ellipsoids of an arm in a sentence, and the rest in another."""
    motion = arm.motion
    assert motion is not None
    median, far = float(np.median(motion.distance)), far_points(motion).any()
    position = ""
    if motion.position_error is not None:
        tracked = "not tracked" if not _is_on_path(arm) else "mostly tracked" if far else "tracked"
        position = f"position {tracked}; "
    reached = len(motion.status) - missed_points(motion)
    texts = [f"Median distance {median:.2f}: {in_axes(median)}."] if median > ENOUGH_DISTANCE else []
    if far and motion.position_error is not None and motion.jumps[int(np.argmax(motion.position_error))]:
        texts.append("The position error is largest where the recording jumps.")
    outcome = f"{position}{_ellipsoids(median)}: {reached} of {len(motion.status)} waypoints reached"
    return sentence(outcome), " ".join(texts)


def _ellipsoids(median: float, in_part: float = 1.2) -> str:
    """Grade a median distance; 1.2: one axis is 82 % too long."""
    if median <= ENOUGH_DISTANCE:
        return "ellipsoids tracked"
    if median <= NEAR_DISTANCE:
        return "ellipsoids approximated"
    return "ellipsoids approximated in part" if median <= in_part else "ellipsoids not tracked"


def _is_on_path(arm: ArmResult, few: float = 0.05) -> bool:
    """Return whether the position error is small at all but a few waypoints."""
    return arm.motion is None or float(far_points(arm.motion).mean()) <= few


def _next(result: TransferResult | MotionResult, status: str) -> tuple[str, str]:
    """Advise what improves the result most, with its command; of several arms the worst one decides."""
    if status == RED:
        broken = any(exceeded_limits(arm.motion) for arm in result.arms if arm.motion is not None)
        return ("Do not run it: give it more time.", _slower(result)) if broken else ("Do not run it.", "")
    by_arm = (_next_of_arm(result, arm) for arm in result.arms)
    run_it = "Run it" if status == GREEN else "Resolve the warnings before you run it"
    return next((advice for advice in by_arm if advice[0]), (f"{run_it}: {RUN}", ""))


def _next_of_arm(result: TransferResult | MotionResult, arm: ArmResult) -> tuple[str, str]:
    motion = arm.motion
    assert motion is not None
    if not _is_on_path(arm):
        if arm.placement is None:
            return "Let the path be placed where the robot reaches it.", _track(result, "placed", "--place")
        if motion.position_tolerance > POSITION_TOLERANCE:
            command = _track(result, "nearer", position_tolerance=POSITION_TOLERANCE)
            return "The position error uses the tolerance: reduce it.", command
        return "The robot is too slow for its path: give it more time.", _slower(result)
    if float(np.median(motion.distance)) <= NEAR_DISTANCE:
        return "", ""
    parts = arm.mean_distance
    if motion.path is not None and parts.path >= max(parts.infeasible, parts.motion):
        return "The path constraint dominates the distance: try without it.", _track(result, "no-path", path=False)
    if parts.motion > parts.infeasible:
        command = _track(result, "all", joint_limit_margin=0.0)
        return "Limits dominate the distance: use the whole range of the joints.", command
    return _infeasible(result, arm)


def _infeasible(result: TransferResult | MotionResult, arm: ArmResult) -> tuple[str, str]:
    better, config = "", result.config
    if isinstance(arm, ArmTransfer) and arm.evaluation is not None and arm.choice is None:
        better = arm.evaluation.summary.recommended
    if better and isinstance(arm, ArmTransfer) and better != arm.method:
        text = f"The targets are infeasible: those of {better} are nearer to the feasible set."
        command = f"maniport transfer --config {{folder}}/{CONFIG} --method {better} -o {{folder}}-{better}"
        return text, command if config is not None and len(config.recording) == 1 else ""
    command = f"maniport view --config {{folder}}/{CONFIG}"
    return "The targets are infeasible: try other methods and base rotations.", "" if config is None else command


def _slower(result: TransferResult | MotionResult) -> str:
    return _track(result, "slower", speed_scale=0.5 * (result.config.motion.speed_scale if result.config else 1.0))


def _track(result: TransferResult | MotionResult, suffix: str, *words: str, path: bool = True, **options: float) -> str:
    """Return the command that repeats the motion of one arm with other options, into another folder."""
    config = result.config
    if config is None or len(result.arms) > 1:
        return ""
    changed = [word for name, value in options.items() for word in OPTIONS[name][1].words(value)]
    if isinstance(config.motion.orientation, str) and config.motion.orientation != FREE:
        changed += ["--orientation", FREE]  # a profile has no hand to follow
    if config.placement.place and "--place" not in words:
        changed += ["--no-place"]
    with_path = path and result.arm.motion is not None and result.arm.motion.path is not None
    files = [f"{{folder}}/placed_profile.npz --config {{folder}}/{CONFIG}", *["--path {folder}/path.npz"] * with_path]
    return " ".join(["maniport track", *files, *words, *changed, f"-o {{folder}}-{suffix}"])
