"""The authors' metric and baseline, and the comparison with the paper's numbers."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm, logm, sqrtm

from maniport.arms import load_arm
from maniport.evaluation import RMSE
from maniport.report import as_numbers, facts_of
from maniport.studies.paper.human_robot import AuthorsBaseline
from maniport.studies.paper.outcome import Experiment, Outcome
from maniport.studies.paper.report import Reproduction
from maniport.studies.paper.tables import AUTHORS, OURS, PAPER, paper_table

FLOOR = 1e-4


def outcome(row, settings, per_dispersion, per_squared_dispersion):
    """One line of a table whose numbers are those of the paper, times one factor for each form of the error."""
    errors = {
        name: [RMSE(1.0, per_dispersion * printed, per_squared_dispersion * printed)]
        for name, printed in row.rmse.items()
    }
    return Outcome(row, row.data, row.label, row.method, settings, "", errors, 7.0, 0.1, 1, 0, 0)


@pytest.fixture
def reproduction():
    """Two tables with factors that are known: matched, lower and higher numbers, and a row of our own."""
    toy, human = paper_table("I"), paper_table("III")
    first = [outcome(row, PAPER, 1.19, 0.5) for row in toy]
    further = replace(outcome(human[0], PAPER, 3.0, 3.0), row=None, data="further", method="identity baseline")
    second = [
        outcome(human[0], PAPER, 1.5, 0.81),
        outcome(human[1], PAPER, 1.5, 1.21),
        outcome(human[0], AUTHORS, 0.79, 1.0),
        outcome(human[0], OURS, 9.0, 9.0),
        further,
    ]
    experiments = Experiment("toy", "Table I", (), tuple(first)), Experiment("human-robot", "III", (), tuple(second))
    return Reproduction(experiments, 0, 1.0)


def test_comparison_counts_what_is_matched_lower_and_higher(reproduction):
    """Within 20 % is matched; each form of the error and each baseline count alone; our defaults and rows do not."""
    groups = as_numbers(facts_of(reproduction))["comparison"]["groups"]
    counts = {(one["table"], one["settings"], one["error"], one["group"]): one["count"] for one in groups}
    assert counts == {
        ("I", PAPER, "÷ c", "within 20 %"): 2,
        ("I", PAPER, "÷ c²", "lower"): 2,
        ("III", PAPER, "÷ c", "higher"): 8,
        ("III", PAPER, "÷ c²", "within 20 %"): 4,
        ("III", PAPER, "÷ c²", "higher"): 4,
        ("III", AUTHORS, "÷ c", "lower"): 4,
        ("III", AUTHORS, "÷ c²", "within 20 %"): 4,
    }
    assert {one["total"] for one in groups if (one["table"], one["settings"]) == ("III", PAPER)} == {8}
    assert groups[0]["where"] == "random: 10 new points (2)"
    for one in groups:  # every group of the kinds that occur has its reason
        known = one["group"] == "within 20 %" or (one["table"], one["error"], one["group"]) == ("III", "÷ c", "lower")
        assert bool(one["reason"]) is not known


def lifted(points):
    """Ellipsoids whose eigenvalues are at least the floor."""
    values, vectors = np.linalg.eigh(points)
    return (vectors * np.maximum(values, FLOOR)[:, None]) @ np.swapaxes(vectors, -1, -2)


def test_authors_baseline_against_an_independent_computation():
    """Unit volumes, log-Euclidean neighbors, a tangent vector moved in parallel, and the volume restored."""
    arm = load_arm("panda")
    teacher, student = (lifted(arm.manipulability(arm.sample(30, seed))) for seed in (0, 1))
    points = lifted(arm.manipulability(arm.sample(5, 2)))

    def unit(matrix):
        return matrix / (4 / 3 * np.pi * np.sqrt(np.linalg.det(matrix))) ** (2 / 3)

    def nearest(matrix, others):
        return min(others, key=lambda other: np.linalg.norm(logm(other) - logm(matrix)))

    expected = []
    for point in points:
        at = unit(point)
        sample = nearest(at, [unit(one) for one in teacher])
        partner = nearest(sample, [unit(one) for one in student])
        tangent = sample @ logm(np.linalg.solve(sample, partner))
        move = sqrtm(at @ np.linalg.inv(sample))
        moved = at @ expm(np.linalg.solve(at, move @ tangent @ move.T))
        expected.append(unit(moved) * np.linalg.det(point / np.linalg.det(unit(point)) ** (1 / 3)) ** (1 / 3))
    found = AuthorsBaseline(FLOOR).fit(teacher, student).transform(points)
    assert_allclose(found, np.real(expected), rtol=1e-6, atol=1e-9)
    assert_allclose(np.linalg.det(found), np.linalg.det(points), rtol=1e-6)
