"""Every kernel computes what NumPy does: compiled, uncompiled, for every way of broadcasting."""

import numpy as np
import numpy_kernels
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd
from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd import kernels
from maniport.spd.kernels import loops
from maniport.spd.kernels.loops import WIDTH

sizes = pytest.mark.parametrize("d", [2, 3, 6])
BATCHES = [
    ((), ()),
    ((WIDTH + 3,), (WIDTH + 3,)),
    ((), (2 * WIDTH,)),
    ((2 * WIDTH + 1,), ()),
    ((5, 1), (5, 7)),
    ((5, 7), (5, 1)),
    ((7,), (5, 7)),
    ((5, 1), (1, 7)),
    ((2, 1, 3), (2, 4, 3)),
    ((1, 3, 1), (2, 3, 5)),
    ((0,), (0,)),
    ((), (2, 0)),
]


@sizes
@pytest.mark.parametrize(("first", "second"), BATCHES)
def test_pairs_broadcast_as_in_numpy(d, first, second, random_spd):
    """Distances and congruences agree with their twins for every way in which leading axes can fit."""
    rng = np.random.default_rng(1)
    a, b = random_spd(rng, first, d, condition=100.0), random_spd(rng, second, d, condition=100.0)
    assert_allclose(kernels.distances(a, b), numpy_kernels.distances(a, b), rtol=1e-11, atol=1e-12)
    left = a + 0.1 * rng.standard_normal(a.shape)  # need not be symmetric
    assert_allclose(kernels.congruence(left, b), numpy_kernels.congruence(left, b), rtol=1e-12, atol=1e-12)
    assert kernels.distances(a, b).shape == np.broadcast_shapes(first, second)


@sizes
@pytest.mark.parametrize(("first", "second"), BATCHES)
def test_composing_broadcasts_as_in_numpy(d, first, second, random_symmetric):
    """Eigenvalues and eigenvectors of different batch shapes compose as the twin composes them, exactly symmetric."""
    rng = np.random.default_rng(2)
    values, vectors = rng.standard_normal((*first, d)), random_symmetric(rng, second, d)
    composed = kernels.compose(values, vectors)
    assert_allclose(composed, numpy_kernels.compose(values, vectors), atol=1e-12)
    assert_array_equal(composed, np.swapaxes(composed, -1, -2))


@sizes
@pytest.mark.parametrize("shape", [(), (WIDTH + 5,), (3, WIDTH), (0,)])
@pytest.mark.parametrize("exponent", [-1.5, 0.0, 0.3, 2.0])
def test_power_between_congruences(d, shape, exponent, random_spd):
    """R (L X Lᵀ)^s Rᵀ agrees with its twin and with one matrix at a time, bit for bit, and is exactly symmetric."""
    rng = np.random.default_rng(3)
    left, right = np.eye(d) + 0.2 * rng.standard_normal((2, d, d)) / np.sqrt(d)
    x = random_spd(rng, shape, d, condition=1e3)
    found = kernels.power_congruence(left, x, exponent, right)
    assert_allclose(found, numpy_kernels.power_congruence(left, x, exponent, right), rtol=1e-9, atol=1e-10)
    assert_array_equal(found, np.swapaxes(found, -1, -2))
    if shape == (WIDTH + 5,):
        for index in (0, WIDTH - 1, WIDTH, WIDTH + 4):
            assert_array_equal(kernels.power_congruence(left, x[index], exponent, right), found[index])


@sizes
def test_power_between_congruences_refuses_what_it_cannot_compute(d, random_spd):
    """A power beyond range, and a point that recentring makes indefinite, raise an error that names the points."""
    x, eye = random_spd(np.random.default_rng(4), (WIDTH + 1,), d), np.eye(d)
    with pytest.raises(InvalidInputError, match=r"data takes the result out of range: .* 1e-150 to 1e\+150"):
        kernels.power_congruence(eye, x, 1e4, eye, name="data")
    x[-1] = -eye
    with pytest.raises(NotSPDError, match="points are too ill-conditioned"):
        kernels.power_congruence(eye, x, 0.5, eye)


@sizes
def test_distances_of_what_is_not_positive_definite_are_refused(d, random_spd):
    """An indefinite matrix on the left or on the right of a pair raises an error instead of giving nan."""
    x = random_spd(np.random.default_rng(5), (2, WIDTH + 1), d)
    x[1, -1] = -np.eye(d)
    with pytest.raises(NotSPDError):
        kernels.distances(x[0], x[1])
    with pytest.raises((NotSPDError, np.linalg.LinAlgError)):
        kernels.distances(x[1], x[0])


def test_read_only_and_strided_input_is_not_compiled_for_again(random_spd):
    """Views, read-only arrays and other layouts run through the machine code there is."""
    x = random_spd(np.random.default_rng(6), (20,), 3)
    kernels.distances(x, x)
    before = len(loops.distance_loop.signatures)
    frozen = x.copy()
    frozen.setflags(write=False)
    assert_array_equal(kernels.distances(frozen[::2], np.asfortranarray(x)[::2]), kernels.distances(x, x)[::2])
    assert len(loops.distance_loop.signatures) == before


def everything(x, e):
    """What all kernels make of matrices x (n, d, d) and one more, e."""
    w = np.full(len(x), 1 / len(x))
    values, vectors = kernels.eigh(x)
    at = kernels.moments(x, e, w, w, True)
    found = [values, vectors, kernels.compose(values, vectors), kernels.congruence(e, x), spd.distance(x[0], x)]
    return [*found, kernels.power_congruence(e, x, 0.7, e), at.cost, at.rounding, at.gradient, at.hessian, spd.mean(x)]


@pytest.mark.parametrize("d", [2, 3, 6, 11])
def test_a_matrix_gets_the_same_bits_alone_and_in_a_batch(d, random_spd):
    """All kernels but the sums over a batch give each matrix what they give it alone."""
    x, e = random_spd(np.random.default_rng(d), (WIDTH + 3,), d, 1e6), random_spd(np.random.default_rng(0), (), d)
    together = everything(x, e)[:6]
    for row in (0, 1, WIDTH - 1, WIDTH + 2):
        alone = everything(x[[row]], e)[:6]
        for index, (one, batch) in enumerate(zip(alone, together, strict=True)):
            if index != 4:  # distances from the first of each
                assert_array_equal(one[0], batch[row])
