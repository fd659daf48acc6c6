"""The paper's arms in motion, for its report: teacher, student, and the ellipsoids between them."""

import numpy as np

from maniport.bodies import Arm
from maniport.spd import distance
from maniport.studies.paper import human_robot, trajectories, two_dof
from maniport.studies.paper.figures import SHOWN, shown_row
from maniport.studies.paper.outcome import Draw, fit_quietly
from maniport.studies.paper.settings import our_adapter
from maniport.telling.page import Line, Motion, Panel, ellipsoid_panels
from maniport.telling.page.motions import body_of
from maniport.telling.roles import ACHIEVED, PERSON, TARGET
from maniport.transfer import DomainAdapter
from maniport.validation import Array

RATE = 10.0
"""Configurations a second; the paper has no times."""
UNIT = "m/s per rad/s"


def two_dof_motion(seed: int = 0) -> Motion:
    """Both two-joint arms along M-Eval-1, where the truth is the student at the same joint angles."""
    row = shown_row("II", 100, "PT + ICP + w³")
    adapter = our_adapter(row, trajectories.MOUNTING).set_params(random_state=seed)
    known = two_dof.evaluation()
    fit_quietly(adapter, Draw(seed, *two_dof.training(row.samples), known))
    path = trajectories.two_dof_evaluation()["M-Eval-1"]
    teacher, student = trajectories.two_dof_arms()
    note = "M-Eval-1. The adapted ellipsoids should be the vertical arm's own."
    return _motion((teacher, path), (student, path), adapter, 0.4, note)


def human_robot_motion(seed: int = 0) -> Motion:
    """The human arm and the Panda along H-Eval-4; no truth is known there."""
    row = shown_row("III", 25, "PT + ICP")
    adapter = our_adapter(row, human_robot.SAME_FRAME).set_params(random_state=seed)
    fit_quietly(adapter, Draw(seed, *human_robot.training(row.samples), {}))
    person = trajectories.human_arm(), trajectories.human_evaluation()[SHOWN]
    robot = trajectories.robot_arm(), trajectories.robot_evaluation()[SHOWN]
    note = f"{SHOWN}. The Panda follows the hand path only: nothing makes its own ellipsoids the adapted ones."
    return _motion(person, robot, adapter, 0.25, note)


MOVED = {"two-dof": two_dof_motion, "human-robot": human_robot_motion}
"""Who shows an experiment in motion."""


def _motion(
    teacher: tuple[Arm, Array], student: tuple[Arm, Array], adapter: DomainAdapter, size: float, note: str
) -> Motion:
    own = {"teacher": teacher[0].manipulability(teacher[1]), "student": student[0].manipulability(student[1])}
    adapted = adapter.transform(own["teacher"])
    lift = adapter.released_damping_ * np.eye(3)
    apart = distance(adapted + lift, own["student"] + lift)
    span = 0.0, max(0.1, 1.05 * float(apart.max()))
    lines = (Line("", apart),)
    from_own = Panel("Distance from adapted to own", "", lines, "With the damping of the adapter.", span=span)
    names = {PERSON.name: teacher[0].name, TARGET.name: "target", ACHIEVED.name: student[0].name}
    shells = {PERSON.name: own["teacher"], TARGET.name: adapted, ACHIEVED.name: own["student"]}
    person, person_note = body_of(*teacher, {PERSON.name: own["teacher"]})
    robot, robot_note = body_of(*student, {TARGET.name: adapted, ACHIEVED.name: own["student"]})
    scale = f"Shown at {RATE:g} configurations a second; a semi-axis of 1 {UNIT} is drawn {size:g} m long."
    return Motion(
        np.arange(len(teacher[1])) / RATE,
        (person, robot),
        {"Ellipsoids": (from_own, *ellipsoid_panels(shells, names, UNIT))},
        unit=UNIT,
        size=size,
        legend={
            PERSON.name: f"{teacher[0].name}'s ellipsoid",
            TARGET.name: "target (shell)",
            ACHIEVED.name: f"{student[0].name}'s own",
        },
        note=" ".join(filter(None, (note, scale, person_note, robot_note))),
    )
