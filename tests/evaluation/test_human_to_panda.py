"""Tests of the study from human to Panda, at a small size."""

import numpy as np
import pytest

from maniport import load_arm, nearest_feasible
from maniport.studies import human_to_panda
from maniport.studies.human_to_panda import EVALUATIONS, RECORDINGS, motions, study, study_page
from maniport.telling.transfer import verdict_facts


@pytest.fixture
def small(monkeypatch):
    """Domains of a few samples."""
    monkeypatch.setattr(human_to_panda, "TEACHER_SAMPLES", 128)
    monkeypatch.setattr(human_to_panda, "STUDENT_SAMPLES", 256)


@pytest.mark.filterwarnings("ignore:the model of the arm and the person differ")
def test_motions_are_those_of_the_paper_and_the_recordings():
    """Four motions of 50 ellipsoids; a recording is thinned to 150 frames of the person in it."""
    found = motions([*EVALUATIONS, "freeform"])
    assert [len(motion.profile) for motion in found] == [50, 50, 50, 50, 150]
    assert found[-1].person.name == "myoarm"
    assert len({motion.person for motion in found[:4]}) == 1
    assert list(RECORDINGS) == ["ladder", "freeform"]
    for motion in found:
        assert np.all(np.linalg.eigvalsh(motion.profile) > -1e-12)


def test_the_page_has_a_line_and_a_table_for_every_motion(small):
    """The summary repeats the mean feasibility gap of the tables, and the legend stands once."""
    told = []
    results = study(
        ["parallel-transport"],
        ["H-Eval-2"],
        progress=lambda *words: told.append(words),
        draws=0,
        n_domain=0,
        rows=("raw-copy",),
    )
    (_, evaluation), page = results["H-Eval-2", "parallel-transport"], study_page(results)
    assert told == [("H-Eval-2", 0.0), ("H-Eval-2", 1.0, "parallel-transport beside 1 more")]
    gaps = (evaluation.row(name).feasibility_gap.mean for name in ("raw-copy", "parallel-transport"))
    assert "| H-Eval-2 | parallel-transport | {:.3f} | – | {:.3f} | – | – |".format(*gaps) in page
    assert verdict_facts(evaluation.verdict)[0].text.split(". ")[0] in page
    assert page.count("turn of axes:") == 1
    assert evaluation.settings["profile"] == "50 ellipsoids"


def test_the_end_effector_is_the_default_one(small):
    """The gap of a raw copy is that of the Panda's hand, and not that of its flange; the page names the frame."""
    options = {"draws": 0, "n_domain": 0, "rows": ("raw-copy",)}
    results = study(["parallel-transport"], ["H-Eval-2"], **options)
    ((motion, evaluation),) = results.values()
    gap = evaluation.row("raw-copy").feasibility_gap.mean
    hand, flange = (
        float(np.mean(nearest_feasible(load_arm("panda", frame=frame), motion.profile, damping=0.01).distance))
        for frame in (None, "panda_link8")
    )
    assert abs(gap - hand) < 0.25 * abs(hand - flange)
    assert "`panda_hand_tcp`" in study_page(results)


def test_where_no_method_is_named_one_is_chosen_for_each_motion(small):
    """The length field or parallel transport; the page states the rule."""
    (((motion, method), (_, evaluation)),) = study(names=["H-Eval-2"], draws=0, n_domain=0, rows=("raw-copy",)).items()
    assert (motion, method) == ("H-Eval-2", "auto")
    assert evaluation.adapter.name in ("lengths-field", "parallel-transport")
    assert "orientation" in study_page({(motion, method): (_, evaluation)}, "## Robots")
