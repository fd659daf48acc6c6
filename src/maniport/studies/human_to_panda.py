"""The study of transfers from a human arm to the Panda: six motions, every metric."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.arms import Arm, load_arm
from maniport.domain import sample_domain
from maniport.errors import ManiportWarning
from maniport.evaluation import Evaluation, choose, evaluate
from maniport.evaluation.baselines import BASELINES, LOOKUP
from maniport.feasibility import knowing
from maniport.mocap import fit_arm, read_recording, shipped_recording
from maniport.studies.paper import trajectories
from maniport.transfer import DomainAdapter, method_of, name_of
from maniport.util.defaults import AUTO, DAMPING, ROBOT, STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.progress import Progress, Step
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

FITTED_METHODS = ("icp", "length-field")  # Methods in every table besides the baselines

RECORDINGS = {"ladder": "a person climbs a ladder (BVH)", "freeform": "free arm motion (C3D)"}

EVALUATIONS = {
    "H-Eval-1": "sideways motion of the extended arm at 140° elevation",
    "H-Eval-2": "elbow fold",
    "H-Eval-3": "elbow and shoulder fold",
    "H-Eval-4": "upward motion of the extended arm in the plane of 60°",
}


@dataclass(frozen=True)
class Motion:
    """A motion of a human arm."""

    name: str
    about: str
    person: Arm  # its base frame is the trunk
    profile: Array  # (n, 3, 3), velocity ellipsoids of the hand


def motions(names: Iterable[str] | None = None) -> tuple[Motion, ...]:
    """Return the evaluation motions of Reithmeir et al. 2022 (rHuMan) and the recordings, 150 ellipsoids each."""
    wanted = (*EVALUATIONS, *RECORDINGS) if names is None else tuple(names)
    found = []
    person, paths = trajectories.human_arm(), trajectories.human_evaluation()
    for name in wanted:
        if name in EVALUATIONS:
            found.append(Motion(name, EVALUATIONS[name], person, person.manipulability(paths[name])))
        else:
            with warnings.catch_warnings():  # models and people differ
                warnings.simplefilter("ignore", ManiportWarning)
                fit = fit_arm(read_recording(shipped_recording(name)))
            chosen = evenly_spaced(len(fit), 150)
            ellipsoids = fit.arm.manipulability(fit.joint_angles[chosen])
            found.append(Motion(name, RECORDINGS[name], fit.arm, ellipsoids))
    return tuple(found)


def study(
    methods: Iterable[str] = (AUTO,),
    names: Iterable[str] | None = None,
    random_state: int = 0,
    progress: Progress | None = None,
    further: Iterable[type[DomainAdapter]] = (),
    rows: Sequence[str] = (*BASELINES, LOOKUP, *FITTED_METHODS),
) -> dict[tuple[str, str], tuple[Motion, Evaluation]]:
    """Evaluate methods on the motions, by (motion, method)."""
    methods, robot = tuple(methods), load_arm(ROBOT)
    student = sample_domain(robot, STUDENT_SAMPLES, random_state + 1)
    found = {}
    for motion in motions(names):
        teacher = sample_domain(motion.person, TEACHER_SAMPLES, random_state)
        for method in methods:
            tell = Step(progress, f"{motion.name}, {method}" if len(methods) > 1 else motion.name)
            known: dict[str, Any] = {"damping": DAMPING, "base_rotation": np.eye(3)}
            if method == AUTO:
                adapter = choose(
                    teacher, student, motion.profile, robot=robot, random_state=random_state, **known
                ).adapter
            else:
                adapter = knowing(method_of(method, random_state=random_state, **known), robot).fit(teacher, student)
            evaluation = evaluate(
                adapter,
                teacher,
                student,
                motion.profile,
                robot=robot,
                person=motion.person,
                name=name_of(adapter),
                random_state=random_state,
                rows=(*rows, *(kind(**known) for kind in further)),
            )
            found[motion.name, method] = (motion, evaluation)
            tell.end(f"{evaluation.adapter.name} and {len(evaluation.rows) - 1} more")
    return found
