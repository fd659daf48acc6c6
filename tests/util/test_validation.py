import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.mean import as_weights
from maniport.util import validation as v

EYE = np.eye(3)
INDEFINITE = np.diag([1.0, 2.0, -3.0])
SINGULAR = np.diag([1.0, 2.0, 0.0])
ASYMMETRIC = EYE + 0.5 * np.eye(3, k=1)


def at(bad, index=2, count=4):
    batch = np.stack([EYE] * count)
    batch[index] = bad
    return batch


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("abc", "array of numbers; found str"),
        (None, "array of numbers; found None"),
        (np.eye(3) * 1j, "found ndarray: its numbers are complex"),
        (np.ma.masked_equal([1.0, 2.0], 2.0), "found masked entries"),
        ([1.0, np.nan, np.inf], "finite; found nan at index 1 (2 such entries)"),
        (np.ones((4, 3, 2)), "square matrices, shape (..., d, d); found shape (4, 3, 2)"),
        (np.eye(1), "matrices from 2×2 to 12×12; found 1×1"),
        (np.eye(13), "matrices from 2×2 to 12×12; found 13×13"),
    ],
)
@pytest.mark.parametrize("check", [v.as_symmetric, v.as_spd, v.as_positive_semidefinite])
def test_only_finite_square_matrices_pass(check, value, message):
    with pytest.raises(InvalidInputError, match=f"^m .*{re.escape(message)}"):
        check(value, "m")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (ASYMMETRIC, "m is not symmetric: |A - Aᵀ| reaches 0.5; allowed is 1e-08"),
        (at(ASYMMETRIC)[None], "m[0, 2] is not symmetric"),
        (
            INDEFINITE,
            "m is indefinite: its eigenvalues range from -3 to 2; all eigenvalues must be positive. Use damping",
        ),
        (
            np.stack([EYE, INDEFINITE, SINGULAR]),
            "m[1] is indefinite: its eigenvalues range from -3 to 2 (2 of 3 ",
        ),
        (at(SINGULAR), "m[2] is singular: its eigenvalues range from 0 to 2 (1 of 4 matrices)"),
        (np.diag([1e-15, 0.5, 0.5]), "m is singular"),
    ],
)
def test_only_spd_matrices_pass(value, message):
    with pytest.raises(NotSPDError, match=f"^{re.escape(message)}"):
        v.as_spd(value, "m", hint="Use damping")


@given(seed=st.integers(0, 2**32 - 1), exponent=st.floats(-60, 60))
def test_spd_matrices_pass_unchanged(seed, exponent):
    factor = np.random.default_rng(seed).standard_normal((4, 3, 8))
    matrices = 10.0**exponent * factor @ np.swapaxes(factor, 1, 2)
    checked = v.as_spd(matrices, "m")
    assert checked.dtype == np.float64
    assert_allclose(checked, matrices, atol=1e-14 * matrices.max())
    assert_array_equal(checked, np.swapaxes(checked, 1, 2))
    assert_array_equal(v.as_positive_semidefinite(matrices, "m"), checked)


def test_rounding_is_allowed_for():
    """Asymmetry up to 1e-8 of the largest entry is averaged away; zero and rank-deficient products are semidefinite."""
    matrix = 7.0 * EYE
    matrix[0, 1] = 7.0 * 0.5e-8
    assert_array_equal(v.as_symmetric(matrix, "m"), 0.5 * (matrix + matrix.T))
    matrix[0, 1] = 7.0 * 2e-8
    with pytest.raises(NotSPDError, match="not symmetric"):
        v.as_symmetric(matrix, "m")
    thin = np.random.default_rng(0).standard_normal((50, 3, 2))
    for fine in (np.zeros((3, 3)), np.outer([1, 2, 3], [1, 2, 3]), thin @ np.swapaxes(thin, 1, 2)):
        v.as_positive_semidefinite(fine, "m")
    with pytest.raises(NotSPDError, match=r"m\[2\].*indefinite"):
        v.as_positive_semidefinite(np.stack([np.zeros((3, 3)), EYE, INDEFINITE]), "m")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: v.as_spd(EYE, "m", dimension=6), "m must hold 6×6 matrices; found 3×3"),
        (
            lambda: v.as_points(EYE, "p"),
            "p must be a set of matrices, shape (n, d, d); found shape (3, 3)",
        ),
        (lambda: v.as_points(EYE[None], "p"), "p must hold at least 2 matrices; found 1"),
        (
            lambda: v.require_broadcast(a=np.zeros((5, 3, 3)), b=np.zeros((2, 4, 3, 3))),
            "found shapes a (5, 3, 3), b (",
        ),
        (lambda: as_weights([1.0, -1.0], 2), "weights must be non-negative with a positive sum"),
        (lambda: v.as_rotation(np.diag([1.0, 1.0, -1.0]), "r"), "r must be a rotation"),
        (lambda: v.as_rotation(2 * EYE, "r"), "r must be a rotation: R Rᵀ = I to 1e-6"),
        (lambda: v.as_rotation(np.eye(2), "r", dimension=3), "r must hold 3×3 matrices; found 2×2"),
        (lambda: v.as_count(2.5, "n"), "n must be a whole number of at least 1; found 2.5"),
        (
            lambda: v.as_count(7, "n", minimum=0, maximum=6),
            "n must be a whole number in [0, 6]; found 7",
        ),
        (
            lambda: v.as_number(np.nan, "x", minimum=0),
            "x must be a number of at least 0; found nan",
        ),
        (lambda: v.as_number(0.0, "x", above=0), "x must be a number above 0; found 0.0"),
        (lambda: v.as_number(1, "x", minimum=0, below=1), "x must be a number in [0, 1); found 1"),
        (
            lambda: v.as_numbers([1, 0, 2], "x", 3, above=0),
            "x must be 3 numbers above 0; found 0 at index 1",
        ),
        (
            lambda: v.as_numbers(-1, "x", 3, broadcast=True, minimum=0),
            "x must be one number or 3 numbers of at least 0;",
        ),
        (
            lambda: v.as_times([0, 2, 1, 3]),
            "time must increase strictly; found 1 s at index 2 after 2 s",
        ),
        (lambda: v.as_times([0, 1], count=3), "time must have shape (3,); found shape (2,)"),
        (lambda: v.as_times([0, 1e300]), "time must be in seconds, within ±1e+12"),
        (lambda: v.as_times([0, 1e-300]), "at least 1e-09 apart"),
        (
            lambda: v.as_metres([[0, 0, 1e300]], "path"),
            "path must be in meters, within ±10000; found 1e+300",
        ),
        (
            lambda: v.as_choice("c", "kind", ("a", "b")),
            "unknown kind 'c'; available, nearest first: 'a', 'b'",
        ),
        (lambda: v.as_flag("yes", "turn"), "turn must be True or False; found 'yes'"),
        (
            lambda: v.as_generator(-1),
            "random_state (unless None or a numpy Generator) must be a whole number",
        ),
        (
            lambda: v.require_shape(np.zeros((0, 3)), "a", ("n", 3)),
            "a must have shape (n, 3); found shape (0, 3)",
        ),
        (
            lambda: v.require_shape(np.zeros(2), "a", (3,), " of points"),
            "a must have shape (3,) of points; found",
        ),
        (
            lambda: v.require_shape(np.zeros((3, 4)), "a", (..., 3)),
            "a must have shape (..., 3); found shape (3, 4)",
        ),
    ],
)
def test_wrong_values_are_refused_with_what_is_allowed(call, message):
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        call()


def test_valid_values_pass():
    assert v.as_count(np.int64(3), "n") == 3
    assert v.as_number(2, "x", above=1, below=3) == 2.0
    assert_array_equal(v.as_numbers(2, "x", 3, broadcast=True, above=0), [2.0, 2.0, 2.0])
    assert_array_equal(v.as_times([0, 1, 3], count=3), [0.0, 1.0, 3.0])
    generator = np.random.default_rng(0)
    assert v.as_generator(generator) is generator
    assert v.as_generator(5).random() == v.as_generator(np.int32(5)).random()
    assert isinstance(v.as_generator(None), np.random.Generator)
    v.require_broadcast(a=np.zeros((4, 3, 3)), b=np.zeros((2, 4, 3, 3)))
    for shape, allowed in (
        ((3,), (3,)),
        ((5, 3, 3), ("n", 3, 3)),
        ((3,), (..., 3)),
        ((4, 0, 3), (..., 3)),
    ):
        v.require_shape(np.zeros(shape), "a", allowed)


def test_checked_input_is_copied_unless_it_is_only_read():
    matrices = at(2.0 * EYE)
    assert not np.shares_memory(v.as_spd(matrices, "m"), matrices)
    assert np.shares_memory(v.as_spd(matrices, "m", copy=False), matrices)
    matrices[1, 0, 1] = 1e-12
    averaged = v.as_spd(matrices, "m", copy=False)
    assert averaged[1, 0, 1] == averaged[1, 1, 0] == 0.5e-12
    assert matrices[1, 1, 0] == 0.0
    assert v.as_finite(matrices, "m") is matrices
