"""Figures of the paper's experiments with our defaults, by file name without suffix."""

import numpy as np
from matplotlib.figure import Figure

from maniport.arms import Arm
from maniport.report import figures
from maniport.spd import powm, whiten
from maniport.spd.matrix_functions import congruence
from maniport.studies.paper import human_robot, known_truth, trajectories
from maniport.studies.paper.outcome import Draw, fit_quietly
from maniport.studies.paper.tables import OURS, TOY, TRAJECTORIES, our_adapter, paper_table
from maniport.transfer import DomainAdapter
from maniport.util.validation import Array


def toy_figures(seed: int = 0) -> dict[str, Figure]:
    """Plot the ten new ellipsoids of the toy data before and after the transfer."""
    draw = known_truth.toy_draw(seed)
    adapter = our_adapter(paper_table("I")[1], damping=None).set_params(random_state=seed)
    fit_quietly(adapter, draw)
    return {"toy-ellipsoids": _mapped(adapter, *draw.evaluation[TOY[0]], ("transformed", "Panda's own (truth)"))}


def two_dof_figures(seed: int = 0) -> dict[str, Figure]:
    """Both two-joint arms along M-Eval-1, and its ellipsoids before and after; 100 training points, PT + ICP + w³."""
    domains = known_truth.training(100)
    adapter = _fitted("II", 100, "PT + ICP + w³", trajectories.MOUNTING, domains, seed)
    path = trajectories.two_dof_evaluation()["M-Eval-1"]
    teacher, student = trajectories.two_dof_arms()
    truth = known_truth.evaluation()["M-Eval-1"]
    return {
        "two-dof-arms": _arms({"horizontal (teacher)": (teacher, path), "vertical (student)": (student, path)}, 0.25),
        "two-dof-ellipsoids": _mapped(adapter, *truth, ("horizontal arm", "vertical arm (truth)")),
    }


def human_robot_figures(seed: int = 0) -> dict[str, Figure]:
    """Both seven-joint arms along H-Eval-4, its ellipsoids before and after, and the steps of the adaptation."""
    motion = "H-Eval-4"  # the human trajectory in the paper's figure: upward motion of the extended arm
    baseline = human_robot.naive_baseline(human_robot.REMEDIES[OURS], seed)
    points, truth = human_robot.evaluation(baseline)[motion]
    adapter = _fitted("III", 25, "PT + ICP", human_robot.SAME_FRAME, human_robot.training(25), seed)
    teacher, student = human_robot.training(human_robot.ALL)
    path = trajectories.human_evaluation()[motion]
    arms = {
        "rHuMan (teacher)": (trajectories.human_arm(), path),
        "Panda (student)": (trajectories.robot_arm(), trajectories.robot_path(path)),
    }
    original = adapter.teacher_side(points, "profile")
    steps = {"person": original, "adapted": adapter.transform(points) + adapter.released_damping_ * np.eye(3)}
    steps["1 recentered"] = whiten(original, adapter.teacher_mean_)
    steps["2 scaled"] = powm(steps["1 recentered"], adapter.dispersion_ratio_)
    steps["3 rotated"] = congruence(adapter.rotation_, steps["2 scaled"])
    domains = {"person, training": adapter.teacher_side(teacher), "Panda, training": adapter.student_side(student)}
    return {
        "human-robot-arms": _arms(arms, 0.2),
        "human-robot-ellipsoids": _mapped(adapter, points, truth, ("person", "naive baseline")),
        "human-robot-diffusion": figures.diffusion_map(domains, steps),
    }


DRAWN = {"toy": toy_figures, "two-dof": two_dof_figures, "human-robot": human_robot_figures}


def _fitted(
    table: str, samples: int, method: str, base_rotation: Array, domains: tuple[Array, Array], seed: int
) -> DomainAdapter:
    """Fit the method of a row of a table, with our defaults, to domains of the trajectories."""
    key = TRAJECTORIES, samples, method
    row = next(row for row in paper_table(table) if (row.data, row.samples, row.method) == key)
    adapter = our_adapter(row, base_rotation).set_params(random_state=seed)
    fit_quietly(adapter, Draw(seed, *domains, {}))
    return adapter


def _mapped(adapter: DomainAdapter, points: Array, truth: Array, names: tuple[str, str]) -> Figure:
    profiles = {names[0]: points, "adapted": adapter.transform(points), names[1]: truth}
    return figures.ellipsoids(np.arange(1, len(points) + 1), profiles, axis="number of the ellipsoid")


def _arms(arms: dict[str, tuple[Arm, Array]], size: float) -> Figure:
    skeletons = {name: arm.skeleton(path) for name, (arm, path) in arms.items()}
    ellipsoids = {name: arm.manipulability(path) for name, (arm, path) in arms.items()}
    return figures.arms(skeletons, ellipsoids, size=size)
