import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd
from maniport.errors import ConvergenceWarning
from properties.strategies import (
    FORMS,
    ROUNDED,
    TAME,
    cases,
    congruent,
    fewer,
    refused_only_above,
    require_same_for_every_form,
    results_of,
)

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

CALLS = {
    "spd.distance": ("pp", spd.distance),
    "spd.log": ("pp", spd.log),
    "spd.exp": ("px", spd.exp),
    "spd.inner": ("pxx", spd.inner),
    "spd.geodesic": ("pp", lambda a, b: spd.geodesic(a, b, 0.3)),
    "spd.transport": ("xpp", spd.transport),
    "spd.axes": ("p", spd.axes),
    "spd.lengths": ("p", spd.lengths),
    "spd.volume": ("p", spd.volume),
    "spd.expm": ("x", spd.expm),
    "spd.logm": ("p", spd.logm),
    "spd.powm": ("p", lambda a: spd.powm(a, -0.7)),
    "spd.to_vector": ("x", spd.to_vector),
    "spd.from_vector": ("v", spd.from_vector),
    "spd.mean": ("sw", spd.mean),
    "spd.dispersion": ("s", spd.dispersion),
}
"""Every function, and what it takes: points, tangents (x), Mandel vectors, a set of points, weights."""
functions = pytest.mark.parametrize("name", CALLS)
MANY = [name for name, (kinds, _) in CALLS.items() if "s" not in kinds]


def arguments(case, kinds, *shape):
    make = {
        "p": lambda: case.spd(*shape),
        "x": lambda: case.with_scale(3.0).symmetric(*shape),
        "v": lambda: 3.0 * case.rng.standard_normal((*shape, case.d * (case.d + 1) // 2)),
        "s": lambda: case.spd(4),
        "w": lambda: case.rng.uniform(1.0, 9.0, 4),
    }
    return [make[kind]() for kind in kinds]


@functions
@given(case=TAME, shape=st.sampled_from([(), (3,), (2, 3)]))
def test_dtype_and_memory_order_do_not_matter(name, case, shape):
    kinds, function = CALLS[name]
    require_same_for_every_form(function, arguments(case, kinds, *shape), FORMS | ROUNDED)


@pytest.mark.parametrize("name", MANY)
@given(case=TAME)
def test_a_batch_is_its_members(name, case):
    kinds, function = CALLS[name]
    given_to = arguments(case, kinds, 2, 3)
    batch = results_of(function, given_to)
    for index in np.ndindex(2, 3):
        for whole, alone in zip(
            batch, results_of(function, [one[index] for one in given_to]), strict=True
        ):
            assert_array_equal(whole[index], alone)
    if len(kinds) > 1:
        for row, whole in zip(
            results_of(function, [given_to[0][1], *given_to[1:]]), batch, strict=True
        ):
            assert_array_equal(row[1], whole[1])
    for whole, nothing in zip(
        batch, results_of(function, [one[:, :0] for one in given_to]), strict=True
    ):
        assert nothing.shape == (2, 0, *whole.shape[2:])


@given(case=cases())
def test_distance_is_a_metric_at_every_condition(case):
    a, b, c = case.spd(3, 4)
    apart = spd.distance(a, b)
    assert_allclose(spd.distance(b, a), apart, atol=case.rounding)
    assert_allclose(spd.distance(a, a), 0.0, atol=case.rounding)
    assert_allclose(spd.distance(a, 4.0 * a), math.sqrt(case.d) * math.log(4.0), atol=case.rounding)
    assert np.all(spd.distance(a, c) <= apart + spd.distance(b, c) + case.rounding)
    assert_allclose(spd.distance(1e5 * a, 1e5 * b), apart, atol=case.rounding)


@given(case=cases())
def test_distance_is_invariant_under_congruence(case):
    a, b = case.spd(2, 4)
    change = case.change()
    assert_allclose(
        spd.distance(congruent(change, a), congruent(change, b)),
        spd.distance(a, b),
        atol=case.rounding,
    )
    chords = np.linalg.norm(spd.logm(a) - spd.logm(b), axis=(-2, -1))
    assert np.all(chords <= spd.distance(a, b) + case.rounding)


@given(case=cases())
def test_exponential_inverts_the_logarithm(case):
    a, b = case.spd(2, 4)
    with refused_only_above(case.rounding):
        tangent = spd.log(a, b)
        middle = spd.geodesic(a, b, 0.5)
        apart = spd.distance(a, b)
        for symmetric in (tangent, middle):
            assert_array_equal(symmetric, np.swapaxes(symmetric, -1, -2))
        assert_allclose(
            np.sqrt(spd.inner(a, tangent, tangent)), apart, rtol=case.rounding, atol=case.rounding
        )
        assert_allclose(spd.distance(a, middle), 0.5 * apart, atol=case.rounding)
        for end, t in ((a, 0.0), (b, 1.0)):
            assert_allclose(spd.distance(spd.geodesic(a, b, t), end), 0.0, atol=case.rounding)
        with refused_only_above(case.rounding_between):
            assert_allclose(
                spd.distance(spd.exp(a, 0.5 * tangent), middle), 0.0, atol=case.rounding_between
            )
            assert_allclose(spd.distance(spd.exp(a, tangent), b), 0.0, atol=case.rounding_between)


@given(case=cases())
def test_transport_keeps_inner_products(case):
    start, end, other, third = case.spd(4, 4)
    with refused_only_above(case.rounding):
        one = spd.log(start, other)
        two = spd.log(start, third)
        there = spd.transport(one, start, end), spd.transport(two, start, end)
        lengths = np.sqrt(spd.inner(start, one, one) * spd.inner(start, two, two))
        kept = spd.inner(end, *there) - spd.inner(start, one, two)
        assert np.all(np.abs(kept) <= 10.0 * case.rounding * (1.0 + lengths))
        back = spd.transport(there[0], end, start) - one
        assert np.all(
            np.sqrt(spd.inner(start, back, back)) <= 10.0 * case.rounding * (1.0 + lengths)
        )


@given(case=cases())
def test_powers_are_multiples_of_the_logarithm(case):
    x = case.spd(4)
    logarithm = spd.logm(x)
    assert_allclose(spd.distance(spd.expm(logarithm), x), 0.0, atol=case.rounding)
    for s in (-1.0, 0.0, 0.4, 1.0):
        assert_allclose(spd.logm(spd.powm(x, s)), s * logarithm, atol=case.rounding)


@given(case=cases())
def test_axes_give_the_ellipsoid_back(case):
    x = case.spd(4)
    lengths, directions = spd.axes(x)
    assert np.all(np.diff(lengths) >= 0.0)
    assert_allclose(np.swapaxes(directions, -1, -2) @ directions, [np.eye(case.d)] * 4, atol=1e-12)
    assert_allclose(
        (directions * lengths[:, None] ** 2) @ np.swapaxes(directions, -1, -2),
        x,
        atol=1e-12 * case.scale,
    )
    assert_array_equal(spd.lengths(x), lengths)
    assert_allclose(spd.volume(9.0 * x), 3.0**case.d * spd.volume(x), rtol=1e-9 + case.rounding)
    ball = spd.volume(np.eye(case.d))
    assert_allclose(spd.volume(x), ball * np.exp(0.5 * np.linalg.slogdet(x)[1]), rtol=case.rounding)


@fewer(0.7)
@given(case=cases(most=8.0))
def test_mean_and_dispersion_are_equivariant_under_congruence(case):
    x = case.spd(5)
    weights = case.rng.uniform(0.0, 1.0, 5)
    change = case.change()
    center = spd.mean(x, weights)
    order = case.rng.permutation(5)
    moved = spd.mean(congruent(change, x), 7.0 * weights)
    assert_allclose(spd.distance(moved, congruent(change, center)), 0.0, atol=case.rounding)
    assert_allclose(
        spd.distance(spd.mean(x[order], weights[order]), center), 0.0, atol=case.rounding
    )
    spread = spd.dispersion(x)
    assert_allclose(spd.dispersion(congruent(change, x)), spread, atol=case.rounding)
    assert_allclose(spd.dispersion(x[order]), spread, atol=case.rounding)


@fewer(0.7)
@given(case=cases())
def test_mean_is_no_farther_from_points_than_they_are_apart(case):
    x = case.spd(5)
    try:
        center = spd.mean(x)
    except ConvergenceWarning:
        assert case.condition > 1e10
        return
    assert np.all(spd.lengths(center) > 0.0)
    assert_array_equal(center, center.T)
    assert spd.distance(center, x).max() <= spd.distance(x[:, None], x).max() + case.rounding
