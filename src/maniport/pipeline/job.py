"""The main job as one function: recording in, frozen result out."""

import time as clock
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec, load_arm
from maniport.demonstrations import ArmFit, Recording, fit_arm, read_recording
from maniport.domain import sample_domain
from maniport.errors import ManiportWarning
from maniport.evaluation import Evaluation, evaluate
from maniport.pipeline.execution import Execution, follow
from maniport.pipeline.result import TransferResult
from maniport.spd.regularization import Regularization
from maniport.steps import Progress
from maniport.tracking.arm_model import why_not_trackable
from maniport.transfer import DomainAdapter, method_of, name_of
from maniport.validation import Array, as_count, as_number, as_rotation


def transfer_recording(
    recording: Recording | str | Path,
    person: str = "myoarm",
    robot: Arm | str | Path = "panda",
    method: str | DomainAdapter = "icp",
    *,
    spec: EllipsoidSpec = VELOCITY,
    markers: Mapping[str, Sequence[str]] | None = None,
    mounting: ArrayLike | None = None,
    damping: float | None = 0.01,
    floor: float | None = None,
    n_teacher: int = 4096,
    n_student: int = 16384,
    move: bool = True,
    tempo: float = 1.0,
    random_state: int = 0,
    progress: Progress | None = None,
) -> TransferResult:
    """Turn a recording of a person's arm into the motion of a robot that makes the target ellipsoids.

    Parameters
    ----------
    recording : Recording, str or Path
        A recording, or a file of one (BVH, C3D).
    person : {"myoarm", "rhuman"}
        The model of the human arm; it is scaled to the recording's segment lengths.
    robot : Arm, str or Path
        An arm, the name of one, or its URDF or MJCF file.
    method : str or DomainAdapter
        How the domains are mapped: a name in `maniport.transfer.METHODS`, or an adapter, of which a clone is fitted.
    spec : EllipsoidSpec
        Which ellipsoids.
    markers : mapping of str to sequence of str, optional
        Points of the recording by role, where their names are not recognised; see `fit_arm`.
    mounting : array_like, shape (3, 3), optional
        Rotation from the person's trunk frame (x forward, y left, z up) to the robot's base frame. Default: the
        identity; the robot then faces where the person faces.
    damping, floor : float, optional
        Regularization of singular ellipsoids; see `maniport.spd.regularization`.
    n_teacher, n_student : int
        Sizes of the sampled domains, at least 2.
    move : bool
        Whether the robot shall follow; False ends with its target ellipsoids.
    tempo : float
        Speed of the robot's motion over the person's, above 0; robots are often slower.
    random_state : int
        Seed of everything that is drawn.
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Returns
    -------
    TransferResult

    Raises
    ------
    ManiportError
        When an input cannot be used.
    """
    tell = progress or (lambda step, fraction, found="": None)
    seed, pace = as_count(random_state, "random_state", minimum=0), as_number(tempo, "tempo", above=0.0)
    sizes = as_count(n_teacher, "n_teacher", minimum=2), as_count(n_student, "n_student", minimum=2)
    student = robot if isinstance(robot, Arm) else load_arm(robot)
    turn = np.eye(3) if mounting is None else as_rotation(mounting, "mounting", 3)
    Regularization(damping, floor)  # a wrong value shall be told before any long work
    adapter = method_of(method, damping=damping, floor=floor, mounting=turn, random_state=seed)
    name = name_of(adapter)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        motion = _read(recording, tell)
        fit = fit_arm(motion, person, markers, progress=progress)
        profile = fit.arm.ellipsoids(fit.joint_angles, spec)
        domains = _sample((fit.arm, student), sizes, seed, spec, tell)
        seconds = _fit(adapter, domains, tell)
        target = adapter.transform(profile)
        unmoved = why_not_trackable(student, spec.size) if move else ""
        execution = None
        if move and not unmoved:
            execution = _execute(student, fit, adapter, target, spec, tempo=pace, random_state=seed, progress=tell)
        evaluation = _judge(adapter, domains, profile, student, spec, seed, tell, name)
    told = [str(one.message) for one in caught if issubclass(one.category, ManiportWarning)]
    return TransferResult(
        recording=motion,
        fit=fit,
        robot=student,
        method=name,
        adapter=adapter,
        time=fit.time,
        demonstrated_profile=profile,
        target_profile=target,
        execution=execution,
        teacher_domain=domains[0],
        student_domain=domains[1],
        evaluation=evaluation,
        seconds_to_fit=seconds,
        random_state=seed,
        spec=spec,
        mounting=turn,
        warnings=(*told, *([f"the robot was not moved: {unmoved}"] if unmoved else [])),
    )


def _read(recording: Recording | str | Path, tell: Progress) -> Recording:
    tell("read the recording", 0.0)
    motion = recording if isinstance(recording, Recording) else read_recording(recording)
    tell("read the recording", 1.0, f"{len(motion)} frames, {motion.duration:.1f} s at {motion.rate:.4g} Hz")
    return motion


def _sample(
    arms: tuple[Arm, Arm], sizes: tuple[int, int], seed: int, spec: EllipsoidSpec, tell: Progress
) -> tuple[Array, Array]:
    tell("sample both domains", 0.0)
    teacher, student = (
        sample_domain(arm, n, seed + k, spec=spec) for k, (arm, n) in enumerate(zip(arms, sizes, strict=True))
    )
    tell("sample both domains", 1.0, f"{sizes[0]} ellipsoids of {arms[0].name}, {sizes[1]} of {arms[1].name}")
    return teacher, student


def _fit(adapter: DomainAdapter, domains: tuple[Array, Array], tell: Progress) -> float:
    """Fit the adapter; return the seconds that it took."""
    tell("fit the adapter", 0.0)
    started = clock.perf_counter()
    adapter.fit(*domains)
    tell("fit the adapter", 1.0, f"{adapter.n_iter_} iterations; {adapter.stop_reason_}")
    return clock.perf_counter() - started


def _execute(
    robot: Arm,
    fit: ArmFit,
    adapter: DomainAdapter,
    target: Array,
    spec: EllipsoidSpec,
    **options: Any,
) -> Execution:
    """Let the robot follow the target ellipsoids along the person's hand path."""
    # a force ellipsoid is the inverse of the velocity ellipsoid, and distances are the same between inverses
    force = spec.kind == "force"
    damping = float(adapter.student_damping_) if adapter.student_damping_ > 0 and not force else None
    return follow(
        robot,
        np.linalg.inv(target) if force else target,
        fit.time,
        fit.arm.forward(fit.joint_angles)[:, :3, 3],
        turn=adapter.turn_,
        part=spec.part,
        floor=damping,
        **options,
    )


def _judge(
    adapter: DomainAdapter,
    domains: tuple[Array, Array],
    profile: Array,
    robot: Arm,
    spec: EllipsoidSpec,
    seed: int,
    tell: Progress,
    name: str,
) -> Evaluation:
    """Measure what was done beside doing less."""
    return evaluate(
        adapter,
        *domains,
        profile,
        robot=robot,
        kind=spec.kind,
        part=spec.part,
        joint_weights=spec.joint_weights,
        name=name,
        n_domain=0,
        draws=0,
        random_state=seed,
        progress=tell,
    )
