"""The study that shows what a transfer from a human arm to the Panda is worth: six motions, every measure."""

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.bodies import Arm, load_arm
from maniport.defaults import AUTO, DAMPING, ROBOT, STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.demonstrations import fit_arm, read_recording, shipped_recording
from maniport.domain import sample_domain
from maniport.errors import ManiportWarning
from maniport.evaluation.alternatives import ROWS
from maniport.evaluation.choice import choose
from maniport.evaluation.report import Evaluation, evaluate
from maniport.evaluation.rows import RAW_COPY, RECENTRING, TRANSPORT
from maniport.evaluation.rule import (
    FEASIBLE,
    FEASIBLE_AT_95,
    RESTLESS,
    ROUGH,
    SHUFFLED,
    TURNED,
    UNSTEADY,
    WORTH_WHILE,
)
from maniport.feasibility import knowing
from maniport.steps import Progress, Step
from maniport.studies.paper import trajectories
from maniport.telling.facts import Facts
from maniport.telling.of_evaluation import COLUMNS, evaluation_section
from maniport.telling.renderings import as_markdown
from maniport.thinning import evenly
from maniport.transfer import DomainAdapter, method_of, name_of
from maniport.validation import Array

FRAMES = 150
"""Ellipsoids that a recording is thinned to, evenly over its frames."""

DEARER = ("icp", "lengths-field")
"""Methods that stand in every table beside the cheap alternatives."""

RULE = (
    "Where no method is named (`maniport transfer`, `transfer_recording`, `maniport.evaluation.choose`), the least "
    "that does the job is taken:",
    "",
    f"1. A method is sound unless its largest step is more than {ROUGH:g} times the teacher's own, half of its steps "
    f"are zero, it turns the longest axes by more than {TURNED:g}° (median), it fails the identity test (more than "
    f"{RESTLESS:g}), or its rotation differs by more than {UNSTEADY:g}° between draws.",
    f"2. A sound method does the job where the feasibility gap is at most {FEASIBLE:g} in the mean and "
    f"{FEASIBLE_AT_95:g} at 95 %, of the motion's ellipsoids and of held-out samples of the person's.",
    "3. Of those that do the job the first of raw copy, recentring, parallel transport, ICP and the field of lengths "
    "is taken. What comes after it is not tried.",
    f"4. Where none does, the first sound one whose mean gap no other undercuts by more than {1.0 - WORTH_WHILE:.0%}.",
    "",
    "The same rule says what is recommended where a method was named. That a method mixes up near and far (rank "
    f"correlation of distances below {SHUFFLED:g}) is told and does not forbid it: where the robot cannot make what "
    "would keep the order, following loses it in any case.",
)

RECORDINGS = {"ladder": "a person climbs a ladder (BVH)", "freeform": "free arm motion (C3D)"}

EVALUATIONS = {
    "H-Eval-1": "sideways motion of the extended arm at 140° elevation",
    "H-Eval-2": "elbow fold",
    "H-Eval-3": "elbow and shoulder fold",
    "H-Eval-4": "upward motion of the extended arm in the plane of 60°",
}


@dataclass(frozen=True)
class Motion:
    """A motion of a human arm.

    Attributes
    ----------
    name, about : str
    person : Arm
        The arm that made it; its base frame is the trunk.
    profile : ndarray, shape (n, 3, 3)
        Velocity ellipsoids of the hand along it.
    """

    name: str
    about: str
    person: Arm
    profile: Array


def motions(names: Iterable[str] | None = None) -> tuple[Motion, ...]:
    """Return the four evaluation motions of Reithmeir et al. 2022 (rHuMan), then the two shipped recordings (MyoArm).

    Parameters
    ----------
    names : iterable of str, optional
        Only these. Default: all six.
    """
    wanted = (*EVALUATIONS, *RECORDINGS) if names is None else tuple(names)
    found = []
    person, paths = trajectories.human_arm(), trajectories.human_evaluation()
    for name in wanted:
        if name in EVALUATIONS:
            found.append(Motion(name, EVALUATIONS[name], person, person.manipulability(paths[name])))
        else:
            with warnings.catch_warnings():  # that models and people differ: nobody can mend it here
                warnings.simplefilter("ignore", ManiportWarning)
                fit = fit_arm(read_recording(shipped_recording(name)))
            chosen = evenly(len(fit), FRAMES)
            ellipsoids = fit.arm.manipulability(fit.joint_angles[chosen])
            found.append(Motion(name, RECORDINGS[name], fit.arm, ellipsoids))
    return tuple(found)


def study(
    methods: Iterable[str] = (AUTO,),
    names: Iterable[str] | None = None,
    random_state: int = 0,
    n_jobs: int | None = None,
    progress: Progress | None = None,
    further: Mapping[str, type[DomainAdapter]] | None = None,
    **options: Any,
) -> dict[tuple[str, str], tuple[Motion, Evaluation]]:
    """Evaluate methods on the motions, by (motion, method).

    The robot is the Panda with its default end effector, as in `maniport transfer`. Its base frame is the person's
    trunk, so that the mounting is known. Damping 0.01, all else by default.

    Parameters
    ----------
    methods : iterable of str
        Names in `maniport.transfer.METHODS`, or "auto", which chooses for each motion. ICP and the field of lengths are
        rows of every table anyway, and so are the cheap alternatives.
    names : iterable of str, optional
        Motions; see `motions`.
    random_state : int
        Seed of domains, draws and adapters.
    n_jobs : int, optional
        Processes for the feasibility gap.
    progress : callable, optional
        Called with the name of each evaluation and the fraction done.
    further : mapping of str to type, optional
        Classes of adapters that stand in further rows, by their names.
    **options
        Passed on to `evaluate`.
    """
    methods, robot = tuple(methods), load_arm(ROBOT)
    student = sample_domain(robot, STUDENT_SAMPLES, random_state + 1)
    options = {"rows": (*ROWS, *DEARER), **options}
    found = {}
    for motion in motions(names):
        teacher = sample_domain(motion.person, TEACHER_SAMPLES, random_state)
        for method in methods:
            tell = Step(progress, f"{motion.name}, {method}" if len(methods) > 1 else motion.name)
            known: dict[str, Any] = {"damping": DAMPING, "mounting": np.eye(3)}
            if method == AUTO:
                arms: dict[str, Any] = {"robot": robot, "person": motion.person, "random_state": random_state}
                adapter = choose(teacher, student, motion.profile, **arms, **known).adapter
            else:
                adapter = knowing(method_of(method, random_state=random_state, **known), robot).fit(teacher, student)
            more = {name: kind(**known) for name, kind in (further or {}).items()}
            evaluation = evaluate(
                adapter,
                teacher,
                student,
                motion.profile,
                robot=robot,
                person=motion.person,
                name=name_of(adapter),
                fitted={name: one.fit(teacher, student) for name, one in more.items()},
                random_state=random_state,
                n_jobs=n_jobs,
                **options,
            )
            found[motion.name, method] = (motion, evaluation)
            tell.end(f"{evaluation.adapter.name} beside {len(evaluation.rows) - 1} more")
    return found


def study_page(results: Mapping[tuple[str, str], tuple[Motion, Evaluation]], on_robots: str = "") -> str:
    """Write the study as a page in Markdown: a summary of feasibility gaps, the rule, then every table.

    `on_robots` is a section of its own that stands after the summary; see ``scripts/lengths_on_robot.py``.
    """
    shown = (RAW_COPY, RECENTRING, TRANSPORT, *DEARER)
    lines = [
        "# Human arm → Panda: is it better than doing nothing?",
        "",
        "Every number here is measured by `python scripts/evaluate_human_to_panda.py`, whatever it is. The person "
        "stands where the robot is mounted and faces the same way, and that is given. The end effector of the Panda is "
        f"`{load_arm(ROBOT).frame}`, the default. Singular ellipsoids are damped ({DAMPING:g}). Distances are "
        "affine-invariant: 0.1 is one axis that is 5 % too long, 0.5 one that is 28 % too long.",
        "",
        "## In short",
        "",
        "Mean feasibility gap: how far what is asked of the Panda is from what it can make.",
        "",
        f"| motion | method | {' | '.join(shown)} |",
        f"|---|---|{'---|' * len(shown)}",
    ]
    for (name, _), (_, evaluation) in results.items():
        gaps = {row.name: row.feasibility_gap for row in evaluation.rows if row.feasibility_gap is not None}
        cells = (f"{gaps[one].mean:.3f}" if one in gaps else "–" for one in shown)
        lines.append(f"| {name} | {evaluation.adapter.name} | {' | '.join(cells)} |")
    lines += ["", "## Which method is taken", "", *RULE, ""]
    if on_robots:
        lines += [on_robots.strip(), ""]
    rows = [row for _, one in results.values() for row in one.rows]
    columns = [column for column in COLUMNS if any(map(column.cell, rows))]
    lines += ["## What the columns mean", "", *(f"- {column.head}: {column.about}" for column in columns), ""]
    for (name, _), (motion, evaluation) in results.items():
        title = f"{name}, {evaluation.adapter.name}: {motion.about}"
        facts = Facts(title, "", (evaluation_section(evaluation, explained=False),))
        lines += [as_markdown(facts, level=2)]
    return "\n".join(lines)
