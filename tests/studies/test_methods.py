from functools import partial

import numpy as np
import pytest

from maniport.errors import InvalidInputError
from maniport.report import as_markdown, report_of
from maniport.studies import methods
from maniport.studies.methods import EVALUATIONS, compare_methods, methods_report, methods_section, motions
from maniport.studies.paper import experiments, run
from maniport.transfer import METHODS


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(methods, "TEACHER_SAMPLES", 64)
    monkeypatch.setattr(methods, "STUDENT_SAMPLES", 128)


def test_a_line_for_every_method_and_a_table_for_every_motion(small):
    comparison = compare_methods(("identity", "icp"), names=["H-Eval-2"])
    values = methods_section(comparison).tables[0].value
    assert list(values) == ["parallel-transport", "identity", "icp"]
    gaps = comparison["H-Eval-2"].row("icp").feasibility_gap
    assert (values["icp"]["gap"], values["icp"]["gap_p95"]) == (gaps.mean, gaps.p95)
    page = as_markdown(methods_report(comparison))
    assert page.count("| icp |") == 2
    assert page.count("\n## ") == 2
    assert page.count("Comparison of methods") == 1


def test_reproduce_writes_the_comparison_where_it_is_asked_for(small, monkeypatch, tmp_path):
    with pytest.raises(InvalidInputError, match="methods are compared in the experiment 'human-robot'; found 'toy'"):
        run.reproduce("toy", tmp_path / "out", methods=("identity",))
    toy = experiments.toy(0, draws=1)
    monkeypatch.setitem(run.EXPERIMENTS, "human-robot", lambda *given, **more: toy)
    monkeypatch.setattr(run, "compare_methods", partial(compare_methods, names=["H-Eval-2"]))
    actual = run.reproduce("human-robot", tmp_path / "out", methods=("identity",), draws=1)
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"methods.md", "methods.json"}
    assert "| identity |" in as_markdown(report_of(actual))


def test_transport_between_gaussians_comes_last_of_all_methods(small):
    pytest.importorskip("ot")
    comparison = compare_methods(tuple(METHODS), names=["H-Eval-2"])["H-Eval-2"]
    assert comparison.rows[-1].name == "GaussianTransport"
    assert 0.0 < comparison.rows[-1].feasibility_gap.mean < comparison.row("identity").feasibility_gap.mean


def test_motions_are_those_of_the_paper_and_the_recordings():
    actual = motions([*EVALUATIONS, "freeform"])
    assert [len(motion.profile) for motion in actual] == [50, 50, 50, 50, 150]
    assert actual[-1].person.name == "myoarm"
    assert all(np.all(np.linalg.eigvalsh(motion.profile) > -1e-12) for motion in actual)
