"""Tests of the result of a comparison."""

import pytest

from maniport.evaluation import RMSE, DistancePreservation, Gaps, Row, Smoothness
from maniport.evaluation.baselines import IDENTITY, LOOKUP, TRANSPORT
from maniport.evaluation.summary import summarize


def rows(mine, nothing, transport, lookup=0.0, **first):
    """Rows with these mean feasibility gaps."""
    values = {"icp": mine, IDENTITY: nothing, TRANSPORT: transport, LOOKUP: lookup}
    return [
        Row(name, feasibility_gap=Gaps(value, 0.0, 2 * value), **(first if name == "icp" else {}))
        for name, value in values.items()
    ]


def test_known_truth_comes_before_gaps_and_includes_the_lookup():
    """Where the truth is known the RMSE decides."""
    table = [
        Row("icp", rmse=RMSE(0.4, 1.0, 1.0), feasibility_gap=Gaps(0.0, 0.0, 0.0)),
        Row(IDENTITY, rmse=RMSE(0.9, 1.0, 1.0), feasibility_gap=Gaps(1.0, 1.0, 1.0)),
        Row(LOOKUP, rmse=RMSE(0.2, 1.0, 1.0), feasibility_gap=Gaps(0.0, 0.0, 0.0)),
    ]
    summary = summarize(table)
    assert summary.measure == "rmse"
    assert (summary.value, summary.identity, summary.best, summary.best_value) == (0.4, 0.9, LOOKUP, 0.2)
    assert summary.recommended == LOOKUP


def test_without_kinematics_and_truth_nothing_is_compared():
    """There is no measure, so that only the weaknesses are reported."""
    summary = summarize([Row("icp", identity=0.8), Row(IDENTITY, identity=0.0)])
    assert (summary.measure, summary.values, summary.value, summary.best, summary.recommended) == ("", {}, None, "", "")
    assert [weakness.code for weakness in summary.weaknesses] == ["identity_test"]


@pytest.mark.parametrize(
    ("gaps", "recommended"),
    [
        ((0.409, 0.362, 0.409), IDENTITY),
        ((0.409, 0.5, 0.409), TRANSPORT),
        ((0.4, 0.405, 0.41), IDENTITY),
        ((0.3, 0.5, 0.31), TRANSPORT),
        ((0.2, 0.5, 0.31), "icp"),
        ((0.0, 0.0, 0.0), IDENTITY),
    ],
)
def test_the_cheapest_method_that_no_other_undercuts_is_recommended(gaps, recommended):
    """Differences below 5 % do not count, and the lookup, whose gap is zero by construction, does not either."""
    summary = summarize(rows(*gaps))
    assert summary.recommended == recommended
    assert summary.best_value == min(gaps)
    assert summary.values[recommended] * 0.95 <= min(gaps)
    own = Row(LOOKUP, method=LOOKUP, feasibility_gap=Gaps(0.0, 0.0, 0.0))  # also where it is the evaluated method
    assert summarize([own, *rows(0.9, 0.5, 0.2)[1:3]]).recommended == TRANSPORT


@pytest.mark.parametrize(
    ("metrics", "codes"),
    [
        ({}, []),
        ({"smoothness": Smoothness(1.6, 1.0, 1.6, 1.0)}, ["large_step"]),
        ({"smoothness": Smoothness(1.0, 0.0, 1.0, 0.0)}, ["plateau"]),
        ({"preservation": DistancePreservation(0.77, 9.0)}, ["rank_correlation"]),
        ({"preservation": DistancePreservation(0.97, 30.0)}, ["rotated_axes"]),
        ({"identity": 0.8}, ["identity_test"]),
    ],
)
def test_methods_with_weaknesses_are_recommended_only_where_all_have_some(metrics, codes):
    """A small gap does not outweigh a weakness, and neither do failed checks of a fit."""
    table = rows(0.1, 0.5, 0.2, **metrics)
    table[2] = Row(TRANSPORT, feasibility_gap=Gaps(0.2, 0.0, 0.4), identity=0.06)
    summary = summarize(table)
    assert [weakness.code for weakness in summary.weaknesses] == codes
    assert summary.recommended == (TRANSPORT if codes else "icp")
    assert summarize(rows(0.1, 0.5, 0.2, failures=("reversing",))).recommended == TRANSPORT
    assert summarize([Row("icp", feasibility_gap=Gaps(0.1, 0.1, 0.1), **metrics)]).recommended == "icp"
