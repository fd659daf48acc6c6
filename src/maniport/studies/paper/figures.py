"""A figure for each figure of the paper's experiments, and its arms in motion, made with our defaults.

Figures go by the names of their files without ending.
"""

import numpy as np
from matplotlib.figure import Figure

from maniport.arms import Arm
from maniport.report import figures
from maniport.report.page import Animation, Line, Panel, Stage
from maniport.report.page.animation import body_of
from maniport.report.page.panels import ellipsoid_panels
from maniport.report.roles import ACHIEVED, PERSON, TARGET
from maniport.spd import distance, powm, whiten
from maniport.spd.matrix_functions import congruence
from maniport.studies.paper import human_robot, known_truth, trajectories
from maniport.studies.paper.outcome import Draw, fit_quietly
from maniport.studies.paper.tables import OURS, TOY, TRAJECTORIES, our_adapter, paper_table
from maniport.transfer import DomainAdapter
from maniport.util.validation import Array

SHOWN = "H-Eval-4"  # The human trajectory that the paper shows: the extended arm moves upwards

RATE = 10.0  # Configurations a second; the paper has no times
UNIT = "m/s per rad/s"

Moved = tuple[Arm, Array]  # An arm and its joint path (n, dof) [rad]


def toy_figures(seed: int = 0) -> dict[str, Figure]:
    """The ten new ellipsoids of the toy data before and after."""
    draw = known_truth.toy_draw(seed)
    adapter = our_adapter(paper_table("I")[1], damping=None).set_params(random_state=seed)
    points, truth = draw.evaluation[TOY[0]]
    fit_quietly(adapter, draw)
    adapted = adapter.transform(points)
    names = ("transformed", "adapted", "Panda's own (truth)")
    return {"toy-ellipsoids": figures.ellipsoid_views(points, adapted, truth, names, count=10)}


def two_dof_figures(seed: int = 0) -> dict[str, Figure]:
    """Both two-joint arms along M-Eval-1, and its ellipsoids before and after; 100 training points, PT + ICP + w³."""
    adapter = _two_dof_adapter(seed)
    points, truth = known_truth.evaluation()["M-Eval-1"]
    adapted = adapter.transform(points)
    teacher, student = _two_dof_pair()
    pair = {"horizontal (teacher)": teacher, "vertical (student)": student}
    names = ("horizontal arm", "adapted", "vertical arm (truth)")
    return {
        "two-dof-arms": _arms(pair, size=0.25),
        "two-dof-ellipsoids": figures.ellipsoid_views(points, adapted, truth, names),
    }


def human_robot_figures(seed: int = 0) -> dict[str, Figure]:
    """Both seven-joint arms along H-Eval-4, its ellipsoids before and after, and the steps of the adaptation."""
    baseline, _ = human_robot.naive_baseline(human_robot.REMEDIES[OURS], seed)
    points, looked_up = human_robot.evaluation(baseline)[SHOWN]
    adapter = _human_robot_adapter(seed)
    teacher, student = human_robot.training(human_robot.ALL)
    person, robot = _human_robot_pair()
    pair = {"rHuMan (teacher)": person, "Panda (student)": robot}
    domains = {
        "person, training": adapter.teacher_side(teacher),
        "Panda, training": adapter.student_side(student),
    }
    names = ("person", "adapted", "naive baseline")
    return {
        "human-robot-arms": _arms(pair, size=0.2),
        "human-robot-ellipsoids": figures.ellipsoid_views(points, adapter.transform(points), looked_up, names),
        "human-robot-diffusion": figures.diffusion_map(domains, adaptation_steps(adapter, points)),
    }


def adaptation_steps(adapter: DomainAdapter, profile: Array) -> dict[str, Array]:
    """A profile after each step of a fitted rigid adapter, shapes (n, d, d), regularised throughout."""
    raw = adapter.teacher_side(profile, "profile")
    recentred = whiten(raw, adapter.teacher_mean_)
    scaled = powm(recentred, adapter.dispersion_ratio_)
    turned = congruence(adapter.rotation_, scaled)
    adapted = adapter.transform(profile) + adapter.released_damping_ * np.eye(profile.shape[-1])
    return {"person": raw, "adapted": adapted, "1 recentred": recentred, "2 scaled": scaled, "3 turned": turned}


def _two_dof_pair() -> tuple[Moved, Moved]:
    path = trajectories.two_dof_evaluation()["M-Eval-1"]
    teacher, student = trajectories.two_dof_arms()
    return (teacher, path), (student, path)


def _human_robot_pair() -> tuple[Moved, Moved]:
    person = trajectories.human_arm(), trajectories.human_evaluation()[SHOWN]
    return person, (trajectories.robot_arm(), trajectories.robot_path(person[1]))


def _two_dof_adapter(seed: int) -> DomainAdapter:
    """The adapter of Table II that is shown: 100 points of the trajectories."""
    return _fitted("II", 100, "PT + ICP + w³", trajectories.MOUNTING, known_truth.training(100), seed)


def _human_robot_adapter(seed: int) -> DomainAdapter:
    """The adapter of Table III that is shown: 25 points of the trajectories."""
    return _fitted("III", 25, "PT + ICP", human_robot.SAME_FRAME, human_robot.training(25), seed)


def _fitted(
    table: str, samples: int, method: str, base_rotation: Array, domains: tuple[Array, Array], seed: int
) -> DomainAdapter:
    """Fit to the domains what a row of a table is fitted with."""
    what = TRAJECTORIES, samples, method
    row = next(row for row in paper_table(table) if (row.data, row.samples, row.method) == what)
    adapter = our_adapter(row, base_rotation)
    adapter.set_params(random_state=seed)
    fit_quietly(adapter, Draw(seed, *domains, {}))
    return adapter


def _arms(pair: dict[str, Moved], size: float) -> Figure:
    skeletons = {name: arm.skeleton(path) for name, (arm, path) in pair.items()}
    ellipsoids = {name: arm.manipulability(path) for name, (arm, path) in pair.items()}
    return figures.arms(skeletons, ellipsoids, size=size)


DRAWN = {"toy": toy_figures, "two-dof": two_dof_figures, "human-robot": human_robot_figures}
"""Who draws the figures of an experiment."""


def two_dof_motion(seed: int = 0) -> Animation:
    """Both two-joint arms along M-Eval-1, where the truth is the student at the same joint angles."""
    note = "M-Eval-1. The adapted ellipsoids should be the vertical arm's own."
    return _motion(*_two_dof_pair(), _two_dof_adapter(seed), 0.4, note)


def human_robot_motion(seed: int = 0) -> Animation:
    """The human arm and the Panda along H-Eval-4; no truth is known there."""
    note = f"{SHOWN}. The Panda follows the hand path only: nothing makes its own ellipsoids the adapted ones."
    return _motion(*_human_robot_pair(), _human_robot_adapter(seed), 0.25, note)


MOVED = {"two-dof": two_dof_motion, "human-robot": human_robot_motion}  # Who shows an experiment in motion


def _motion(teacher: Moved, student: Moved, adapter: DomainAdapter, size: float, note: str) -> Animation:
    own = {"teacher": teacher[0].manipulability(teacher[1]), "student": student[0].manipulability(student[1])}
    adapted = adapter.transform(own["teacher"])
    lift = adapter.released_damping_ * np.eye(3)
    apart = distance(adapted + lift, own["student"] + lift)
    span = 0.0, max(0.1, 1.05 * float(apart.max()))
    lines = (Line("", apart),)
    from_own = Panel("Distance from adapted to own", "", lines, "With the damping of the adapter.", span=span)
    names = {PERSON.name: teacher[0].name, TARGET.name: "target", ACHIEVED.name: student[0].name}
    shells = {PERSON.name: own["teacher"], TARGET.name: adapted, ACHIEVED.name: own["student"]}
    notes = [note] if note else []
    person = body_of(*teacher, {PERSON.name: own["teacher"]}, notes=notes)
    robot = body_of(*student, {TARGET.name: adapted, ACHIEVED.name: own["student"]}, notes=notes)
    scale = f"Shown at {RATE:g} configurations a second; a semi-axis of 1 {UNIT} is drawn {size:g} m long."
    return Animation(
        np.arange(len(teacher[1])) / RATE,
        (Stage(person.name, (person,)), Stage(robot.name, (robot,))),
        {"Ellipsoids": (from_own, *ellipsoid_panels(shells, names, UNIT))},
        unit=UNIT,
        size=size,
        legend={
            PERSON.name: f"{teacher[0].name}'s ellipsoid",
            TARGET.name: "target (shell)",
            ACHIEVED.name: f"{student[0].name}'s own",
        },
        note=" ".join([*notes, scale]),
    )
