"""The work of the main job in its parts: what a recording shows, what is known of a robot, what becomes of both."""

import copy
import time as clock
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from maniport.arms import Arm, EllipsoidSpec
from maniport.arms.human import hand_rotations
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning, RecordingError
from maniport.evaluation import Choice, Evaluation, choose, evaluate
from maniport.feasibility import knowing
from maniport.mocap import ArmFit, Recording, fit_arm, read_recording
from maniport.motion import PlanControl, Planner, SeedBank
from maniport.motion.arm_model import why_not_trackable
from maniport.motion.objective import Damping
from maniport.motion.plan.planner import ArmPlanner
from maniport.pipeline.execution import Execution
from maniport.pipeline.follow import controls, follow
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.parts import FEWEST, Fitted, RobotModel, Shown, TransferOutput
from maniport.pipeline.result import TransferResult
from maniport.transfer import DomainAdapter, LengthField, name_of
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress
from maniport.util.validation import Array

T = TypeVar("T")

FREE, DEMONSTRATED = "free", "demonstrated"  # Two ways in which the robot's tip may be turned

BESIDE = ("identity", "mean-transport", "parallel-transport")  # What the chosen method is compared with


@dataclass(frozen=True)
class Job:
    """What was asked for, checked; `run` reads as the data flows."""

    whose: Mapping[str, Any]  # What `fit_arm` is told of the person
    robot: Arm
    adapter: DomainAdapter | Mapping[str, Any]
    """Unfitted; or the regularisation and the base_rotation of one that is to be chosen."""
    spec: EllipsoidSpec
    base_rotation: Array
    sizes: tuple[int, int]
    orientation: str | ArrayLike
    control: Mapping[str, Any]
    move: bool
    seed: int
    tell: Progress

    @property
    def chooses(self) -> bool:
        """Whether the method is chosen by each recording."""
        return not isinstance(self.adapter, DomainAdapter)

    def run(self, recording: Recording | LearnedProfile | str | Path) -> TransferResult:
        """Do all of it for one recording."""
        with threadpool_limits(1):  # those of BLAS would wait for one another, and round sums otherwise elsewhere
            return self.transferred(self.shown(recording), self.known())

    def shown(self, recording: Recording | LearnedProfile | str | Path) -> Shown:
        """Fit the person's arm; of several demonstrations take what was learned."""
        found, said = warned(lambda: self._shown(recording))
        return replace(found, warnings=said)

    def known(self) -> RobotModel:
        """Get to know the robot."""
        found, said = warned(self._known)
        return replace(found, warnings=said)

    def transferred(self, shown: Shown, known: RobotModel, given: Fitted | None = None) -> TransferResult:
        """What becomes of a recording on a robot."""
        adapter, before = given or (None, ())
        result, said = warned(lambda: self._transferred(shown, known, adapter))
        every = dict.fromkeys((*shown.warnings, *known.warnings, *before, *said))
        return replace(result, warnings=tuple(every))

    def fit_adapter(self, person: Arm, known: RobotModel) -> Fitted:
        """Fit the adapter of the job, where none is to be chosen, to a person's arm."""
        (adapter, _), said = warned(lambda: self.fitted(person, self.teacher(person), known, None))
        return adapter, said

    def _transferred(self, shown: Shown, known: RobotModel, given: DomainAdapter | None) -> TransferResult:
        found = self.adapted(shown, known, given)
        execution = None if known.planner is None else self.execute(found, shown, known)
        return self.result(shown, known, found, execution, judged=given is None)

    def adapted(self, shown: Shown, known: RobotModel, given: DomainAdapter | None = None) -> TransferOutput:
        """What the robot is asked for, by the adapter that is given, or one that is fitted now."""
        person = shown.fit.arm
        teacher, started = self.teacher(person), clock.perf_counter()
        adapter, choice = given, None
        if adapter is None:
            adapter, choice = self.fitted(person, teacher, known, shown.demonstrated)
        seconds = clock.perf_counter() - started
        return TransferOutput(adapter, adapter.transform(shown.demonstrated), teacher, seconds, choice)

    def result(
        self, shown: Shown, known: RobotModel, found: TransferOutput, execution: Execution | None, judged: bool
    ) -> TransferResult:
        """All of it, `judged` beside simpler ways."""
        evaluation = None if found.choice is None else found.choice.evaluation
        if evaluation is None and judged:
            evaluation = self.judge(found.adapter, found.teacher, known, shown.demonstrated)
        return TransferResult(
            recording=shown.recording,
            fit=shown.fit,
            robot=self.robot,
            method=name_of(found.adapter),
            adapter=found.adapter,
            time=shown.fit.time,
            demonstrated_profile=shown.demonstrated,
            target_profile=found.target,
            execution=execution,
            teacher_domain=found.teacher,
            student_domain=known.domain,
            evaluation=evaluation,
            seconds_to_fit=found.seconds,
            random_state=self.seed,
            spec=self.spec,
            base_rotation=self.base_rotation,
            warnings=(),
            choice=found.choice,
        )

    def shown_by(self, motion: Recording, fit: ArmFit) -> Shown:
        """What a recording shows to which an arm was fitted."""
        if len(fit) < FEWEST:
            raise RecordingError(
                f"frames of {motion.source!r} that show the arm: {len(fit)}; at least {FEWEST} are needed"
            )
        path = fit.arm.forward(fit.joint_angles)[:, :3, 3]
        return Shown(motion, fit, fit.arm.ellipsoids(fit.joint_angles, self.spec), path)

    def _shown(self, given: Recording | LearnedProfile | str | Path) -> Shown:
        if isinstance(given, LearnedProfile):
            if given.spec != self.spec:
                raise InvalidInputError(f"spec must be that of what was learned, {given.spec}; found {self.spec}")
            return Shown(given.reference.recording, given.reference.fit, given.profile, given.path)
        motion = self.read(given)
        return self.shown_by(motion, fit_arm(motion, **self.whose, progress=self.tell))

    def read(self, recording: Recording | str | Path) -> Recording:
        """Read a recording, which is a motion."""
        self.tell("Read recording", 0.0)
        motion = recording if isinstance(recording, Recording) else read_recording(recording)
        if len(motion) < FEWEST:
            raise RecordingError(f"frames of {motion.source!r}: {len(motion)}; at least {FEWEST} are needed")
        self.tell("Read recording", 1.0, f"{len(motion)} frames, {motion.duration:.1f} s at {motion.rate:.4g} Hz")
        return motion

    def _known(self) -> RobotModel:
        random = np.random.default_rng(self.seed)
        planner = self.planner(random)
        step, count = "Sample robot ellipsoids", self.sizes[1]
        self.tell(step, 0.0)
        apart = None if planner is None else planner.collisions
        domain = sample_domain(self.robot, count, self.seed + 1, spec=self.spec, collisions=apart)
        self.tell(step, 1.0, f"{count} ellipsoids of {self.robot.name}")
        return RobotModel(planner, domain, random)

    def planner(self, generator: np.random.Generator) -> Planner | None:
        """What plans the robot's motion; None where it shall or can not move."""
        if not self.move:
            return None
        if reason := why_not_trackable(self.robot, self.spec):
            warnings.warn(f"the robot was not moved: {reason}", ManiportWarning, stacklevel=2)
            return None
        self.tell("Sample robot", 0.0)
        planner = PlanControl(**controls(self.control)[0]).planner(self.robot, self.spec.velocity, generator)
        self.tell("Sample robot", 1.0, f"{len(planner.arms[0].reachability_map)} postures")
        return planner

    def bank(self, planner: Planner | ArmPlanner | None) -> SeedBank | None:
        """The planner's samples of the robot where they are of these ellipsoids."""
        if planner is None or self.spec.kind != "velocity":
            return None
        return planner.bank if isinstance(planner, ArmPlanner) else planner.arms[0].bank

    def teacher(self, person: Arm) -> Array:
        """The domain of the person's arm."""
        step, count = "Sample human ellipsoids", self.sizes[0]
        self.tell(step, 0.0)
        domain = sample_domain(person, count, self.seed, spec=self.spec)
        self.tell(step, 1.0, f"{count} ellipsoids of {person.name}")
        return domain

    def fitted(
        self, person: Arm, teacher: Array, known: RobotModel, demonstrated: Array | None
    ) -> tuple[DomainAdapter, Choice | None]:
        """Fit the adapter, or choose one by what was demonstrated; return it and the choice."""
        bank = self.bank(known.planner)
        if not isinstance(self.adapter, DomainAdapter):
            assert demonstrated is not None
            choice = choose(
                teacher, known.domain, demonstrated, person=person, robot=self.robot, spec=self.spec, bank=bank,
                random_state=self.seed, progress=self.tell, **self.adapter,
            )  # fmt: skip
            return choice.adapter, choice
        self.tell("Fit transfer", 0.0)
        adapter = knowing(self.adapter, self.robot, self.spec, bank, self.seed)
        adapter.fit(teacher, known.domain)
        if isinstance(adapter, LengthField) and (failures := adapter.report_.failures()):
            text = "the length field maps this robot badly, parallel-transport does not: " + "; ".join(failures)
            warnings.warn(text, ManiportWarning, stacklevel=2)
        self.tell("Fit transfer", 1.0, f"{adapter.n_iter_} iterations; {adapter.stop_reason_}")
        return adapter, None

    def execute(self, found: TransferOutput, shown: Shown, known: RobotModel) -> Execution:
        """Let the robot follow the target ellipsoids along the person's hand path."""
        profile, damping = self.asked(found)
        followed = follow(
            self.robot,
            profile,
            shown.fit.time,
            shown.hand,
            turn=found.adapter.turn_,
            **self.turned(shown.fit),
            spec=self.spec.velocity,
            damping=damping,
            planner=known.planner if isinstance(known.planner, Planner) else None,
            random_state=copy.deepcopy(known.random),
            progress=self.tell,
            **self.control,
        )
        return replace(followed, random_state=self.seed)

    def asked(self, found: TransferOutput) -> tuple[Array, Damping]:
        """The velocity ellipsoids that the robot shall make, and what is added before they are compared."""
        # a force ellipsoid is the inverse of the velocity ellipsoid, and distances are the same between inverses
        force, own = self.spec.kind == "force", found.adapter.student_regularization
        profile = np.asarray(np.linalg.inv(found.target)) if force else found.target
        return profile, own if own.epsilon > 0.0 and not force else DAMPING

    def turned(self, fit: ArmFit) -> dict[str, Any]:
        """How the robot's tip shall be turned."""
        if not isinstance(self.orientation, str):
            return {"direction": self.orientation}
        if self.orientation == FREE:
            return {}
        hand = hand_rotations(fit.arm, fit.joint_angles)
        return {"rotations": hand if self.orientation == DEMONSTRATED else np.broadcast_to(hand[0], hand.shape)}

    def judge(self, adapter: DomainAdapter, teacher: Array, known: RobotModel, demonstrated: Array) -> Evaluation:
        """Measure what was done beside simpler ways."""
        return evaluate(
            adapter,
            teacher,
            known.domain,
            demonstrated,
            robot=self.robot,
            spec=self.spec,
            rows=BESIDE,
            bank=self.bank(known.planner),
            n_domain=0,
            draws=0,
            random_state=self.seed,
            progress=self.tell,
        )


def warned(work: Callable[[], T]) -> tuple[T, tuple[str, ...]]:
    """Work, and what it warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        found = work()
    return found, tuple(str(one.message) for one in caught if issubclass(one.category, ManiportWarning))
