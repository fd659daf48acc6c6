"""Convert results of one arm and of both arms to results of several arms, until the pipeline returns these."""

from dataclasses import replace
from typing import Any

from maniport.arms import as_group
from maniport.motion import RobotMotion
from maniport.pipeline import BothResult
from maniport.pipeline import TransferResult as OneResult
from maniport.pipeline.execution import Execution
from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult


def as_result(result: Any) -> Any:
    """Return a `TransferResult` or a `MotionResult` with arms; other results as they are."""
    if isinstance(result, Execution):
        arm = ArmResult(name=result.robot.name, **_moved(result))
        return MotionResult(
            robot=result.robot, arms=(arm,), motion=_of_one(result.robot, arm.motion),
            random_state=result.random_state or 0, config=result.config, sources=result.sources,
        )  # fmt: skip
    if isinstance(result, OneResult):
        arm = _transfer(result, str(result.fit.arm.side or "right"))
        return _whole(result, (arm,), result.robot, _of_one(result.robot, arm.motion), result.warnings, result.config)
    if isinstance(result, BothResult):
        arms = tuple(_transfer(one, side) for side, one in zip(("left", "right"), result.each, strict=True))
        warnings = (*result.warnings, *(text for one in result.each for text in one.warnings))
        return _whole(result.left, arms, result.robot, result.motion, tuple(dict.fromkeys(warnings)), result.config)
    return result


def _whole(one: Any, arms: Any, robot: Any, motion: Any, warnings: tuple[str, ...], config: Any) -> TransferResult:
    return TransferResult(
        robot=robot, arms=arms, motion=motion, random_state=one.random_state, config=config, recording=one.recording,
        spec=one.spec, base_rotation=one.base_rotation, warnings=warnings,
    )  # fmt: skip


def _transfer(one: OneResult, name: str) -> ArmTransfer:
    moved = {"robot": one.robot} if one.execution is None else _moved(one.execution)
    names = ("fit", "method", "adapter", "choice", "evaluation", "time", "demonstrated_profile", "target_profile",
             "teacher_domain", "student_domain", "seconds_to_fit")  # fmt: skip
    return ArmTransfer(name=name, **moved, **{field: getattr(one, field) for field in names})


def _moved(execution: Execution) -> dict[str, Any]:
    plan = execution.plan
    motion = replace(
        execution.motion, demonstrated_time=plan.demonstrated_time, limits=plan.limits,
        pointwise_best=plan.pointwise_best, clearance=execution.room,
    )  # fmt: skip
    names = ("robot", "placement", "free", "gap", "collisions")
    return {"motion": motion, **{name: getattr(execution, name) for name in names}}


def _of_one(robot: Any, motion: Any) -> RobotMotion | None:
    if motion is None:
        return None
    return RobotMotion(as_group(robot), motion, (motion,), limits=motion.limits, clearance=motion.clearance)
