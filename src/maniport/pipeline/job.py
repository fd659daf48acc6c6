"""The main job as one function: recording in, frozen result out."""

import time as clock
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec, load_arm
from maniport.defaults import DAMPING, METHOD, PERSON, ROBOT
from maniport.demonstrations import ArmFit, Recording, fit_arm, read_recording
from maniport.domain import sample_domain
from maniport.errors import ManiportWarning
from maniport.evaluation import Evaluation, evaluate
from maniport.pipeline.execution import Execution, follow
from maniport.pipeline.result import TransferResult
from maniport.spd.regularization import Regularization
from maniport.steps import Progress
from maniport.tracking import Control, StartBank
from maniport.tracking.arm_model import why_not_trackable
from maniport.transfer import DomainAdapter, method_of, name_of
from maniport.validation import Array, as_count, as_number, as_rotation

BESIDE = ("raw-copy", "recentring", "parallel-transport")
"""What the chosen method is compared with."""


def transfer_recording(
    recording: Recording | str | Path,
    person: str = PERSON,
    robot: Arm | str | Path = ROBOT,
    method: str | DomainAdapter = METHOD,
    *,
    spec: EllipsoidSpec = VELOCITY,
    markers: Mapping[str, Sequence[str]] | None = None,
    mounting: ArrayLike | None = None,
    damping: float | None = DAMPING,
    floor: float | None = None,
    n_teacher: int = 4096,
    n_student: int = 16384,
    move: bool = True,
    tempo: float = 1.0,
    random_state: int = 0,
    progress: Progress | None = None,
    **control: Any,
) -> TransferResult:
    """Turn a recording of a person's arm into the motion of a robot that makes the target ellipsoids.

    Parameters
    ----------
    recording : Recording, str or Path
        A recording, or a file of one (BVH, C3D).
    person : str
        The model of the human arm, one of `maniport.bodies.PERSONS`; it is scaled to the recording's segment lengths.
    robot : Arm, str or Path
        An arm, the name of one, or its URDF or MJCF file.
    method : str or DomainAdapter
        How the domains are mapped: a name in `maniport.transfer.METHODS`, or an adapter of
        which a clone is fitted.
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
    **control
        How the robot follows: rate, limits, tasks of one's own and more; see `maniport.tracking.Control`.

    Raises
    ------
    ManiportError
        When an input cannot be used.
    """
    Regularization(damping, floor), Control(**control)  # a wrong value shall be told before any long work
    seed, pace = as_count(random_state, "random_state", minimum=0), as_number(tempo, "tempo", above=0.0)
    turn = np.eye(3) if mounting is None else as_rotation(mounting, "mounting", 3)
    job = _Job(
        person,
        robot if isinstance(robot, Arm) else load_arm(robot),
        method_of(method, damping=damping, floor=floor, mounting=turn, random_state=seed),
        spec,
        turn,
        (as_count(n_teacher, "n_teacher", minimum=2), as_count(n_student, "n_student", minimum=2)),
        pace if move else None,
        control,
        seed,
        progress or (lambda step, fraction, found="": None),
    )
    return job.run(recording, markers)


@dataclass(frozen=True)
class _Job:
    """What was asked for, checked; `run` reads as the data flows."""

    person: str
    robot: Arm
    adapter: DomainAdapter
    spec: EllipsoidSpec
    mounting: Array
    sizes: tuple[int, int]
    tempo: float | None
    control: Mapping[str, Any]
    seed: int
    tell: Progress

    def run(self, recording: Recording | str | Path, markers: Mapping[str, Sequence[str]] | None) -> TransferResult:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            motion = self.read(recording)
            fit = fit_arm(motion, self.person, markers, progress=self.tell)
            demonstrated = fit.arm.ellipsoids(fit.joint_angles, self.spec)
            teacher, student = self.sample(fit.arm)
            seconds = self.fit(teacher, student)
            target = self.adapter.transform(demonstrated)
            generator = np.random.default_rng(self.seed)
            bank = self.bank(generator)
            execution = None if bank is None else self.execute(fit, target, bank, generator)
            evaluation = self.judge(teacher, student, demonstrated, bank)
        return TransferResult(
            recording=motion,
            fit=fit,
            robot=self.robot,
            method=name_of(self.adapter),
            adapter=self.adapter,
            time=fit.time,
            demonstrated_profile=demonstrated,
            target_profile=target,
            execution=execution,
            teacher_domain=teacher,
            student_domain=student,
            evaluation=evaluation,
            seconds_to_fit=seconds,
            random_state=self.seed,
            spec=self.spec,
            mounting=self.mounting,
            warnings=tuple(str(one.message) for one in caught if issubclass(one.category, ManiportWarning)),
        )

    def read(self, recording: Recording | str | Path) -> Recording:
        self.tell("read the recording", 0.0)
        motion = recording if isinstance(recording, Recording) else read_recording(recording)
        self.tell("read the recording", 1.0, f"{len(motion)} frames, {motion.duration:.1f} s at {motion.rate:.4g} Hz")
        return motion

    def sample(self, person: Arm) -> tuple[Array, Array]:
        """The domains of the person's arm and of the robot."""
        step, (n, m) = "sample both domains", self.sizes
        self.tell(step, 0.0)
        teacher = sample_domain(person, n, self.seed, spec=self.spec)
        student = sample_domain(self.robot, m, self.seed + 1, spec=self.spec)
        self.tell(step, 1.0, f"{n} ellipsoids of {person.name}, {m} of {self.robot.name}")
        return teacher, student

    def fit(self, teacher: Array, student: Array) -> float:
        """Fit the adapter; return the seconds that it took."""
        self.tell("fit the adapter", 0.0)
        started = clock.perf_counter()
        self.adapter.fit(teacher, student)
        seconds = clock.perf_counter() - started
        self.tell("fit the adapter", 1.0, f"{self.adapter.n_iter_} iterations; {self.adapter.stop_reason_}")
        return seconds

    def bank(self, generator: np.random.Generator) -> StartBank | None:
        """Where searches for the robot's motion begin; None where it shall or can not move."""
        if self.tempo is None:
            return None
        if reason := why_not_trackable(self.robot, self.spec):
            warnings.warn(f"the robot was not moved: {reason}", ManiportWarning, stacklevel=2)
            return None
        return StartBank.build(self.robot, random_state=generator, spec=self.spec.velocity)

    def execute(self, fit: ArmFit, target: Array, bank: StartBank, generator: np.random.Generator) -> Execution:
        """Let the robot follow the target ellipsoids along the person's hand path."""
        # a force ellipsoid is the inverse of the velocity ellipsoid, and distances are the same between inverses
        force, own = self.spec.kind == "force", self.adapter.student_regularization
        found = follow(
            self.robot,
            np.linalg.inv(target) if force else target,
            fit.time,
            fit.arm.forward(fit.joint_angles)[:, :3, 3],
            turn=self.adapter.turn_,
            spec=self.spec.velocity,
            damping=own if own.epsilon > 0.0 and not force else DAMPING,
            tempo=self.tempo or 1.0,
            bank=bank,
            random_state=generator,
            progress=self.tell,
            **self.control,
        )
        return replace(found, random_state=self.seed)

    def judge(self, teacher: Array, student: Array, demonstrated: Array, bank: StartBank | None) -> Evaluation:
        """Measure what was done beside doing less."""
        return evaluate(
            self.adapter,
            teacher,
            student,
            demonstrated,
            robot=self.robot,
            spec=self.spec,
            rows=BESIDE,
            bank=bank if self.spec.kind == "velocity" else None,
            n_domain=0,
            draws=0,
            random_state=self.seed,
            progress=self.tell,
        )
