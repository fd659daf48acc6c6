"""Measures of evaluation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from maniport.evaluation import distance_preservation, rmse, smoothness
from properties.strategies import FORMS, ROUNDED, TAME, cases, congruent

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
forms = st.sampled_from(sorted(FORMS | ROUNDED))
MEASURES = {"rmse": rmse, "smoothness": smoothness, "distance_preservation": distance_preservation}
measures = pytest.mark.parametrize("measure", MEASURES.values(), ids=MEASURES)


def numbers(measured):
    """Numbers of a measure, nan where there is none."""
    return np.array([np.nan if value is None else value for value in vars(measured).values()], dtype=np.float64)


@measures
@given(case=TAME.filter(lambda case: case.condition > 1.5), disguises=st.tuples(forms, forms))
def test_dtype_and_memory_order_do_not_matter(measure, case, disguises):
    given_to = [(FORMS | ROUNDED)[form](case.spd(6)) for form in disguises]
    plain = [np.array(one, dtype=np.float64, order="C") for one in given_to]
    assert measure(*given_to) == measure(*plain)
    assert isinstance(numbers(measure(*given_to)).sum(), float)


@measures
@given(case=cases(least=0.2, most=8.0))
def test_measures_do_not_depend_on_frame_unit_and_direction(measure, case):
    mapped, original = case.spd(2, 6)
    wanted, rounding = numbers(measure(mapped, original)), 1e-6 + 100.0 * case.rounding
    turn = np.linalg.qr(case.rng.standard_normal((case.d, case.d)))[0]
    assert_allclose(
        numbers(measure(congruent(turn, mapped), congruent(turn, original))), wanted, atol=rounding, rtol=rounding
    )
    assert_allclose(numbers(measure(1e3 * mapped, 1e3 * original)), wanted, atol=rounding, rtol=rounding)
    assert_allclose(numbers(measure(mapped[::-1], original[::-1])), wanted, atol=rounding, rtol=rounding)
