"""Laws of a Riemannian metric, written once and run on both metrics, every size and every batch shape."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maniport.spd import affine_invariant, log_euclidean

pytestmark = [
    pytest.mark.parametrize("metric", [affine_invariant, log_euclidean], ids=["affine-invariant", "log-Euclidean"]),
    pytest.mark.parametrize(("d", "shape"), [(2, ()), (3, (5,)), (3, (2, 3)), (6, (5,)), (12, (2, 3))]),
]
seeds = given(seed=st.integers(0, 2**32 - 1))


@seeds
def test_distance_is_a_metric(metric, d, shape, seed, random_spd):
    """The distance is symmetric, zero from a point to itself, positive otherwise, and no detour is shorter."""
    a, b, c = random_spd(np.random.default_rng(seed), (3, *shape), d)
    assert metric.distance(a, b).shape == shape
    assert_allclose(metric.distance(a, b), metric.distance(b, a), rtol=1e-9)
    assert_allclose(metric.distance(a, a), 0.0, atol=1e-10)
    assert np.all(metric.distance(a, b) > 0)
    assert np.all(metric.distance(a, c) <= metric.distance(a, b) + metric.distance(b, c) + 1e-10)


@seeds
def test_inversion_is_an_isometry(metric, d, shape, seed, random_spd):
    """Inverting both points keeps their distance."""
    a, b = random_spd(np.random.default_rng(seed), (2, *shape), d)
    assert_allclose(metric.distance(np.linalg.inv(a), np.linalg.inv(b)), metric.distance(a, b), rtol=1e-8)


@seeds
def test_rotation_and_scaling_are_isometries(metric, d, shape, seed, random_spd):
    """Turning both points by the same orthogonal matrix, and scaling both, keeps their distance."""
    rng = np.random.default_rng(seed)
    a, b = random_spd(rng, (2, *shape), d)
    turn = 3.0 * np.linalg.qr(rng.standard_normal((d, d)))[0]
    assert_allclose(metric.distance(turn @ a @ turn.T, turn @ b @ turn.T), metric.distance(a, b), rtol=1e-8)


@seeds
def test_exp_undoes_log(metric, d, shape, seed, random_spd):
    """Going from A along log_A(B) arrives at B."""
    a, b = random_spd(np.random.default_rng(seed), (2, *shape), d)
    assert_allclose(metric.distance(metric.exp(a, metric.log(a, b)), b), 0.0, atol=1e-8)


@seeds
def test_log_undoes_exp(metric, d, shape, seed, random_spd, random_symmetric):
    """The log of the point reached along a tangent is that tangent."""
    rng = np.random.default_rng(seed)
    base = random_spd(rng, shape, d, condition=10.0)
    tangent = 0.3 * random_symmetric(rng, shape, d)
    assert_allclose(metric.log(base, metric.exp(base, tangent)), tangent, atol=1e-9)


@seeds
def test_length_of_log_is_distance(metric, d, shape, seed, random_spd):
    """The norm of log_A(B) at A is the distance from A to B."""
    a, b = random_spd(np.random.default_rng(seed), (2, *shape), d)
    tangent = metric.log(a, b)
    assert_allclose(np.sqrt(metric.inner(a, tangent, tangent)), metric.distance(a, b), rtol=1e-9)


@seeds
def test_inner_product_is_bilinear_and_symmetric(metric, d, shape, seed, random_spd, random_symmetric):
    """The inner product is symmetric, linear in its first tangent and positive."""
    rng = np.random.default_rng(seed)
    base = random_spd(rng, shape, d, condition=10.0)
    one, two, three = random_symmetric(rng, (3, *shape), d)
    assert_allclose(metric.inner(base, one, two), metric.inner(base, two, one), rtol=1e-9, atol=1e-10)
    combined = 2.0 * metric.inner(base, one, three) + metric.inner(base, two, three)
    assert_allclose(metric.inner(base, 2.0 * one + two, three), combined, rtol=1e-9, atol=1e-10)
    assert np.all(metric.inner(base, one, one) > 0)


@seeds
def test_geodesic_has_its_ends_and_constant_speed(metric, d, shape, seed, random_spd):
    """The geodesic starts at A, ends at B, is as fast as d(A, B), and is the same backwards."""
    a, b = random_spd(np.random.default_rng(seed), (2, *shape), d)
    length = metric.distance(a, b)
    assert_allclose(metric.distance(metric.geodesic(a, b, 0.0), a), 0.0, atol=1e-8)
    assert_allclose(metric.distance(metric.geodesic(a, b, 1.0), b), 0.0, atol=1e-8)
    for start, end in [(0.0, 0.5), (0.2, 0.9), (-0.3, 1.2)]:
        gap = metric.distance(metric.geodesic(a, b, start), metric.geodesic(a, b, end))
        assert_allclose(gap, (end - start) * length, rtol=1e-7)
    assert_allclose(metric.distance(metric.geodesic(a, b, 0.3), metric.geodesic(b, a, 0.7)), 0.0, atol=1e-8)


@seeds
def test_transport_is_an_isometry_with_inverse(metric, d, shape, seed, random_spd, random_symmetric):
    """Transport keeps inner products, and transport along the way back undoes it."""
    rng = np.random.default_rng(seed)
    start, end = random_spd(rng, (2, *shape), d, condition=100.0)
    one, two = random_symmetric(rng, (2, *shape), d)
    moved_one, moved_two = metric.transport(one, start, end), metric.transport(two, start, end)
    before = metric.inner(start, one, two)
    scale = np.sqrt(metric.inner(start, one, one) * metric.inner(start, two, two))
    assert_allclose(metric.inner(end, moved_one, moved_two) / scale, before / scale, atol=1e-9)
    assert_allclose(metric.transport(moved_one, end, start), one, atol=1e-9)


@seeds
def test_transport_carries_velocity_along_the_geodesic(metric, d, shape, seed, random_spd):
    """The velocity of a geodesic, transported to a later point of it, is the velocity there."""
    a, b = random_spd(np.random.default_rng(seed), (2, *shape), d, condition=100.0)
    middle = metric.geodesic(a, b, 0.4)
    assert_allclose(metric.transport(metric.log(a, b), a, middle), metric.log(middle, b) / 0.6, atol=1e-8)
    assert_allclose(metric.transport(metric.log(a, b), a, b), -metric.log(b, a), atol=1e-8)


def test_one_point_equals_its_row_in_a_batch(metric, d, shape, random_spd):
    """Every operation on one pair of matrices gives, bit for bit, what it gives within a batch."""
    a, b = random_spd(np.random.default_rng(3), (2, *shape, 9), d)
    tangents = metric.log(a, b)
    whole = [metric.distance(a, b), tangents, metric.exp(a, tangents), metric.transport(tangents, a, b)]
    whole.append(metric.geodesic(a, b, np.full(a.shape[:-2], 0.3)))
    for index in [(0,) * (len(shape) + 1), (*(size - 1 for size in shape), 8)]:
        one, two = a[index], b[index]
        tangent = metric.log(one, two)
        alone = [metric.distance(one, two), tangent, metric.exp(one, tangent), metric.transport(tangent, one, two)]
        alone.append(metric.geodesic(one, two, np.array(0.3)))
        for batch, single in zip(whole, alone, strict=True):
            assert_array_equal(batch[index], single)


def test_leading_axes_broadcast(metric, d, shape, random_spd):
    """One base point serves a whole batch, and parameters spread over a new axis sample a geodesic."""
    rng = np.random.default_rng(1)
    base, batch = random_spd(rng, (), d), random_spd(rng, (*shape, 4), d)
    assert metric.distance(base, batch).shape == (*shape, 4)
    tangents = metric.log(base, batch)
    assert tangents.shape == metric.exp(base, tangents).shape == metric.transport(tangents, base, batch).shape
    times = np.linspace(0, 1, 4)
    path = metric.geodesic(base, batch[..., 1, :, :][..., None, :, :], times)
    assert path.shape == (*shape, 4, d, d)
    assert_allclose(path[..., 2, :, :], metric.geodesic(base, batch[..., 1, :, :], times[2]), rtol=1e-12)


def test_empty_batch_gives_an_empty_batch(metric, d, shape):
    """No matrices in, no matrices out."""
    empty = np.zeros((*shape, 0, d, d))
    assert metric.distance(empty, empty).shape == (*shape, 0)
    for result in [metric.log(empty, empty), metric.exp(empty, empty), metric.transport(empty, empty, empty)]:
        assert result.shape == empty.shape
    assert metric.geodesic(empty, empty, 0.5).shape == empty.shape


@pytest.mark.parametrize("arguments", ["distance", "log", "exp", "inner", "geodesic", "transport"])
def test_batches_that_do_not_broadcast_are_refused(metric, d, shape, arguments):
    """Leading axes that do not fit are named in the error, with the shapes that were found."""
    few, many = np.broadcast_to(np.eye(d), (3, d, d)), np.broadcast_to(np.eye(d), (4, d, d))
    given_to = {"inner": (few, many, many), "geodesic": (few, many, 0.5), "transport": (few, many, many)}
    with pytest.raises(ValueError, match=rf"leading axes must broadcast.*\(3, {d}, {d}\).*\(4, {d}, {d}\)"):
        getattr(metric, arguments)(*given_to.get(arguments, (few, many)))
