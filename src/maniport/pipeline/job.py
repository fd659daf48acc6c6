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
from maniport.bodies.human import hand_rotations
from maniport.defaults import AUTO, DAMPING, KEEP, METHOD, PERSON, ROBOT
from maniport.demonstrations import ArmFit, Recording, fit_arm, read_recording
from maniport.demonstrations.arm_fit import require_person
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning, RecordingError
from maniport.evaluation import Choice, Evaluation, choose, evaluate
from maniport.feasibility import knowing
from maniport.pipeline.execution import Execution, controls, facing, follow
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.result import TransferResult
from maniport.spd.regularization import Regularization
from maniport.steps import Progress
from maniport.tracking import PlanControl, Planner, StartBank
from maniport.tracking.arm_model import why_not_trackable
from maniport.transfer import COMPETITORS, METHODS, DomainAdapter, method_of, name_of
from maniport.validation import Array, as_choice, as_count, as_rotation

ORIENTATIONS = FREE, DEMONSTRATED, _ = "free", "demonstrated", "constant"
"""How the robot's tip may be turned."""

FEWEST = 3
"""Frames without which there is no motion to judge."""

BESIDE = ("raw-copy", "recentring", "parallel-transport")
"""What the chosen method is compared with."""


def transfer_recording(
    recording: Recording | LearnedProfile | str | Path,
    person: str = PERSON,
    robot: Arm | str | Path = ROBOT,
    method: str | DomainAdapter = METHOD,
    *,
    spec: EllipsoidSpec = VELOCITY,
    markers: Mapping[str, Sequence[str]] | None = None,
    side: str = AUTO,
    height: float | None = None,
    smooth: str | float = AUTO,
    leaps: str = KEEP,
    mounting: ArrayLike | None = None,
    damping: float | None = DAMPING,
    floor: float | None = None,
    n_teacher: int = 4096,
    n_student: int = 16384,
    move: bool = True,
    orientation: str | ArrayLike = "free",
    random_state: int = 0,
    progress: Progress | None = None,
    **control: Any,
) -> TransferResult:
    """Turn a recording of a person's arm into the motion of a robot that makes the target ellipsoids.

    Parameters
    ----------
    recording : Recording, LearnedProfile, str or Path
        A recording, a file of one, or what `maniport.learn` made of several, for which the next six are known.
    person, markers, side, height, smooth, leaps : optional
        The model of the human arm, points of the recording by role, which arm of the person, the body height [m], what
        is done about jitter and leaps; see `fit_arm`.
    robot : Arm, str or Path
        An arm, the name of one, or its URDF or MJCF file.
    method : str or DomainAdapter
        How the domains are mapped: a name in `maniport.transfer.METHODS`, an adapter, of which a clone is fitted, or
        "auto": the least that does the job, see `maniport.evaluation.choose`.
    spec : EllipsoidSpec
        Which ellipsoids.
    mounting : array_like, shape (3, 3), optional
        Rotation from the person's trunk frame (x forward, y left, z up) to the robot's base frame. Default: the
        identity; the robot then faces where the person faces.
    damping, floor : float, optional
        Regularization of singular ellipsoids; see `maniport.spd.regularization`.
    n_teacher, n_student : int
        Sizes of the sampled domains, at least 2.
    move : bool
        Whether the robot shall follow; False ends with its target ellipsoids.
    orientation : {"free", "demonstrated", "constant"} or array_like of shape (3,)
        How the robot's tip is turned: as serves the ellipsoids best, like the person's hand, like that at the start, or
        z in a direction of the base frame. See `maniport.bodies.human.hand_rotations`, `keep`, `orientation_weight`.
    random_state, progress : optional
        Seed of everything that is drawn; called with the name of a step and the fraction done.
    **control
        How the robot's motion is planned, such as tip_tolerance, tempo or home, and, with options of the tracker, such
        as tasks and limits of one's own, followed step by step. See `maniport.pipeline.execution.follow`.

    Raises
    ------
    ManiportError
        When an input cannot be used.
    """
    require_person(person, side, height, smooth, leaps)  # a wrong value shall be told before any long work
    body = robot if isinstance(robot, Arm) else load_arm(robot)
    seed = as_count(random_state, "random_state", minimum=0)
    whose = {"person": person, "markers": markers, "side": side, "height": height, "smooth": smooth, "leaps": leaps}
    turn = np.eye(3) if mounting is None else as_rotation(mounting, "mounting", 3)
    return _Job(
        whose,
        body,
        _adapter(method, seed, {"damping": damping, "floor": floor, "mounting": turn}),
        spec,
        turn,
        (as_count(n_teacher, "n_teacher", minimum=2), as_count(n_student, "n_student", minimum=2)),
        move,
        orientation,
        checked_control(body, control, orientation, move),
        seed,
        progress or (lambda step, fraction, found="": None),
    ).run(recording)


def _adapter(method: str | DomainAdapter, seed: int, shared: dict[str, Any]) -> DomainAdapter | dict[str, Any]:
    """Make an unfitted adapter, or return what that one will get which is to be chosen."""
    Regularization(shared["damping"], shared["floor"])
    if isinstance(method, str) and as_choice(method, "method", (AUTO, *METHODS, *COMPETITORS)) == AUTO:
        return shared
    return method_of(method, random_state=seed, **shared)


def checked_control(robot: Arm, given: Mapping[str, Any], orientation: str | ArrayLike, move: bool) -> dict[str, Any]:
    """Options of the motion, looked up for the robot where it shall move; raise what says which is wrong."""
    planning, tracking = controls(given)
    settings = PlanControl(**planning)
    if isinstance(orientation, str):
        as_choice(orientation, "orientation", ORIENTATIONS)
    else:
        facing(orientation, settings.keep)
    if not move:
        return dict(given)
    ready = settings.resolved(robot)
    return {**planning, **tracking, "motion_limits": ready.motion_limits, "collisions": ready.collisions}


@dataclass(frozen=True)
class _Job:
    """What was asked for, checked; `run` reads as the data flows."""

    whose: Mapping[str, Any]
    """What `fit_arm` is told of the person."""
    robot: Arm
    adapter: DomainAdapter | Mapping[str, Any]
    """Unfitted; or the regularisation and the mounting of one that is to be chosen."""
    spec: EllipsoidSpec
    mounting: Array
    sizes: tuple[int, int]
    move: bool
    orientation: str | ArrayLike
    control: Mapping[str, Any]
    seed: int
    tell: Progress

    def run(self, recording: Recording | LearnedProfile | str | Path) -> TransferResult:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            motion, fit, demonstrated, hand = self.demonstrated(recording)
            generator = np.random.default_rng(self.seed)
            planner = self.planner(generator)
            teacher, student = self.sample(fit.arm, planner)
            started = clock.perf_counter()
            bank = self.bank(planner)
            adapter, choice = self.fitted(fit.arm, teacher, student, demonstrated, bank)
            seconds = clock.perf_counter() - started
            target = adapter.transform(demonstrated)
            execution = None if planner is None else self.execute(adapter, fit, target, hand, planner, generator)
            judged = choice.evaluation if choice else self.judge(adapter, teacher, student, demonstrated, bank)
        return TransferResult(
            recording=motion,
            fit=fit,
            robot=self.robot,
            method=name_of(adapter),
            adapter=adapter,
            time=fit.time,
            demonstrated_profile=demonstrated,
            target_profile=target,
            execution=execution,
            teacher_domain=teacher,
            student_domain=student,
            evaluation=judged,
            seconds_to_fit=seconds,
            random_state=self.seed,
            spec=self.spec,
            mounting=self.mounting,
            warnings=tuple(str(one.message) for one in caught if issubclass(one.category, ManiportWarning)),
            choice=choice,
        )

    def demonstrated(self, shown: Recording | LearnedProfile | str | Path) -> tuple[Recording, ArmFit, Array, Array]:
        """The recording, the person's arm, its ellipsoids and the path of its hand; of several, what was learned."""
        if isinstance(shown, LearnedProfile):
            if shown.spec != self.spec:
                raise InvalidInputError(f"spec must be that of what was learned, {shown.spec}; found {self.spec}")
            return shown.reference.recording, shown.reference.fit, shown.profile, shown.path
        motion = self.read(shown)
        fit = fit_arm(motion, **self.whose, progress=self.tell)
        if len(fit) < FEWEST:
            raise RecordingError(
                f"frames of {motion.source!r} that show the arm: {len(fit)}; at least {FEWEST} are needed"
            )
        path = fit.arm.forward(fit.joint_angles)[:, :3, 3]
        return motion, fit, fit.arm.ellipsoids(fit.joint_angles, self.spec), path

    def read(self, recording: Recording | str | Path) -> Recording:
        self.tell("read the recording", 0.0)
        motion = recording if isinstance(recording, Recording) else read_recording(recording)
        if len(motion) < FEWEST:
            raise RecordingError(f"frames of {motion.source!r}: {len(motion)}; at least {FEWEST} are needed")
        self.tell("read the recording", 1.0, f"{len(motion)} frames, {motion.duration:.1f} s at {motion.rate:.4g} Hz")
        return motion

    def planner(self, generator: np.random.Generator) -> Planner | None:
        """What plans the robot's motion; None where it shall or can not move."""
        if not self.move:
            return None
        if reason := why_not_trackable(self.robot, self.spec):
            warnings.warn(f"the robot was not moved: {reason}", ManiportWarning, stacklevel=2)
            return None
        self.tell("get to know the robot", 0.0)
        planner = PlanControl(**controls(self.control)[0]).planner(self.robot, self.spec.velocity, generator)
        self.tell("get to know the robot", 1.0, f"{len(planner.atlas.q)} postures")
        return planner

    def bank(self, planner: Planner | None) -> StartBank | None:
        """The planner's samples of the robot where they are of these ellipsoids."""
        return planner.bank if planner is not None and self.spec.kind == "velocity" else None

    def sample(self, person: Arm, planner: Planner | None) -> tuple[Array, Array]:
        """The domains of the person's arm and of the robot, which does not collide where it shall move."""
        step, (n, m) = "sample both domains", self.sizes
        self.tell(step, 0.0)
        teacher = sample_domain(person, n, self.seed, spec=self.spec)
        apart = None if planner is None else planner.collisions
        student = sample_domain(self.robot, m, self.seed + 1, spec=self.spec, collisions=apart)
        self.tell(step, 1.0, f"{n} ellipsoids of {person.name}, {m} of {self.robot.name}")
        return teacher, student

    def fitted(
        self, person: Arm, teacher: Array, student: Array, demonstrated: Array, bank: StartBank | None
    ) -> tuple[DomainAdapter, Choice | None]:
        """Fit the adapter, or choose one; return it and the choice."""
        if not isinstance(self.adapter, DomainAdapter):
            known: dict[str, Any] = {"person": person, "robot": self.robot, "spec": self.spec, "bank": bank}
            choice = choose(
                teacher, student, demonstrated, random_state=self.seed, progress=self.tell, **known, **self.adapter
            )
            return choice.adapter, choice
        self.tell("fit the adapter", 0.0)
        adapter = knowing(self.adapter, self.robot, self.spec, bank, self.seed)
        adapter.fit(teacher, student)
        self.tell("fit the adapter", 1.0, f"{adapter.n_iter_} iterations; {adapter.stop_reason_}")
        return adapter, None

    def execute(
        self,
        adapter: DomainAdapter,
        fit: ArmFit,
        target: Array,
        hand: Array,
        planner: Planner,
        generator: np.random.Generator,
    ) -> Execution:
        """Let the robot follow the target ellipsoids along the person's hand path."""
        # a force ellipsoid is the inverse of the velocity ellipsoid, and distances are the same between inverses
        force, own = self.spec.kind == "force", adapter.student_regularization
        found = follow(
            self.robot,
            np.linalg.inv(target) if force else target,
            fit.time,
            hand,
            turn=adapter.turn_,
            **self.turned(fit),
            spec=self.spec.velocity,
            damping=own if own.epsilon > 0.0 and not force else DAMPING,
            planner=planner,
            random_state=generator,
            progress=self.tell,
            **self.control,
        )
        return replace(found, random_state=self.seed)

    def turned(self, fit: ArmFit) -> dict[str, Any]:
        """How the robot's tip shall be turned."""
        if not isinstance(self.orientation, str):
            return {"direction": self.orientation}
        if self.orientation == FREE:
            return {}
        hand = hand_rotations(fit.arm, fit.joint_angles)
        return {"rotations": hand if self.orientation == DEMONSTRATED else np.broadcast_to(hand[0], hand.shape)}

    def judge(
        self, adapter: DomainAdapter, teacher: Array, student: Array, demonstrated: Array, bank: StartBank | None
    ) -> Evaluation:
        """Measure what was done beside simpler ways."""
        return evaluate(
            adapter,
            teacher,
            student,
            demonstrated,
            robot=self.robot,
            spec=self.spec,
            rows=BESIDE,
            bank=bank,
            n_domain=0,
            draws=0,
            random_state=self.seed,
            progress=self.tell,
        )
