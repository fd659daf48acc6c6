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

from maniport.bodies import Arm, EllipsoidSpec
from maniport.bodies.human import hand_rotations
from maniport.defaults import DAMPING
from maniport.demonstrations import ArmFit, Recording, fit_arm, read_recording
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning, RecordingError
from maniport.evaluation import Choice, Evaluation, choose, evaluate
from maniport.feasibility import knowing
from maniport.pipeline.execution import Execution, controls, follow
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.result import TransferResult
from maniport.steps import Progress
from maniport.thinning import evenly
from maniport.tracking import PlanControl, Planner, StartBank
from maniport.tracking.arm_model import why_not_trackable
from maniport.transfer import DomainAdapter, name_of
from maniport.validation import Array

T = TypeVar("T")

Fitted = tuple[DomainAdapter, tuple[str, ...]]
"""A fitted adapter, and what its fit warned of."""

FREE, DEMONSTRATED = "free", "demonstrated"
"""Two ways in which the robot's tip may be turned."""

FEWEST = 3
"""Frames without which there is no motion to judge."""

BESIDE = ("raw-copy", "recentring", "parallel-transport")
"""What the chosen method is compared with."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What a recording shows: the person's arm, its ellipsoids (n, d, d) and the path of its hand (n, 3) [m]."""

    recording: Recording
    fit: ArmFit
    demonstrated: Array
    hand: Array
    warnings: tuple[str, ...] = ()

    def thinned(self, rate: float) -> "Shown":
        """Show no more than so many moments a second [Hz], as evenly as the frames allow."""
        count = max(FEWEST, int(np.ceil(np.ptp(self.fit.time) * rate)) + 1)
        rows = evenly(len(self.fit), count)
        return replace(self, fit=self.fit.thinned(count), demonstrated=self.demonstrated[rows], hand=self.hand[rows])


@dataclass(frozen=True, eq=False)
class KnownRobot:
    """What is known of a robot before it is shown anything, so that many recordings may share it.

    Attributes
    ----------
    planner : Planner or None
        None where the robot shall or can not move.
    domain : ndarray, shape (m, d, d)
    random : numpy.random.Generator
        As the planner left it: each motion draws from a copy, so that none depends on another.
    warnings : tuple of str
    """

    planner: Planner | None
    domain: Array
    random: np.random.Generator
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Job:
    """What was asked for, checked; `run` reads as the data flows."""

    whose: Mapping[str, Any]
    """What `fit_arm` is told of the person."""
    robot: Arm
    adapter: DomainAdapter | Mapping[str, Any]
    """Unfitted; or the regularisation and the mounting of one that is to be chosen."""
    spec: EllipsoidSpec
    mounting: Array
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
        found, said = _warned(lambda: self._shown(recording))
        return replace(found, warnings=said)

    def known(self) -> KnownRobot:
        """Get to know the robot."""
        found, said = _warned(self._known)
        return replace(found, warnings=said)

    def transferred(self, shown: Shown, known: KnownRobot, given: Fitted | None = None) -> TransferResult:
        """What becomes of a recording on a robot.

        Parameters
        ----------
        shown : Shown
        known : KnownRobot
            Of this robot, by this job.
        given : tuple of DomainAdapter and its warnings, optional
            As `fit_adapter` gives it for such a person; it is not judged beside simpler ways then.
        """
        adapter, before = given or (None, ())
        result, said = _warned(lambda: self._transferred(shown, known, adapter))
        every = dict.fromkeys((*shown.warnings, *known.warnings, *before, *said))
        return replace(result, warnings=tuple(every))

    def fit_adapter(self, person: Arm, known: KnownRobot) -> Fitted:
        """Fit the adapter of the job, where none is to be chosen, to a person's arm."""
        (adapter, _), said = _warned(lambda: self.fitted(person, self.teacher(person), known, None))
        return adapter, said

    def _transferred(self, shown: Shown, known: KnownRobot, given: DomainAdapter | None) -> TransferResult:
        fit, demonstrated = shown.fit, shown.demonstrated
        teacher, started = self.teacher(fit.arm), clock.perf_counter()
        adapter, choice = (given, None) if given is not None else self.fitted(fit.arm, teacher, known, demonstrated)
        seconds = clock.perf_counter() - started
        target = adapter.transform(demonstrated)
        execution = None if known.planner is None else self.execute(adapter, fit, target, shown.hand, known)
        judged = None if choice is None else choice.evaluation
        if judged is None and given is None:
            judged = self.judge(adapter, teacher, known, demonstrated)
        return TransferResult(
            recording=shown.recording,
            fit=fit,
            robot=self.robot,
            method=name_of(adapter),
            adapter=adapter,
            time=fit.time,
            demonstrated_profile=demonstrated,
            target_profile=target,
            execution=execution,
            teacher_domain=teacher,
            student_domain=known.domain,
            evaluation=judged,
            seconds_to_fit=seconds,
            random_state=self.seed,
            spec=self.spec,
            mounting=self.mounting,
            warnings=(),
            choice=choice,
        )

    def _shown(self, given: Recording | LearnedProfile | str | Path) -> Shown:
        if isinstance(given, LearnedProfile):
            if given.spec != self.spec:
                raise InvalidInputError(f"spec must be that of what was learned, {given.spec}; found {self.spec}")
            return Shown(given.reference.recording, given.reference.fit, given.profile, given.path)
        motion = self.read(given)
        fit = fit_arm(motion, **self.whose, progress=self.tell)
        if len(fit) < FEWEST:
            raise RecordingError(
                f"frames of {motion.source!r} that show the arm: {len(fit)}; at least {FEWEST} are needed"
            )
        path = fit.arm.forward(fit.joint_angles)[:, :3, 3]
        return Shown(motion, fit, fit.arm.ellipsoids(fit.joint_angles, self.spec), path)

    def read(self, recording: Recording | str | Path) -> Recording:
        """Read a recording, which is a motion."""
        self.tell("read the recording", 0.0)
        motion = recording if isinstance(recording, Recording) else read_recording(recording)
        if len(motion) < FEWEST:
            raise RecordingError(f"frames of {motion.source!r}: {len(motion)}; at least {FEWEST} are needed")
        self.tell("read the recording", 1.0, f"{len(motion)} frames, {motion.duration:.1f} s at {motion.rate:.4g} Hz")
        return motion

    def _known(self) -> KnownRobot:
        random = np.random.default_rng(self.seed)
        planner = self.planner(random)
        step, count = "sample the robot's domain", self.sizes[1]
        self.tell(step, 0.0)
        apart = None if planner is None else planner.collisions
        domain = sample_domain(self.robot, count, self.seed + 1, spec=self.spec, collisions=apart)
        self.tell(step, 1.0, f"{count} ellipsoids of {self.robot.name}")
        return KnownRobot(planner, domain, random)

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

    def teacher(self, person: Arm) -> Array:
        """The domain of the person's arm."""
        step, count = "sample the person's domain", self.sizes[0]
        self.tell(step, 0.0)
        domain = sample_domain(person, count, self.seed, spec=self.spec)
        self.tell(step, 1.0, f"{count} ellipsoids of {person.name}")
        return domain

    def fitted(
        self, person: Arm, teacher: Array, known: KnownRobot, demonstrated: Array | None
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
        self.tell("fit the adapter", 0.0)
        adapter = knowing(self.adapter, self.robot, self.spec, bank, self.seed)
        adapter.fit(teacher, known.domain)
        self.tell("fit the adapter", 1.0, f"{adapter.n_iter_} iterations; {adapter.stop_reason_}")
        return adapter, None

    def execute(
        self,
        adapter: DomainAdapter,
        fit: ArmFit,
        target: Array,
        hand: Array,
        known: KnownRobot,
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
            planner=known.planner,
            random_state=copy.deepcopy(known.random),
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

    def judge(self, adapter: DomainAdapter, teacher: Array, known: KnownRobot, demonstrated: Array) -> Evaluation:
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


def _warned(work: Callable[[], T]) -> tuple[T, tuple[str, ...]]:
    """Work, and what it warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        found = work()
    return found, tuple(str(one.message) for one in caught if issubclass(one.category, ManiportWarning))
