"""The main job with both arms of a person and of a robot: recording in, frozen result out."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from maniport.arms import VELOCITY, ArmGroup, EllipsoidSpec, load_arms
from maniport.domain import sample_domains
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.mocap import Recording, fit_arms
from maniport.motion import (
    ArmMotion,
    MotionLimits,
    Placement,
    PlanControl,
    Planner,
    RobotMotion,
    feasibility_gap,
    place_paths,
    plan_motion,
)
from maniport.motion.arm_model import why_not_trackable
from maniport.motion.effort import as_effort
from maniport.motion.objective import Damping
from maniport.motion.plan.plan_motion import PLACED, RELATIVE
from maniport.motion.plan.planner import ArmPlanner
from maniport.motion.search.pointwise import interpolated_distance
from maniport.pipeline.both_result import BothResult
from maniport.pipeline.execution import Execution, placed_rows
from maniport.pipeline.follow import controls
from maniport.pipeline.job import checked
from maniport.pipeline.parts import RobotModel, Shown, TransferOutput
from maniport.pipeline.turns import turned_freely, turned_tips
from maniport.pipeline.work import FREE, Job, warned
from maniport.spd.regularization import Regularization
from maniport.transfer import DomainAdapter
from maniport.transfer.rotation_group import orthonormal, rotation_angle
from maniport.util.defaults import AUTO, DAMPING, KEEP, METHOD, PERSON, STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.progress import Progress, untold
from maniport.util.validation import Array, as_choice

KNOW = "Sample robot"
TURNED_APART = 5.0  # Where two adapters turn ellipsoids by more than this apart, that is told [degrees]


def transfer_both(
    recording: Recording | str | Path,
    person: str = PERSON,
    robot: Any = None,
    method: str | DomainAdapter = METHOD,
    *,
    frames: Any = None,
    bases: Any = None,
    lock: Mapping[str, float] | None = None,
    spec: EllipsoidSpec = VELOCITY,
    markers: Mapping[str, Mapping[str, Any]] | None = None,
    height: float | None = None,
    smooth: str | float = AUTO,
    jumps: str = KEEP,
    base_rotation: ArrayLike | None = None,
    damping: float | None = DAMPING,
    eigenvalue_floor: float | None = None,
    n_teacher: int = TEACHER_SAMPLES,
    n_student: int = STUDENT_SAMPLES,
    move: bool = True,
    orientation: str | ArrayLike = FREE,
    tips: str = PLACED,
    random_state: int = 0,
    progress: Progress | None = None,
    **control: Any,
) -> BothResult:
    """Turn a recording of both arms of a person into the motion of two robot arms that make the target ellipsoids.

    The person's left arm becomes the robot's left one and the right the right, each by an adapter between its own
    domains; both hands' paths get one place before the robot, so that the hands keep their relation, and both arms
    one time.

    Parameters
    ----------
    recording : Recording, str or Path
        Of a person whose both arms are recorded, such as the shipped ``"both-arms"``.
    person, markers, height, smooth, jumps : optional
        As in `fit_arms`.
    robot, frames, bases, lock : optional
        `ArmGroup`, or what `maniport.load_arms` takes.
    method, spec, base_rotation, damping, floor, n_teacher, n_student, move, orientation, random_state, progress : optional
        As in `transfer_recording`, for each arm; the base orientation is from the trunk frame to that of the pair.
    tips : {"placed", "relative"}
        Whether the tips are on the paths of the hands, or only as the hands are beside one another.
    **control
        How the motion is planned; see `maniport.motion.plan_motion`.

    Raises
    ------
    ManiportError
        When an input cannot be used; all are checked before any long work.
    """
    arms = _pair(robot, frames, bases, lock)
    specs = arms.specs(spec)
    if not isinstance(spec.joint_weights, str | None):
        raise InvalidInputError("spec: both arms are placed and planned without weights of single joints; found some")
    person_told = {"person": person, "side": AUTO, "height": height, "smooth": smooth, "jumps": jumps}
    settings, tracked = controls(control)
    if tracked:
        raise TypeError(f"unexpected option {sorted(tracked)[0]!r}: both arms are planned, not tracked step by step")
    if as_choice(tips, "tips", (PLACED, RELATIVE)) == RELATIVE and settings.get("workspace") is not None:
        raise InvalidInputError("workspace says where paths are placed; with tips='relative' the tips leave them")
    kept = {"orientation_axes": settings["orientation_axes"]} if "orientation_axes" in settings else {}
    given: dict[str, Any] = {
        "base_rotation": base_rotation, "damping": damping, "eigenvalue_floor": eigenvalue_floor, "n_teacher": n_teacher, "n_student": n_student,
        "move": False, "orientation": orientation, "random_state": random_state, "progress": progress,
    }  # fmt: skip
    left, right = (
        checked(person_told, arm, method, kept, spec=own, **given) for arm, own in zip(arms.arms, specs, strict=True)
    )
    ready = PlanControl(**settings).resolved(arms) if move else None
    whose = {"person": person, "markers": markers, "height": height, "smooth": smooth, "jumps": jumps}
    job = BothJob(arms, (left, right), spec, whose, ready, tips, progress or untold)
    with threadpool_limits(1):
        found, said = warned(lambda: job.run(left.read(recording)))
    return replace(found, warnings=said)


def _pair(robot: Any, frames: Any, bases: Any, lock: Mapping[str, float] | None) -> ArmGroup:
    """The arms that are meant."""
    if isinstance(robot, ArmGroup):
        if any(given is not None for given in (frames, bases, lock)):
            raise InvalidInputError("frames, bases and lock are for robots that are loaded; found them beside ArmGroup")
        return robot
    if robot is None:
        raise InvalidInputError("robot must be a pair of arms, or what maniport.load_arms takes; found none")
    return load_arms(robot, frames, bases=bases, lock=lock)


@dataclass(frozen=True)
class BothJob:
    """What was asked for, checked; `run` reads as the data flows."""

    arms: ArmGroup
    each: tuple[Job, Job]  # What is done for each arm by itself, which does not move alone
    spec: EllipsoidSpec  # Which ellipsoids of both, weights for all joints
    whose: Mapping[str, Any]  # What `fit_arms` is told of the person
    control: PlanControl | None  # How the motion is planned; None where the arms shall not move
    tips: str  # What is kept of the hands' paths
    tell: Progress

    def run(self, motion: Recording) -> BothResult:
        """Do all of it."""
        fits = fit_arms(motion, **self.whose, progress=self.tell)
        shown = [
            replace(job.shown_by(motion, fit), hand=path)
            for job, fit, path in zip(self.each, fits.arms, fits.hands, strict=True)
        ]
        planner = self.planner()
        known = self.known(planner)
        found = [job.adapted(one, robot) for job, one, robot in zip(self.each, shown, known, strict=True)]
        planned: RobotMotion | None = None
        executions: list[Execution | None] = [None, None]
        if planner is not None:
            planned, executions = self.moved(planner, shown, found)
        left, right = (
            job.result(shown[i], known[i], found[i], executions[i], judged=True) for i, job in enumerate(self.each)
        )
        return BothResult(fits, self.arms, left, right, planned, ())

    def planner(self) -> Planner | None:
        """What plans the motion of both; None where they shall or can not move."""
        if self.control is None:
            return None
        for arm, job in zip(self.arms.arms, self.each, strict=True):
            if reason := why_not_trackable(arm, job.spec):
                warnings.warn(f"the robot was not moved: {reason}", ManiportWarning, stacklevel=2)
                return None
        settings, seed = self.control, self.each[0].seed
        assert isinstance(settings.motion_limits, MotionLimits)
        self.tell(KNOW, 0.0)
        planner = Planner.of(
            settings.motion_limits, self.spec.velocity, settings.collisions, np.random.default_rng(seed)
        )
        self.tell(KNOW, 1.0, " and ".join(f"{len(one.reachability_map)} postures" for one in planner.arms))
        return planner

    def known(self, planner: Planner | None) -> tuple[RobotModel, RobotModel]:
        """Get to know what each arm can make, in postures in which neither collides with the other."""
        job, step = self.each[0], "Sample robot ellipsoids"
        self.tell(step, 0.0)
        apart = None if planner is None else planner.collisions
        domains = sample_domains(self.arms, job.sizes[1], job.seed + 1, spec=self.spec, collisions=apart)
        self.tell(step, 1.0, f"{job.sizes[1]} ellipsoids of each")
        planners, random = (None, None) if planner is None else planner.arms, np.random.default_rng(job.seed)
        return RobotModel(planners[0], domains[0], random), RobotModel(planners[1], domains[1], random)

    def moved(
        self, planner: Planner, shown: Sequence[Shown], found: Sequence[TransferOutput]
    ) -> tuple[RobotMotion, list[Execution | None]]:
        """Let the arms follow their target ellipsoids along the paths of the hands, which get one place."""
        assert self.control is not None
        job, settings = self.each[0], self.control
        asked = [one.asked(adapted) for one, adapted in zip(self.each, found, strict=True)]
        profiles, damping = [profile for profile, _ in asked], _stronger([own for _, own in asked])
        time = shown[0].fit.time
        rows = placed_rows(len(time))
        same: dict[str, Any] = {"time": time, "spec": self.spec.velocity, "damping": damping, "progress": self.tell}
        placed = place_paths(
            [one.hand[rows] for one in shown],
            [profile[rows] for profile in profiles],
            [one.limits.arm for one in planner.arms],
            turn=_common_turn([one.adapter.turn_ for one in found]),
            workspace=settings.workspace,
            reachability_maps=[one.reachability_map for one in planner.arms],
            banks=[one.bank for one in planner.arms],
            planning_effort=settings.planning_effort,
            random_state=np.random.default_rng(job.seed),
            **{**same, "time": time[rows]},
        )
        asked_for: dict[str, Any] = {
            "profiles": [one.turned(profile) for one, profile in zip(placed, profiles, strict=True)],
            "paths": [one.apply(each.hand) for one, each in zip(placed, shown, strict=True)],
            "tips": self.tips,
            "planner": planner,
            "pointwise_bests": [interpolated_distance(rows, one.distance, len(time)) for one in placed],
            **{one.name: getattr(settings, one.name) for one in fields(settings)},
            **same,
        }
        rotations, free = self.turned(shown, placed), None
        if rotations is not None:
            quiet = {**asked_for, "progress": turned_freely(self.tell)}
            free = plan_motion(planner.group, **quiet, random_state=np.random.default_rng(job.seed))
        planned = plan_motion(
            planner.group, **asked_for, rotations=rotations, random_state=np.random.default_rng(job.seed)
        )
        freely = (None, None) if free is None else free.arms
        places = placed if self.tips == PLACED else (None, None)
        executions: list[Execution | None] = [
            Execution(arm, place, plan, plan, planned.clearance, self.gap(plan, own), own.collisions, loose, job.seed)
            for arm, place, plan, own, loose in zip(
                self.arms.arms, places, planned.arms, planner.arms, freely, strict=True
            )
        ]
        return planned, executions

    def turned(self, shown: Sequence[Shown], placed: Sequence[Placement]) -> list[Array] | None:
        """How the tips shall be turned, where that counts."""
        assert self.control is not None
        each = [job.turned(one.fit) for job, one in zip(self.each, shown, strict=True)]
        if not any(each):
            return None
        return [
            turned_tips(
                one.get("rotations"), one.get("direction"), place, len(whose.fit), self.control.orientation_axes
            )
            for one, place, whose in zip(each, placed, shown, strict=True)
        ]

    def gap(self, plan: ArmMotion, planner: ArmPlanner) -> Array:
        """Feasibility gap of an arm's targets."""
        assert self.control is not None
        same: dict[str, Any] = {"spec": plan.spec, "damping": plan.damping, "progress": self.tell}
        effort = as_effort(self.control.planning_effort).of_gap
        return feasibility_gap(planner.limits.arm, plan.target, bank=planner.bank, **effort, **same)


def _stronger(dampings: Sequence[Damping]) -> Damping:
    """What is added to the ellipsoids of both: the larger of what the adapters of the arms add."""
    known = [one for one in dampings if isinstance(one, Regularization)]
    return max(known, key=lambda one: one.epsilon) if known else dampings[0]


def _common_turn(turns: Sequence[Array]) -> Array:
    """Rotation of both paths, which keep their relation: between those of the adapters, which turn ellipsoids."""
    apart = float(np.degrees(rotation_angle(turns[0], turns[1])))
    if apart > TURNED_APART:
        warnings.warn(
            f"the adapters of both arms turn ellipsoids {apart:.0f}° apart; the paths of both hands, which keep their "
            "relation, are turned by what is between",
            ManiportWarning,
            stacklevel=2,
        )
    return orthonormal(turns[0] + turns[1])
