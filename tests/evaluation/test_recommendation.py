import pytest

from maniport.evaluation import RMSE, DistancePreservation, Evaluation, Gaps, Row


def compared(mine, nothing, transport, **first):
    """Evaluation of ICP with these mean feasibility gaps, of which that of the lookup is zero by construction."""
    values = {
        "icp": mine,
        "identity": nothing,
        "parallel-transport": transport,
        "nearest-neighbor": 0.0,
    }
    rows = (
        Row(name, feasibility_gap=Gaps(value, 2 * value, 3 * value))
        for name, value in values.items()
    )
    return Evaluation(tuple(Row(**vars(row) | first) if row.name == "icp" else row for row in rows))


def test_known_truth_comes_before_gaps_and_includes_the_lookup():
    gaps = {
        name: Gaps(value, value, value)
        for name, value in (("icp", 0.0), ("identity", 1.0), ("nearest-neighbor", 0.0))
    }
    errors = {"icp": 0.4, "identity": 0.9, "nearest-neighbor": 0.2}
    rows = tuple(
        Row(name, rmse=RMSE(errors[name], 1.0, 1.0), feasibility_gap=gaps[name]) for name in errors
    )
    evaluation = Evaluation(rows)
    assert (evaluation.measure, evaluation.values, evaluation.recommended) == (
        "rmse",
        errors,
        "nearest-neighbor",
    )


def test_without_truth_and_arms_nothing_is_compared():
    evaluation = Evaluation((Row("icp", preservation=DistancePreservation(0.5)), Row("identity")))
    assert (evaluation.measure, evaluation.values, evaluation.recommended) == ("", {}, "")
    assert evaluation.adapter.weaknesses == {"rank_correlation": 0.5}


@pytest.mark.parametrize(("gaps", "recommended"), [
    ((0.409, 0.362, 0.409), "identity"), ((0.409, 0.5, 0.409), "parallel-transport"), ((0.4, 0.405, 0.41), "identity"),
    ((0.3, 0.5, 0.31), "parallel-transport"), ((0.2, 0.5, 0.31), "icp"), ((0.0, 0.0, 0.0), "identity"),
])  # fmt: skip
def test_the_cheapest_method_that_no_other_undercuts_is_recommended(gaps, recommended):
    evaluation = compared(*gaps)
    assert evaluation.recommended == recommended
    own = Row(
        "nearest-neighbor", feasibility_gap=Gaps(0.0, 0.0, 0.0)
    )  # also where it is the evaluated method
    assert Evaluation((own, *compared(0.9, 0.5, 0.2).rows[1:3])).recommended == "parallel-transport"


@pytest.mark.parametrize(("metrics", "codes"), [
    ({}, []), ({"step_ratio": 1.6}, ["large_step"]),
    ({"preservation": DistancePreservation(0.77, 9.0)}, ["rank_correlation"]),
    ({"preservation": DistancePreservation(0.97, 30.0)}, ["rotated_axes"]),
])  # fmt: skip
def test_methods_with_weaknesses_are_recommended_only_where_all_have_some(metrics, codes):
    evaluation = compared(0.1, 0.5, 0.2, **metrics)
    assert list(evaluation.adapter.weaknesses) == codes
    assert evaluation.recommended == ("parallel-transport" if codes else "icp")
    assert compared(0.1, 0.5, 0.2, failures=("reversing",)).recommended == "parallel-transport"
    assert (
        Evaluation((Row("icp", feasibility_gap=Gaps(0.1, 0.1, 0.1), **metrics),)).recommended
        == "icp"
    )
