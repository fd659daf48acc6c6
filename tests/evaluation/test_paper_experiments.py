"""What the paper's experiments must give when they are run again."""

import csv
import io
import json
from types import SimpleNamespace

import pytest

from maniport.errors import InvalidInputError, OutputError
from maniport.report import as_numbers, facts_of
from maniport.studies.paper import known_truth, run
from maniport.studies.paper.tables import AUTHORS, OURS, PAPER, TRAJECTORIES, paper_table


def lines_of(result):
    """Lines of the table of an experiment or an outcome, each with its columns as attributes."""
    return [SimpleNamespace(**line) for line in result.lines()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where everything was written, with two random sets instead of ten."""
    return tmp_path_factory.mktemp("paper") / "out"


@pytest.fixture(scope="module")
def told():
    """What was said on the way."""
    return []


@pytest.fixture(scope="module")
def reproduction(folder, told):
    """All experiments, run once."""
    return run.reproduce("all", folder, seed=3, progress=lambda *step: told.append(step), draws=2)


@pytest.fixture(scope="module")
def outcomes(reproduction):
    """The lines of their tables by experiment."""
    return {one.name: lines_of(one) for one in reproduction.experiments}


@pytest.mark.parametrize(("name", "number"), [("toy", "I"), ("two-dof", "II"), ("human-robot", "III")])
def test_every_row_of_the_tables_is_there(outcomes, name, number):
    """Each row comes with all settings, every evaluation set and the paper's number, once."""
    for row in paper_table(number):
        for settings in (PAPER, OURS, AUTHORS) if number == "III" else (PAPER, OURS):
            found = [x for x in outcomes[name] if (x.table, x.row, x.settings) == (number, row.row, settings)]
            assert {x.evaluation: x.paper_rmse for x in found} == row.rmse
            assert len(found) == len(row.rmse)
            assert all((x.samples, x.method) == (row.label, row.method) for x in found)


def test_toy_data_are_recovered(outcomes):
    """The model class contains the truth: both rows end below 1e-6 in both settings and in every form."""
    for outcome in outcomes["toy"]:
        assert max(outcome.undivided, outcome.per_dispersion, outcome.per_squared_dispersion) < 1e-6


def test_two_joint_arms_with_the_same_samples_are_exact(outcomes):
    """With our defaults every row ends below 1e-6 where both arms were sampled at the same joint angles."""
    same = [x for x in outcomes["two-dof"] if x.data in (TRAJECTORIES, known_truth.SAME) and x.settings == OURS]
    assert len(same) == 3 * len(paper_table("II"))
    assert max(x.undivided for x in same) < 1e-6


def test_files_agree(folder, reproduction, outcomes):
    """CSV and JSON hold the same numbers as the result, and the page shows them with three decimals."""
    without_methods = [name for name in run.FILES if not name.startswith(f"{run.METHODS_FILE}.")]
    assert sorted(path.name for path in folder.iterdir()) == sorted(without_methods)
    for name, expected in outcomes.items():
        table = list(csv.DictReader(io.StringIO((folder / f"{name}.csv").read_text(encoding="utf-8"))))
        whole = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        page = (folder / f"{name}.md").read_text(encoding="utf-8")
        assert whole[name] == as_numbers(facts_of(reproduction))[name]
        for line, row, outcome in zip(table, whole[name]["rows"], expected, strict=True):
            assert float(line["per_dispersion"]) == row["per_dispersion"] == outcome.per_dispersion
            assert line["method"] == row["method"] == outcome.method
            assert line["paper_rmse"] == ("" if outcome.paper_rmse is None else str(outcome.paper_rmse))
            if outcome.undivided >= 1e-3:
                assert f"{outcome.undivided:.3f}" in page


def test_same_seed_gives_the_same_numbers(tmp_path, outcomes):
    """One experiment alone, run again, gives what it gave among all, times aside; its folder holds its files only."""
    again = run.reproduce("toy", tmp_path / "toy", seed=3, draws=2)
    assert repr(again).startswith("Reproduction(toy; seed 3, ")
    assert [x.undivided for x in lines_of(again.experiments[0])] == [x.undivided for x in outcomes["toy"]]
    assert sorted(path.name for path in (tmp_path / "toy").iterdir()) == [
        "report.html", "toy-ellipsoids.png", "toy-ellipsoids.svg", "toy.csv", "toy.json", "toy.md",
    ]  # fmt: skip
    with pytest.raises(OutputError, match="holds an earlier result"):
        run.reproduce("toy", tmp_path / "toy", seed=4, draws=1)
    run.reproduce("toy", tmp_path / "toy", seed=4, draws=1, overwrite=True)


def test_failure_leaves_nothing(tmp_path):
    """When the work stops half way, neither the folder nor a part of it stays."""

    def stop(*step):
        raise RuntimeError("stopped")

    with pytest.raises(RuntimeError, match="stopped"):
        run.reproduce("toy", tmp_path / "out", progress=stop, draws=1)
    assert list(tmp_path.iterdir()) == []


def test_unknown_experiment_is_refused(tmp_path):
    """The message lists the experiments there are."""
    with pytest.raises(InvalidInputError, match="unknown experiment 'three-dof'; there are, nearest first: 'two-dof'"):
        run.reproduce("three-dof", tmp_path / "out")
