"""The main job as one function: recording in, frozen result out."""

import time as clock
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from maniport.bodies import Arm, load_arm
from maniport.demonstrations import ArmFit, Recording, fit_arm, read_recording
from maniport.domain import sample_domain
from maniport.errors import ManiportWarning
from maniport.pipeline.execution import Execution, follow
from maniport.pipeline.result import TransferResult
from maniport.spd.neighbors import nearest
from maniport.spd.regularization import Regularization
from maniport.steps import Progress
from maniport.tracking.arm_model import why_not_trackable
from maniport.transfer import METHODS, DomainAdapter, ParallelTransport, RiemannianICP
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.validation import Array, as_choice, as_count, as_rotation

__all__ = ["TransferResult", "identity_test", "make_adapter", "transfer_recording"]

IDENTITY_SAMPLES = 4096
FRESH_SAMPLES = 1024


def transfer_recording(
    recording: Recording | str | Path,
    person: str = "myoarm",
    robot: Arm | str | Path = "panda",
    method: str = "icp",
    *,
    kind: str = "velocity",
    part: str = "translation",
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
    """Turn a recording of a person's arm into the motion of a robot that makes the adapted ellipsoids.

    Parameters
    ----------
    recording : Recording, str or Path
        A recording, or a file of one (BVH, C3D).
    person : {"myoarm", "rhuman"}
        The model of the human arm; it is scaled to the recording's segment lengths.
    robot : Arm, str or Path
        An arm, the name of one, or its URDF or MJCF file.
    method : {"icp", "parallel-transport", "nearest-neighbor"}
        How the domains are mapped.
    kind, part : str
        Which ellipsoids; see `Arm.manipulability`.
    markers : mapping of str to sequence of str, optional
        Points of the recording by role, where their names are not recognised; see `fit_arm`.
    mounting : array_like, shape (3, 3), optional
        Rotation from the person's trunk frame (x forward, y left, z up) to the robot's base frame. Default: the
        identity; the robot then faces where the person faces.
    damping, floor : float, optional
        Regularisation of singular ellipsoids; see `maniport.spd.regularization`.
    n_teacher, n_student : int
        Sizes of the sampled domains.
    move : bool
        Whether the robot shall follow; False ends with its wanted ellipsoids.
    tempo : float
        Speed of the robot's motion over the person's; robots are often slower.
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
    seed = as_count(random_state, "random_state", minimum=0)
    ellipsoids = {"kind": kind, "part": part}
    student = robot if isinstance(robot, Arm) else load_arm(robot)
    adapter = make_adapter(method, damping, floor, mounting_for(mounting, part), seed)

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)

        tell("read the recording", 0.0)
        motion = recording if isinstance(recording, Recording) else read_recording(recording)
        tell("read the recording", 1.0, f"{len(motion)} frames, {motion.duration:.1f} s at {motion.rate:.4g} Hz")

        fit = fit_arm(motion, person, markers, progress=progress)
        profile = fit.arm.manipulability(fit.joint_angles, **ellipsoids)

        tell("sample both domains", 0.0)
        teacher_domain = sample_domain(fit.arm, n_teacher, seed, **ellipsoids)
        student_domain = sample_domain(student, n_student, seed + 1, **ellipsoids)
        tell("sample both domains", 1.0, f"{n_teacher} ellipsoids of {fit.arm.name}, {n_student} of {student.name}")

        tell("fit the adapter", 0.0)
        started = clock.perf_counter()
        adapter.fit(teacher_domain, student_domain)
        seconds = clock.perf_counter() - started
        tell("fit the adapter", 1.0, f"{adapter.n_iter_} iterations; {adapter.stop_reason_}")

        adapted = adapter.transform(profile)

        execution, unmoved = None, why_not_trackable(student, adapted.shape[-1]) if move else ""
        if move and not unmoved:
            options = {"tempo": tempo, "random_state": seed, "progress": tell}
            execution = _execute(student, fit, adapter, adapted, mounting, ellipsoids, **options)

        tell("compare with doing less", 0.0)
        fresh = sample_domain(student, FRESH_SAMPLES, seed + 2, **ellipsoids)
        transport = make_adapter("parallel-transport", damping, floor, mounting_for(mounting, part), seed)
        transport.fit(teacher_domain, student_domain)
        gaps = _sample_gaps({method: adapter, "parallel-transport": transport}, profile, student_domain, fresh)
        identity = identity_test(student, damping, floor, seed, **ellipsoids)
        told = ", ".join(f"{name} {value:.3f}" for name, value in identity.items())
        tell("compare with doing less", 1.0, f"identity test (truth 0): {told}")

    return TransferResult(
        recording=motion,
        fit=fit,
        robot=student,
        method=method,
        adapter=adapter,
        time=fit.time,
        teacher_profile=profile,
        student_profile=adapted,
        execution=execution,
        teacher_domain=teacher_domain,
        student_domain=student_domain,
        sample_gaps=gaps,
        identity_rmse=identity,
        seconds_to_fit=seconds,
        random_state=seed,
        kind=kind,
        part=part,
        warnings=(
            *(str(one.message) for one in caught if issubclass(one.category, ManiportWarning)),
            *([f"the robot was not moved: {unmoved}"] if unmoved else []),
        ),
    )


def _execute(
    robot: Arm,
    fit: ArmFit,
    adapter: DomainAdapter,
    adapted: Array,
    mounting: ArrayLike | None,
    ellipsoids: Mapping[str, str],
    **options: Any,
) -> Execution:
    """Let the robot follow the adapted ellipsoids along the person's hand path."""
    # a force ellipsoid is the inverse of the velocity ellipsoid, and distances are the same between inverses
    force = ellipsoids["kind"] == "force"
    floor = float(adapter.student_damping_) if adapter.student_damping_ > 0 and not force else None
    rigid = isinstance(adapter, RigidAdapter) and adapted.shape[-1] == 3
    return follow(
        robot,
        np.linalg.inv(adapted) if force else adapted,
        fit.time,
        fit.arm.forward(fit.joint_angles)[:, :3, 3],
        turn=adapter.turn_ if rigid else mounting_for(mounting, "translation"),
        part=ellipsoids["part"],
        floor=floor,
        **options,
    )


def make_adapter(
    method: str,
    damping: float | None = 0.01,
    floor: float | None = None,
    mounting: ArrayLike | None = None,
    random_state: int = 0,
) -> DomainAdapter:
    """Build an unfitted adapter by the method's name; see `maniport.transfer.METHODS`."""
    as_choice(method, "method", tuple(METHODS))
    Regularization(damping, floor)  # a wrong value shall be told before any long work
    options: dict[str, Any] = {"damping": damping, "floor": floor}
    if method != "nearest-neighbor":
        options["mounting"] = mounting
    if method == "icp":
        options["random_state"] = random_state
    return METHODS[method](**options)


def mounting_for(mounting: ArrayLike | None, part: str) -> Array:
    """Return the rotation of ellipsoids, shape (d, d), for a rotation between base frames; None is the identity."""
    turn = np.eye(3) if mounting is None else as_rotation(mounting, "mounting", 3)
    return np.asarray(block_diag(turn, turn)) if part == "full" else turn


def identity_test(
    robot: Arm, damping: float | None = 0.01, floor: float | None = None, random_state: int = 0, **ellipsoids: Any
) -> dict[str, float]:
    """Fit a robot's domain to itself, from two disjoint draws of 4096; the truth is to change nothing.

    Returns
    -------
    dict of str to float
        Root mean squared distance between each ellipsoid and its image, undivided, by method. Zero would be perfect.
    """
    first = sample_domain(robot, IDENTITY_SAMPLES, random_state + 3, **ellipsoids)
    second = sample_domain(robot, IDENTITY_SAMPLES, random_state + 4, **ellipsoids)
    same = np.eye(first.shape[-1])
    methods = {
        "parallel-transport": ParallelTransport(damping, floor, mounting=same),
        "icp": RiemannianICP(damping, floor, mounting=same),
    }
    return {
        name: float(np.sqrt(np.mean(adapter.fit(first, second).errors(first, first) ** 2)))
        for name, adapter in methods.items()
    }


def _sample_gaps(adapters: dict[str, DomainAdapter], profile: Array, domain: Array, fresh: Array) -> dict[str, float]:
    """Median distance to the nearest of the robot's samples: for fresh ones of its own, a raw copy, each adapter."""
    adapter = next(iter(adapters.values()))
    own = adapter.student_regularization
    cloud = own.apply(domain, "domain")
    table = {
        "robot's own fresh samples": nearest(own.apply(fresh, "fresh"), cloud)[1],
        "raw copy": nearest(own.apply(profile, "profile"), cloud)[1],
    }
    table |= {name: one.gaps(profile, domain) for name, one in adapters.items()}
    return {name: float(np.median(gaps)) for name, gaps in table.items()}
