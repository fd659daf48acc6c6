import pytest

from maniport.evaluation import RMSE, DistancePreservation, Evaluation, Gaps, Row
from maniport.evaluation.metrics import first_of_least


def compared(icp, parallel, scaled, **first):
    """Evaluation of ICP with these domain distances, where baselines have the least distances and gaps."""
    values = {
        "icp": icp,
        "identity": 0.0,
        "mean-transport": 0.0,
        "parallel-transport": parallel,
        "scaled-transport": scaled,
        "nearest-neighbor": 0.0,
    }
    rows = []
    for name, value in values.items():
        gap = Gaps(1.0 - value, 2.0, 3.0)
        rows.append(Row(name, domain_distance=value, feasibility_gap=gap))
    rows[0] = Row(**vars(rows[0]) | first)
    return Evaluation(tuple(rows))


def test_known_truth_comes_before_domains_and_includes_the_lookup():
    errors = {"icp": 0.4, "identity": 0.9, "nearest-neighbor": 0.2}
    rows = tuple(
        Row(name, rmse=RMSE(error, 1.0, 1.0), domain_distance=1.0 - error)
        for name, error in errors.items()
    )
    evaluation = Evaluation(rows)
    assert (evaluation.measure, evaluation.values, evaluation.recommended) == (
        "rmse",
        errors,
        "nearest-neighbor",
    )


def test_without_truth_and_domains_nothing_is_compared():
    evaluation = Evaluation((Row("icp", preservation=DistancePreservation(0.5)), Row("identity")))
    assert (evaluation.measure, evaluation.values, evaluation.recommended) == ("", {}, "")
    assert evaluation.adapter.weaknesses == {"rank_correlation": 0.5}


@pytest.mark.parametrize(
    ("distances", "recommended"),
    [
        ((0.409, 0.362, 0.409), "parallel-transport"),
        ((0.409, 0.5, 0.409), "scaled-transport"),
        ((0.4, 0.41, 0.405), "parallel-transport"),
        ((0.3, 0.5, 0.31), "scaled-transport"),
        ((0.2, 0.5, 0.31), "icp"),
        ((0.0, 0.0, 0.0), "parallel-transport"),
    ],
)
def test_the_first_method_that_no_other_undercuts_is_recommended(distances, recommended):
    """Gaps of the profile and baselines, which are less here, do not decide."""
    assert compared(*distances).recommended == recommended


def test_an_evaluated_baseline_is_not_recommended():
    rows = compared(0.9, 0.5, 0.2).rows
    for own in ("identity", "mean-transport", "nearest-neighbor"):
        evaluation = Evaluation((Row(own, domain_distance=0.0), *rows[3:5]))
        assert evaluation.recommended == "scaled-transport"


@pytest.mark.parametrize(
    ("metrics", "codes"),
    [
        ({}, []),
        ({"step_ratio": 1.6}, ["large_step"]),
        ({"preservation": DistancePreservation(0.77, 9.0)}, ["rank_correlation"]),
        ({"preservation": DistancePreservation(0.97, 30.0)}, ["rotated_axes"]),
    ],
)
def test_methods_with_weaknesses_are_recommended_only_where_all_have_some(metrics, codes):
    evaluation = compared(0.1, 0.5, 0.2, **metrics)
    assert list(evaluation.adapter.weaknesses) == codes
    assert evaluation.recommended == ("scaled-transport" if codes else "icp")
    assert Evaluation((Row("icp", domain_distance=0.1, **metrics),)).recommended == "icp"


@pytest.mark.parametrize("failures", [(), ("reversing",)])
def test_a_length_field_is_recommended_if_it_passes_its_checks(failures):
    field = Row("length-field", domain_distance=0.9, failures=failures)
    rows = compared(0.9, 0.5, 0.2).rows
    wanted = "scaled-transport" if failures else "length-field"
    assert Evaluation((field, *rows[1:])).recommended == wanted
    assert Evaluation((*rows, field)).recommended == wanted


def test_of_equal_values_the_first_is_taken():
    assert first_of_least({}) == ""
    assert first_of_least({"a": 1.0, "b": 0.96, "c": 0.96}) == "a"
    assert first_of_least({"a": 1.0, "b": 0.94, "c": 0.90}) == "b"
