"""A run beside a robot that keeps the person's elbow angle instead of the ellipsoids."""

from collections.abc import Sequence
from dataclasses import replace

from maniport.errors import InvalidInputError
from maniport.evaluation import ElbowBaseline
from maniport.evaluation.elbow_row import with_elbow
from maniport.pipeline.result import TransferResult
from maniport.steps import Progress, Step


def beside_elbow(
    result: TransferResult, frames: Sequence[str] | None = None, progress: Progress | None = None
) -> TransferResult:
    """Return a run with the row "elbow" in its evaluation; all else stays.

    The baseline's tip has the path of the run's motion; where the robot was not moved, one that is laid shoulder on
    shoulder. Where no elbow is known of the robot, the row says so.

    Parameters
    ----------
    result : TransferResult
    frames : sequence of three str, optional
        Of the robot, at shoulder, elbow and wrist; see `maniport.evaluation.ElbowBaseline`.
    progress : callable, optional
        Called with the name of the step and the fraction done.

    Raises
    ------
    UnknownNameError
        When the robot has no such frame.
    InvalidInputError
        When the run was not judged, so that there is nothing to stand beside.

    See Also
    --------
    maniport.evaluation.ElbowBaseline : what is put beside.
    TransferResult : what comes out.
    """
    if result.evaluation is None:
        raise InvalidInputError("result must have an evaluation, in which the row stands; found one without")
    step = Step(progress, "keep the elbow instead")
    execution = result.execution
    placement, path = (None, None) if execution is None else (execution.placement, execution.motion.path)
    baseline = ElbowBaseline(result.fit.arm, result.fit.joint_angles, placement, frames, path)
    evaluation = result.evaluation
    rows = with_elbow(evaluation.rows, baseline, result.adapter, result.demonstrated_profile, result.robot, result.spec)
    step.end()
    return replace(result, evaluation=replace(evaluation, rows=rows))
