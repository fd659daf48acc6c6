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
from maniport.evaluation.rule import RESTLESS, ROUGH, UNSTEADY, WORTH_WHILE
from maniport.feasibility import knowing
from maniport.steps import Progress, Step
from maniport.studies.paper import trajectories
from maniport.subsample import evenly_spaced
from maniport.telling.metrics import Report
from maniport.telling.renderings import as_markdown
from maniport.telling.transfer import COLUMNS, evaluation_section
from maniport.transfer import DomainAdapter, method_of, name_of
from maniport.transfer.lengths.report import AXIS_MOVED, LEAST_STRUCTURE, MOST_CONTRARY, MOST_MOVED, MOST_REVERSING
from maniport.validation import Array

FRAMES = 150
"""Ellipsoids that a recording is thinned to, evenly over its frames."""

DEARER = ("icp", "lengths-field")
"""Methods that stand in every table beside the cheap alternatives."""

RULE = (
    "Where no method is named (`maniport transfer`, `transfer_recording`, `maniport.evaluation.choose`), the length "
    "field is taken if it passes these checks on 400 held-out samples of the person's ellipsoids, else parallel "
    "transport:",
    "",
    f"1. It reverses orientation at no more than {MOST_REVERSING:.0%} of them.",
    f"2. The own-axis slope is positive for all axes but at {MOST_CONTRARY:.0%} of them: where it is not, lengthening "
    "an axis shortens its image.",
    f"3. It moves the longest axis, where it is distinct, by more than {AXIS_MOVED:g}° at no more than "
    f"{MOST_MOVED:.0%}.",
    f"4. The rank correlation of distances (structure) is at least {LEAST_STRUCTURE:g}.",
    "",
    "The limits separate two groups of fits, each for three persons (rHuMan, freeform, ladder), 4096 and 16384 samples "
    "and 1000 new ones (`python scripts/lengths_table.py` prints such figures):",
    "",
    "| arm | joints | orientation-reversing | own-axis slope ≤ 0 | axis moved > 10° | structure | chosen |",
    "|---|---|---|---|---|---|---|",
    "| Panda | 7 | 0 % | 0 % | 0 % | 0.97–0.99 | length field |",
    "| xArm7 | 7 | 0 % | 0 % | 0 % | 0.97–0.99 | length field |",
    "| Talos | 7 | 0–1 % | 0 % | 0 % | 0.96–0.97 | length field |",
    "| Tiago | 7 | 1–2 % | 0 % | 0–2 % | 0.97–0.98 | length field |",
    "| Jaco | 6 | 1–7 % | 0–2 % | 0 % | 0.93–0.94 | length field |",
    "| G1 | 7 | 3–6 % | 0 % | 0 % | 0.93–0.94 | length field |",
    "| UR5 | 6 | 11–19 % | 7–15 % | 0 % | 0.84–0.91 | parallel transport |",
    "| Z1 | 6 | 13–19 % | 11–14 % | 0 % | 0.86–0.89 | parallel transport |",
    "| IRB140 (from its dimensions) | 6 | 13–26 % | 22–28 % | 0–3 % | 0.77–0.83 | parallel transport |",
    "| G1 to the wrist pitch | 5 | 14–26 % | 4–7 % | 1–3 % | 0.89–0.91 | parallel transport |",
    "| G1 to the wrist roll | 4 | 17–29 % | 7–12 % | 4–6 % | 0.90 | parallel transport |",
    "| SO-100 | 5 | 19–22 % | 12–18 % | 0–12 % | 0.76–0.81 | parallel transport |",
    "| iCub | 7 | 27–33 % | 23–28 % | 7–11 % | 0.77–0.78 | parallel transport |",
    "",
    "A comparison recommends the first method whose mean gap no other undercuts by more than "
    f"{1.0 - WORTH_WHILE:.0%}, among those that pass these checks and have no other weakness: a largest step above "
    f"{ROUGH:g} times the teacher's own, half of the steps zero, the longest axes turned by more than {AXIS_MOVED:g}° "
    f"(median), an identity test above {RESTLESS:g}, or a rotation that differs by more than {UNSTEADY:g}° between "
    "draws.",
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
    """Return the four evaluation motions of Reithmeir et al. 2022 (rHuMan)."""
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
            chosen = evenly_spaced(len(fit), FRAMES)
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
    """Evaluate methods on the motions, by (motion, method)."""
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
    """Write the study as a page in Markdown: a summary of feasibility gaps, the rule, then every table."""
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
        facts = Report(title, "", (evaluation_section(evaluation, explained=False),))
        lines += [as_markdown(facts, level=2)]
    return "\n".join(lines)
