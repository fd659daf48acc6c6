"""How exact the kernels are, against forty digits."""

import os

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import spd
from maniport.spd.kernels import LANES, eigh, eigh_numpy, pieces, power_congruence

if not os.environ.get("CI"):  # in CI a missing reference is a failure
    pytest.importorskip("mpmath")

import mpmath

implementations = pytest.mark.parametrize("solve", [eigh, eigh_numpy], ids=["compiled", "NumPy"])
sizes = pytest.mark.parametrize("d", [2, 3, 6])
EPS = np.finfo(np.float64).eps


def exact_logarithms(matrices):
    """Logarithms of the eigenvalues of the matrices as they are stored, from forty digits, ascending."""
    with mpmath.workdps(40):
        spectra = [mpmath.eigsy(mpmath.matrix(matrix.tolist()), eigvals_only=True) for matrix in matrices]
        return np.array([sorted(float(mpmath.log(value)) for value in spectrum) for spectrum in spectra])


@implementations
@sizes
@pytest.mark.parametrize("condition", [1e2, 1e7, 1e12])
def test_rotated_matrices_lose_no_more_than_their_condition(solve, d, condition, random_spd):
    """With axes in general directions, log-eigenvalues are exact to machine precision times the condition number."""
    x = random_spd(np.random.default_rng(d), (20,), d, condition)
    assert np.abs(np.log(solve(x)[0]) - exact_logarithms(x)).max() <= max(EPS * condition, 4 * EPS * np.log(condition))


@implementations
@sizes
@pytest.mark.parametrize("condition", [1e2, 1e7, 1e12])
def test_graded_matrices_lose_nothing(solve, d, condition, random_spd):
    """Where the small axes come from small units, D A D with a diagonal D, all log-eigenvalues have 13 digits."""
    well = random_spd(np.random.default_rng(d), (20,), d, 4.0)
    scale = np.logspace(-0.5 * np.log10(condition), 0.0, d)
    for order in (slice(None), slice(None, None, -1)):
        graded = well * np.outer(scale[order], scale[order])
        assert np.abs(np.log(solve(graded)[0]) - exact_logarithms(graded)).max() <= 1e-13


@sizes
@pytest.mark.parametrize("condition", [1e2, 1e12])
def test_distance_from_the_identity_is_as_exact_as_the_eigenvalues(d, condition, random_spd):
    """The fused distance loses no more to rounding than its log-eigenvalues may."""
    x = random_spd(np.random.default_rng(d), (20,), d, condition)
    expected = np.linalg.norm(exact_logarithms(x), axis=-1)
    error = np.abs(spd.distance(np.eye(d), x) - expected)
    assert error.max() <= max(EPS * condition, 8 * EPS * np.log(condition)) * np.sqrt(d)


def test_logarithm_and_exponential_of_a_block_are_exact():
    """The logarithm and the exponential that work on sixteen numbers at once are within one unit in the last place."""
    powers = np.r_[np.linspace(-140, 140, 20 * LANES - 3), -1e-9, 0.0, 1e-9]
    with mpmath.workdps(40):
        exact_log = np.array([float(mpmath.log(mpmath.mpf(float(x)))) for x in 10.0**powers])
        exact_exp = np.array([float(mpmath.exp(mpmath.mpf(float(x)))) for x in 4.0 * powers])
    with np.errstate(over="ignore"):
        for first in range(0, len(powers), LANES):
            part = slice(first, first + LANES)
            found = pieces.log.py_func(10.0 ** powers[part])
            assert np.all(np.abs(found - exact_log[part]) <= np.spacing(np.abs(exact_log[part])))
            found = pieces.exp.py_func(4.0 * powers[part])
            assert np.all(np.abs(found - exact_exp[part]) <= np.spacing(exact_exp[part]))


def test_compiled_logarithm_and_exponential_are_exact():
    """A power of diagonal matrices, whose Jacobi rotations are none, is exact to the rounding of the exponent."""
    exponents = np.linspace(-69, 69, 40)
    x = np.exp(exponents)[:, None, None] * np.eye(2)
    for s in (-2.0, -0.5, 0.3, 1.0, 2.0):
        with mpmath.workdps(40):
            exact = [float(mpmath.power(mpmath.mpf(float(value)), mpmath.mpf(s))) for value in x[:, 0, 0]]
        found = power_congruence(np.eye(2), x, s, np.eye(2))[:, 0, 0]
        assert_allclose(found, exact, rtol=4 * EPS * (1 + 69 * abs(s)) / 2)
