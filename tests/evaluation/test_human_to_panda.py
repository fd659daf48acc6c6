"""Tests of the study from human to Panda, at a small size."""

import numpy as np
import pytest

from maniport import load_arm, nearest_feasible
from maniport.studies import human_to_panda
from maniport.studies.human_to_panda import EVALUATIONS, motions, study


@pytest.mark.filterwarnings("ignore:the model of the arm and the person differ")
def test_motions_are_those_of_the_paper_and_the_recordings():
    """Four motions of 50 ellipsoids; a recording is thinned to 150 frames of the person in it."""
    found = motions([*EVALUATIONS, "freeform"])
    assert [len(motion.profile) for motion in found] == [50, 50, 50, 50, 150]
    assert found[-1].person.name == "myoarm"
    assert all(np.all(np.linalg.eigvalsh(motion.profile) > -1e-12) for motion in found)


def test_the_end_effector_is_the_default_one(monkeypatch):
    """The gap of a raw copy is that of the Panda's hand, and not that of its flange."""
    monkeypatch.setattr(human_to_panda, "TEACHER_SAMPLES", 128)
    monkeypatch.setattr(human_to_panda, "STUDENT_SAMPLES", 256)
    steps = []
    options = {"draws": 0, "n_domain": 0, "n_identity": 0, "rows": ("raw-copy",)}
    results = study(["parallel-transport"], ["H-Eval-2"], progress=lambda *words: steps.append(words), **options)
    ((motion, evaluation),) = results.values()
    assert steps[0] == ("H-Eval-2", 0.0)
    assert steps[-1][:2] == ("H-Eval-2", 1.0)
    gap = evaluation.row("raw-copy").feasibility_gap.mean
    hand, flange = (
        float(np.mean(nearest_feasible(load_arm("panda", frame=frame), motion.profile, damping=0.01).distance))
        for frame in (None, "panda_link8")
    )
    assert abs(gap - hand) < 0.25 * abs(hand - flange)
