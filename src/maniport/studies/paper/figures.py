"""A figure for each figure of the paper's experiments, made with our defaults; names of the files without ending."""

import numpy as np
from matplotlib.figure import Figure

from maniport.bodies import Arm
from maniport.spd import powm, whiten
from maniport.spd.matrix_functions import congruence
from maniport.studies.paper import human_robot, trajectories, two_dof
from maniport.studies.paper.outcome import Draw, fit_quietly
from maniport.studies.paper.settings import OURS, our_adapter
from maniport.studies.paper.tables import TOY, TRAJECTORIES, PaperRow, paper_table
from maniport.studies.paper.toy import toy_draw
from maniport.telling import figures
from maniport.transfer import DomainAdapter
from maniport.validation import Array

SHOWN = "H-Eval-4"
"""The human trajectory that the paper shows: the extended arm moves upwards."""


def toy_figures(seed: int = 0) -> dict[str, Figure]:
    """The ten new ellipsoids of the toy data before and after."""
    draw = toy_draw(seed)
    adapter = our_adapter(paper_table("I")[1], damping=None).set_params(random_state=seed)
    points, truth = draw.evaluation[TOY[0]]
    fit_quietly(adapter, draw)
    adapted = adapter.transform(points)
    names = ("transformed", "adapted", "Panda's own (truth)")
    return {"toy-ellipsoids": figures.ellipsoid_views(points, adapted, truth, names, count=10)}


def two_dof_figures(seed: int = 0) -> dict[str, Figure]:
    """Both two-joint arms along M-Eval-1, and its ellipsoids before and after; 100 training points, PT + ICP + w³."""
    row = shown_row("II", 100, "PT + ICP + w³")
    adapter = our_adapter(row, trajectories.MOUNTING).set_params(random_state=seed)
    known = two_dof.evaluation()
    fit_quietly(adapter, Draw(seed, *two_dof.training(row.samples), known))
    points, truth = known["M-Eval-1"]
    adapted = adapter.transform(points)
    path = trajectories.two_dof_evaluation()["M-Eval-1"]
    teacher, student = trajectories.two_dof_arms()
    pair = {"horizontal (teacher)": (teacher, path), "vertical (student)": (student, path)}
    names = ("horizontal arm", "adapted", "vertical arm (truth)")
    return {
        "two-dof-arms": _arms(pair, size=0.25),
        "two-dof-ellipsoids": figures.ellipsoid_views(points, adapted, truth, names),
    }


def human_robot_figures(seed: int = 0, baseline_samples: int = human_robot.BASELINE_SAMPLES) -> dict[str, Figure]:
    """Both seven-joint arms along H-Eval-4, its ellipsoids before and after, and the steps of the adaptation.

    25 training points of the trajectories, PT + ICP; the naive baseline stands for the truth.
    """
    row = shown_row("III", 25, "PT + ICP")
    baseline, _ = human_robot.naive_baseline(human_robot.REMEDIES[OURS], seed, baseline_samples)
    known = human_robot.evaluation(baseline)
    points, looked_up = known[SHOWN]
    adapter = our_adapter(row, human_robot.SAME_FRAME).set_params(random_state=seed)
    fit_quietly(adapter, Draw(seed, *human_robot.training(row.samples), known))
    teacher, student = human_robot.training(human_robot.ALL)
    pair = {
        "rHuMan (teacher)": (trajectories.human_arm(), trajectories.human_evaluation()[SHOWN]),
        "Panda (student)": (trajectories.robot_arm(), trajectories.robot_evaluation()[SHOWN]),
    }
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
    """A profile after each step of a fitted rigid adapter, shapes (n, d, d), regularised throughout.

    The first and the last come first, since figures give the first colours to the teacher and the student.
    """
    raw = adapter.teacher_side(profile, "profile")
    recentred = whiten(raw, adapter.teacher_mean_)
    scaled = powm(recentred, adapter.dispersion_ratio_)
    turned = congruence(adapter.rotation_, scaled)
    adapted = adapter.transform(profile) + adapter.released_damping_ * np.eye(profile.shape[-1])
    return {"person": raw, "adapted": adapted, "1 recentred": recentred, "2 scaled": scaled, "3 turned": turned}


def shown_row(table: str, samples: int, method: str) -> PaperRow:
    """Find the row of a table that the paper's figure shows, and that `motions` moves."""
    return next(
        row for row in paper_table(table) if (row.data, row.samples, row.method) == (TRAJECTORIES, samples, method)
    )


def _arms(pair: dict[str, tuple[Arm, Array]], size: float) -> Figure:
    skeletons = {name: arm.skeleton(path) for name, (arm, path) in pair.items()}
    ellipsoids = {name: arm.manipulability(path) for name, (arm, path) in pair.items()}
    return figures.arms(skeletons, ellipsoids, size=size)


DRAWN = {"toy": toy_figures, "two-dof": two_dof_figures, "human-robot": human_robot_figures}
"""Who draws the figures of an experiment."""
