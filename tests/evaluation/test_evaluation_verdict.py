"""Tests of the verdict."""

import pytest

from maniport.evaluation.measures import RMSE, Smoothness, Structure
from maniport.evaluation.reliability import Stability
from maniport.evaluation.rows import LOOKUP, RAW_COPY, RECENTRING, TRANSPORT, Gaps, Row
from maniport.evaluation.rule import EQUAL
from maniport.evaluation.verdict import verdict
from maniport.telling.transfer import verdict_facts


def in_words(found):
    """What is said of a verdict."""
    return " ".join(fact.text for fact in verdict_facts(found))


def rows(mine, nothing, transport, lookup=0.0, **first):
    """Rows with these mean feasibility gaps."""
    values = {"icp": mine, RAW_COPY: nothing, TRANSPORT: transport, LOOKUP: lookup}
    return [
        Row(name, feasibility_gap=Gaps(value, 0.0, 2 * value), **(first if name == "icp" else {}))
        for name, value in values.items()
    ]


@pytest.mark.parametrize(
    ("gaps", "sentence"),
    [
        (
            (0.1, 0.5, 0.2),
            "icp is better than doing nothing and than every cheap alternative: mean feasibility gap 0.100 against "
            "0.500 of a raw copy, 0.200 of parallel transport.",
        ),
        (
            (0.3, 0.5, 0.2),
            "icp is better than doing nothing (mean feasibility gap 0.300 against 0.500 of a raw copy), but not better "
            "than parallel transport (0.200).",
        ),
        (
            (0.198, 0.5, 0.2),
            "icp is better than doing nothing (mean feasibility gap 0.198 against 0.500 of a raw copy), but hardly "
            "better than parallel transport (0.200).",
        ),
        ((0.6, 0.5, 0.2), "icp is not better than doing nothing: mean feasibility gap 0.600, raw copy 0.500."),
        ((0.49, 0.5, 0.2), "icp is hardly better than doing nothing: mean feasibility gap 0.490, raw copy 0.500."),
        (
            (0.1, 0.5, 0.7),
            "icp is better than doing nothing: mean feasibility gap 0.100 against 0.500 of a raw copy.",
        ),
    ],
)
def test_the_first_sentence_weighs_the_adapter_against_the_alternatives(gaps, sentence):
    """Better by less than 5 % is hardly better; the lookup table has no gap by construction and does not count."""
    assert in_words(verdict(rows(*gaps))).startswith(sentence)


def test_known_truth_comes_before_gaps_and_lets_the_lookup_take_part():
    """Where the truth is known the RMSE decides."""
    table = [
        Row("icp", rmse=RMSE(0.4, 1.0, 1.0), feasibility_gap=Gaps(0.0, 0.0, 0.0)),
        Row(RAW_COPY, rmse=RMSE(0.9, 1.0, 1.0), feasibility_gap=Gaps(1.0, 1.0, 1.0)),
        Row(LOOKUP, rmse=RMSE(0.2, 1.0, 1.0), feasibility_gap=Gaps(0.0, 0.0, 0.0)),
    ]
    told = verdict(table)
    assert told.measure == "rmse"
    assert (told.value, told.raw_copy, told.best, told.best_value, told.recommended) == (0.4, 0.9, LOOKUP, 0.2, LOOKUP)
    assert in_words(told) == (
        "icp is better than doing nothing (RMSE 0.400 against 0.900 of a raw copy), but not better than nearest "
        "neighbor (0.200). Take nearest-neighbor."
    )


def test_without_kinematics_and_truth_nothing_is_compared():
    """The distance to samples is no measure of feasibility, so that there is no verdict but for the weaknesses."""
    told = verdict([Row("icp", identity=0.8), Row(RAW_COPY, identity=0.0)])
    assert (told.measure, told.values, told.value, told.best, told.recommended) == ("", {}, None, "", "")
    assert [one.code for one in told.weaknesses] == ["restless"]
    assert "not compared" in in_words(told)


@pytest.mark.parametrize(
    ("gaps", "recommended"),
    [
        ((0.409, 0.362, 0.409), RAW_COPY),
        ((0.409, 0.5, 0.409), TRANSPORT),
        ((0.4, 0.405, 0.41), RAW_COPY),
        ((0.3, 0.5, 0.31), TRANSPORT),
        ((0.2, 0.5, 0.31), "icp"),
        ((0.0, 0.0, 0.0), RAW_COPY),
    ],
)
def test_what_is_recommended_is_never_clearly_worse_than_anything_else(gaps, recommended):
    """The cheapest method that no other undercuts by 5 %: parallel transport never, where a raw copy is better."""
    told = verdict(rows(*gaps))
    assert told.recommended == recommended
    assert told.best_value == min(gaps)
    assert told.values[recommended] * 0.95 <= min(gaps)


def test_a_lookup_is_never_recommended_for_its_gaps():
    """They are none by construction, also where it is the method that is asked about."""
    table = [Row(LOOKUP, method=LOOKUP, feasibility_gap=Gaps(0.0, 0.0, 0.0)), *rows(0.9, 0.5, 0.2)[1:3]]
    assert (verdict(table).best, verdict(table).recommended) == (LOOKUP, TRANSPORT)


def test_a_method_of_one_s_own_is_recommended_by_the_name_of_its_row():
    """It is in no registry; where it is the best, its row is named."""
    table = [Row("mine", feasibility_gap=Gaps(0.1, 0.1, 0.1)), *rows(0.9, 0.5, 0.2)[1:]]
    assert verdict(table).recommended == "mine"
    table[0] = Row("mine", method="icp", feasibility_gap=Gaps(0.1, 0.1, 0.1))
    assert verdict(table).recommended == "icp"
    assert verdict(table).as_dict()["best"] == "mine"


def test_doing_nothing_is_said_to_do_nothing():
    """An adapter that maps as a raw copy does is called so."""
    told = verdict(rows(0.5, 0.5, 0.2))
    assert told.same_as == (RAW_COPY,)
    assert in_words(told).startswith("icp does what a raw copy does (mean feasibility gap 0.500).")


def test_a_fit_that_keeps_its_start_is_said_to_add_nothing():
    """Where an adapter has the error of a closed form, exactly, it maps as that does."""
    told = in_words(verdict(rows(0.2, 0.5, 0.2 * (1 + 0.1 * EQUAL))))
    assert told.endswith("of a raw copy. It does no more here than parallel transport does (0.200).")


@pytest.mark.parametrize(("recentring", "transport"), [(0.2, 0.2), (0.19999, 0.20001), (0.20001, 0.2)])
def test_ties_are_named_together(recentring, transport):
    """Alternatives that reach the same number, as it is written, stand in one sentence with it."""
    table = [*rows(0.2, 0.5, transport), Row(RECENTRING, feasibility_gap=Gaps(recentring, 0.0, 0.4))]
    told = in_words(verdict(table))
    assert "does no more here than recentring and parallel transport do (0.200 each)." in told
    assert "better than recentring" not in told


def test_a_lookup_is_called_a_staircase():
    """Its gaps are none by construction, so that its price has to be told beside."""
    price = {"smoothness": Smoothness(1.0, 0.0, 1.0, 0.1), "structure": Structure(0.77, 0.1, 30.0, 5.0, 0, 0)}
    told = in_words(verdict(rows(0.0, 0.5, 0.2, **price)))
    assert "icp is a staircase: where the teacher moves, half of its steps or more are zero." in told
    assert "icp mixes up near and far: rank correlation of distances 0.77." in told
    assert told.endswith("icp turns the longest axes by 30° (median).")


def test_weaknesses_follow():
    """A jump, a damaged identity and an unsteady rotation are told with their numbers, in this order."""
    weak = {
        "smoothness": Smoothness(13.0, 1.0, 1.0, 1.0),
        "identity": 0.8,
        "stability": Stability(30.0, 16.0, 0.4, 5),
    }
    table = rows(0.1, 0.5, 0.2, **weak)
    table[2] = Row(TRANSPORT, feasibility_gap=Gaps(0.2, 0.0, 0.4), identity=0.06)
    told = in_words(verdict(table))
    assert "The largest step of icp is 13.0 times the teacher's own." in told
    assert "by 0.800 where nothing should change; parallel transport: 0.060." in told
    assert told.endswith("16° (root mean square) between draws of the same domains: the domains do not determine it.")
