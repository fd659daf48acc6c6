import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from maniport import spd
from maniport.errors import NotInvertibleError
from maniport.transfer import METHODS, method_of
from properties.strategies import cases, congruent, fewer, refused_only_above

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
QUICK = {"icp": {"n_starts": 0}, "length-field": {"n_rounds": 2}}
"""Parameters with which methods take less time and keep the same laws."""
METHOD_NAMES = tuple(METHODS)
methods = pytest.mark.parametrize("name", METHOD_NAMES)
ELONGATED = ("too ill-conditioned", "is singular", "is indefinite")
"""Words of the errors that refuse what is too elongated."""
RIGID = ("mean-transport", "parallel-transport", "scaled-transport", "icp")
SMALL = (2, 3, 4, 5, 6)


def made(name, **options):
    return method_of(name).set_params(**QUICK.get(name, {}), **options)


def domains(name, case):
    """Teacher, student and four new ellipsoids of the teacher, of a size that the method takes."""
    return case.spd(13), congruent(2.0 * case.change(), case.spd(14)), case.spd(4)


def assert_same_images(found, wanted, rounding):
    assert_allclose(spd.distance(found, wanted), 0.0, atol=rounding)


@methods
@fewer(0.35)
@given(
    case=cases(least=0.3, most=5.0, sizes=SMALL),
    units=st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
)
def test_units_only_scale_images_and_a_common_frame_turns_them(name, case, units):
    teacher, student, new = domains(name, case)
    one, other = 10.0 ** np.array(units)
    if name in ("identity", "nearest-neighbor"):  # these compare both bodies as they are
        other = one
    images = made(name, damping=0.01).fit(teacher, student).transform(new)
    scaled = made(name, damping=0.01).fit(one * teacher, other * student).transform(one * new)
    assert_same_images(scaled, other * images, 1e-5)
    turn = np.linalg.qr(case.rng.standard_normal((case.d, case.d)))[0]
    turned = made(name, damping=0.01).fit(congruent(turn, teacher), congruent(turn, student))
    assert_same_images(turned.transform(congruent(turn, new)), congruent(turn, images), 1e-5)


@methods
@fewer(0.7)
@given(case=cases(least=0.3, sizes=SMALL))
def test_images_are_ellipsoids_or_refused(name, case):
    teacher, student, new = domains(name, case)
    with refused_only_above(case.rounding_between, ELONGATED):
        adapter = made(name).fit(teacher, student)
        images = adapter.transform(new)
        assert np.all(spd.lengths(images) > 0.0)
        rounding = 1e-12 if name == "length-field" else 0.0  # it sums over centers by BLAS
        bits = {"rtol": rounding, "atol": rounding * np.abs(images).max()}
        assert_allclose(adapter.transform(new[::-1]), images[::-1], **bits)
        assert_allclose([adapter.transform(one) for one in new], images, **bits)


@methods
@fewer(0.35)
@given(case=cases(least=0.3, most=6.0, sizes=SMALL))
def test_inverse_images_have_the_images(name, case):
    teacher, student, new = domains(name, case)
    adapter = made(name).fit(teacher, student)
    images = adapter.transform(new)
    rounding = 1e-5 + 100.0 * case.rounding
    try:
        back = adapter.inverse_transform(images)
    except NotInvertibleError:
        assert name not in (*RIGID, "identity")
        return
    if name != "length-field":
        assert_same_images(back, new, rounding)
    assert_same_images(adapter.transform(back), images, rounding)
