"""The checks at the door: what passes, and what the message says about what does not."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from maniport import validation
from maniport.demonstrations import shipped_recording
from maniport.errors import InvalidInputError, NotSPDError, UnknownNameError
from maniport.spd.mean import as_weights
from maniport.validation import (
    as_choice,
    as_count,
    as_finite,
    as_flag,
    as_generator,
    as_metres,
    as_number,
    as_numbers,
    as_points,
    as_positive_semidefinite,
    as_rotation,
    as_spd,
    as_symmetric,
    as_times,
    require_shape,
)

EYE = np.eye(3)
INDEFINITE = np.diag([1.0, 2.0, -3.0])
SINGULAR = np.diag([1.0, 2.0, 0.0])
ASYMMETRIC = np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def at(bad, index=2, count=4):
    """Make a batch of identities with one bad matrix."""
    batch = np.stack([EYE] * count)
    batch[index] = bad
    return batch


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("abc", r"m must be an array of numbers; found str"),
        ([[1.0, 2.0], [3.0]], r"m must be an array of numbers; found list"),
        (None, r"m must be an array of numbers; found None"),
        (np.eye(3) * 1j, r"m must be an array of numbers; found ndarray: its numbers are complex"),
        ([[1j, 0], [0, 1]], r"m must be an array of numbers; found list"),
        (10**400, r"m must be an array of numbers; found int"),
        (np.ma.masked_equal([1.0, 2.0], 2.0), r"m must be an array of numbers; found masked entries"),
        (object(), r"m must be an array of numbers; found object"),
        (np.nan, r"m must be finite; found nan$"),
        ([1.0, np.nan, np.inf], r"m must be finite; found nan at index 1 \(2 such entries\)"),
        ([[1.0, 2.0], [-np.inf, 1.0]], r"m must be finite; found -inf at index \(1, 0\) \(1 such entries\)"),
        (3.0, r"m must hold square matrices, shape \(\.\.\., d, d\); found shape \(\)"),
        ([1.0, 2.0, 3.0], r"m must hold square matrices, shape \(\.\.\., d, d\); found shape \(3,\)"),
        (np.ones((4, 3, 2)), r"m must hold square matrices, shape \(\.\.\., d, d\); found shape \(4, 3, 2\)"),
        ([], r"m must hold square matrices, shape \(\.\.\., d, d\); found shape \(0,\)"),
        (np.eye(1), r"m must hold matrices from 2×2 to 12×12; found 1×1"),
        (np.eye(13), r"m must hold matrices from 2×2 to 12×12; found 13×13"),
        (np.zeros((5, 0, 0)), r"m must hold matrices from 2×2 to 12×12; found 0×0"),
    ],
)
@pytest.mark.parametrize("check", [as_symmetric, as_spd, as_positive_semidefinite])
def test_what_is_no_square_matrix_of_numbers_is_refused(check, value, message):
    """Anything but finite real square matrices from 2×2 to 12×12 is refused with what was found and is allowed."""
    with pytest.raises(InvalidInputError, match=message):
        check(value, "m")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (ASYMMETRIC, r"^m is not symmetric: \|A - Aᵀ\| reaches 0\.5; allowed is 1e-08 of its largest entry, 1$"),
        (at(ASYMMETRIC), r"^m\[2\] is not symmetric"),
        (at(ASYMMETRIC)[None], r"^m\[0, 2\] is not symmetric"),
        (INDEFINITE, r"^m is indefinite: its eigenvalues range from -3 to 2; all eigenvalues must be positive$"),
        (at(INDEFINITE), r"^m\[2\] is indefinite: .* -3 to 2 \(1 of 4 matrices\); all eigenvalues must be positive"),
        (np.stack([EYE, INDEFINITE, SINGULAR]), r"^m\[1\] is indefinite: .*\(2 of 3 matrices\)"),
        (-EYE, r"^m is indefinite: its eigenvalues range from -1 to -1"),
        (at(SINGULAR), r"^m\[2\] is singular: its eigenvalues range from 0 to 2 \(1 of 4 matrices\)"),
        (np.zeros((3, 3)), r"^m is singular: its eigenvalues range from 0 to 0"),
        (np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), r"^m is singular"),
    ],
)
def test_what_is_not_spd_is_refused(value, message):
    """An asymmetric, indefinite or singular matrix is named with its index and eigenvalues."""
    with pytest.raises(NotSPDError, match=message):
        as_spd(value, "m")


def test_advice_for_singular_matrices_ends_the_message():
    """The caller's hint about singular matrices is appended."""
    with pytest.raises(NotSPDError, match=r"all eigenvalues must be positive\. Use damping$"):
        as_spd(SINGULAR, "m", hint="Use damping")


@pytest.mark.parametrize("magnitude", [1e-170, 1e-300, 1e170, 1e306])
@pytest.mark.parametrize("check", [as_spd, as_positive_semidefinite])
def test_magnitudes_beyond_computing_are_refused(check, magnitude):
    """Matrices whose eigenvalues could not be multiplied in floating point are refused with the advice to rescale."""
    with pytest.raises(
        InvalidInputError, match=r"m\[2\] has the trace .*allowed are zero and magnitudes.*another unit"
    ):
        check(at(magnitude * EYE), "m")


def test_another_dimension_than_required_is_refused():
    """The size that is needed and the size that was found are both named."""
    with pytest.raises(InvalidInputError, match="m must hold 6×6 matrices; found 3×3"):
        as_spd(EYE, "m", dimension=6)


@given(seed=st.integers(0, 2**32 - 1), exponent=st.floats(-60, 60))
def test_spd_matrices_pass_unchanged(seed, exponent):
    """A well-conditioned product A Aᵀ passes at any scale, as float64 and exactly symmetric."""
    factor = np.random.default_rng(seed).standard_normal((4, 3, 8))
    matrices = 10.0**exponent * factor @ np.swapaxes(factor, 1, 2)
    checked = as_spd(matrices, "m")
    assert checked.dtype == np.float64
    np.testing.assert_allclose(checked, matrices, atol=1e-14 * matrices.max())
    assert_array_equal(checked, np.swapaxes(checked, 1, 2))
    assert_array_equal(as_positive_semidefinite(matrices, "m"), checked)


def test_rounding_sized_asymmetry_is_averaged_away():
    """Asymmetry up to 1e-8 of the largest entry is taken for rounding, a little more is not."""
    for size, fits in ((0.5e-8, True), (2e-8, False)):
        matrix = 7.0 * EYE
        matrix[0, 1] = 7.0 * size
        if fits:
            assert_array_equal(as_symmetric(matrix, "m"), 0.5 * (matrix + matrix.T))
        else:
            with pytest.raises(NotSPDError, match="not symmetric"):
                as_symmetric(matrix, "m")


def test_other_number_types_are_converted():
    """Lists, integers and single precision come out as float64; an empty batch stays empty."""
    for value in ([[2, 1], [1, 2]], np.array([[2, 1], [1, 2]], dtype=np.float32), ((2, 1), (1, 2))):
        checked = as_spd(value, "m")
        assert checked.dtype == np.float64
        assert_array_equal(checked, [[2.0, 1.0], [1.0, 2.0]])
    assert as_spd(np.zeros((0, 3, 3)), "m").shape == (0, 3, 3)


def test_singular_products_pass_as_positive_semidefinite():
    """Zero, rank-one and rank-deficient products pass where singular ellipsoids are allowed; negative ones do not."""
    thin = np.random.default_rng(0).standard_normal((50, 3, 2))
    for fine in (np.zeros((3, 3)), np.outer([1, 2, 3], [1, 2, 3]), thin @ np.swapaxes(thin, 1, 2)):
        as_positive_semidefinite(fine, "m")
    batch = np.stack([np.zeros((3, 3)), EYE, INDEFINITE])
    with pytest.raises(
        NotSPDError, match=r"m\[2\] is indefinite: .*\(1 of 3 matrices\); no negative eigenvalue is allowed"
    ):
        as_positive_semidefinite(batch, "m")


@pytest.mark.parametrize("fraction", [1e-12, 1e-15])
def test_the_line_between_spd_and_singular(fraction):
    """A smallest eigenvalue of 1e-12 of the trace passes, one of 1e-15 counts as zero."""
    matrix = np.diag([fraction, 0.5, 0.5])
    if fraction > validation.SPD_TOLERANCE:
        as_spd(matrix, "m")
    else:
        with pytest.raises(NotSPDError, match=r"m is singular: its eigenvalues range from 1e-15 to 0\.5"):
            as_spd(matrix, "m")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (EYE, r"p must be a set of matrices, shape \(n, d, d\); found shape \(3, 3\)"),
        (np.stack([at(EYE)] * 2), r"p must be a set of matrices, shape \(n, d, d\); found shape \(2, 4, 3, 3\)"),
        ([], r"p must be a set of matrices, shape \(n, d, d\); found shape \(0,\)"),
        (np.zeros((0, 3, 3)), r"p must hold at least 2 matrices; found 0"),
        (EYE[None], r"p must hold at least 2 matrices; found 1"),
        (at(SINGULAR), r"p\[2\] is singular: .*positive\. Use damping"),
        ([EYE, np.eye(2)], r"p must be an array of numbers; found list"),
    ],
)
def test_what_is_no_set_of_points_is_refused(value, message):
    """One matrix, a batch of sets, nothing, too few or singular matrices are refused as a set of points."""
    with pytest.raises(InvalidInputError, match=message):
        as_points(value, "p", hint="Use damping")


@pytest.mark.parametrize("shape", [(), (4,), (2, 4), (1,)])
def test_matching_leading_axes_pass(shape):
    """Leading axes that broadcast in NumPy's sense are accepted."""
    validation.require_broadcast(a=np.zeros((*shape, 3, 3)), b=np.zeros((2, 4, 3, 3)))
    with pytest.raises(InvalidInputError, match=r"found shapes a \(5, 3, 3\), b \(2, 4, 3, 3\)"):
        validation.require_broadcast(a=np.zeros((5, 3, 3)), b=np.zeros((2, 4, 3, 3)))


def test_weights_sum_to_one():
    """Weights keep their proportions; none given means equal ones."""
    assert_array_equal(as_weights([1, 3, 0], 3), [0.25, 0.75, 0.0])
    assert_array_equal(as_weights(None, 4), np.full(4, 0.25))
    for size in (1e308, 1e-320):  # whose sum is infinite, or whose inverse is
        assert_array_equal(as_weights(np.full(4, size), 4), np.full(4, 0.25))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.diag([1.0, 1.0, -1.0]), r"r must be a rotation.*determinant -1"),
        (2 * EYE, r"r must be a rotation: R Rᵀ = I to 1e-6.*found \|R Rᵀ - I\| = 3"),
        (at(EYE), r"r must be one rotation matrix, shape \(d, d\); found shape \(4, 3, 3\)"),
        (np.eye(2), r"r must hold 3×3 matrices; found 2×2"),
    ],
)
def test_what_is_no_rotation_is_refused(value, message):
    """Reflections, scalings, batches and other sizes are refused as a rotation."""
    with pytest.raises(InvalidInputError, match=message):
        as_rotation(value, "r", dimension=3)


def test_rotations_are_made_orthonormal_to_the_last_digit():
    """A rotation typed with seven digits comes out orthonormal."""
    c, s = 0.8660254, 0.5
    checked = as_rotation([[c, -s], [s, c]], "r")
    np.testing.assert_allclose(checked @ checked.T, np.eye(2), atol=1e-15)
    np.testing.assert_allclose(checked, [[c, -s], [s, c]], atol=1e-7)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: as_count(2.5, "n"), "n must be a whole number of at least 1; found 2.5"),
        (lambda: as_count("3", "n"), "n must be a whole number of at least 1; found '3'"),
        (lambda: as_count(0, "n"), "n must be a whole number of at least 1; found 0"),
        (lambda: as_count(7, "n", minimum=0, maximum=6), "n must be a whole number in [0, 6]; found 7"),
        (lambda: as_number([1.0], "x"), "x must be a number; found [1.0]"),
        (lambda: as_number("much", "x"), "x must be a number; found 'much'"),
        (lambda: as_number(np.inf, "x"), "x must be a number; found inf"),
        (lambda: as_number(np.nan, "x", minimum=0), "x must be a number of at least 0; found nan"),
        (lambda: as_number(0.0, "x", above=0), "x must be a number above 0; found 0.0"),
        (lambda: as_number(-0.5, "x", minimum=0), "x must be a number of at least 0; found -0.5"),
        (lambda: as_number(1, "x", below=1), "x must be a number below 1; found 1"),
        (lambda: as_number(1.5, "x", maximum=1), "x must be a number of at most 1; found 1.5"),
        (lambda: as_number(2, "x", above=0, below=1), "x must be a number in (0, 1); found 2"),
        (lambda: as_number(1, "x", minimum=0, below=1), "x must be a number in [0, 1); found 1"),
        (lambda: as_number(3, "gain", above=0, maximum=1), "gain must be a number in (0, 1]; found 3"),
        (lambda: as_numbers([1, 0, 2], "x", 3, above=0), "x must be 3 numbers above 0; found 0 at index 1"),
        (lambda: as_numbers(1, "x", 3), "x must be 3 numbers; found shape ()"),
        (
            lambda: as_numbers(-1, "x", 3, one=True, minimum=0),
            "x must be one number or 3 numbers of at least 0; f",
        ),
        (lambda: as_numbers([1, 2], "x", 3, one=True), "x must be one number or 3 numbers; found shape (2,)"),
        (lambda: as_numbers(1, "x", above=0), "x must be a sequence of numbers above 0; found shape ()"),
        (lambda: as_times([0, 2, 1, 3]), "time must increase strictly; found 1 s at index 2 after 2 s"),
        (lambda: as_times([0, 1], count=3), "time must have shape (3,); found shape (2,)"),
        (lambda: as_times([0, 1e300]), "time must be in seconds, within ±1e+12"),
        (lambda: as_times([0, 1e-300]), "at least 1e-09 apart"),
        (lambda: as_metres([[0, 0, 1e300]], "path"), "path must be in metres, within ±10000; found 1e+300"),
        (lambda: as_times([0], "clock", fewest=2), "clock must have shape (n,) with n ≥ 2; found shape (1,)"),
        (lambda: as_choice("c", "kind", ("a", "b")), "unknown kind 'c'; there are, nearest first: 'a', 'b'"),
        (lambda: as_choice(np.ones(2), "kind", ("a", "b")), "unknown kind array([1., 1.]); there are, nearest first: "),
        (lambda: as_flag("yes", "turn"), "turn must be True or False; found 'yes'"),
        (lambda: as_flag(2, "turn"), "turn must be True or False; found 2"),
        (lambda: as_flag([True], "turn"), "turn must be True or False; found [True]"),
        (lambda: as_generator(-1), "random_state (unless None or a numpy Generator) must be a whole number"),
        (lambda: as_generator(1.5), "random_state (unless None or a numpy Generator) must be a whole number"),
    ],
)
def test_scalars_name_what_is_wrong(call, message):
    """Counts, numbers, choices and seeds outside what is allowed are refused with what was found."""
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        call()


def test_scalars_that_fit_pass():
    """NumPy integers count, integers are numbers, and a generator is used as it is."""
    assert as_count(np.int64(3), "n") == 3
    assert as_number(2, "x", above=1, below=3) == 2.0
    assert as_number(0, "x", minimum=0, maximum=0) == 0.0
    assert_array_equal(as_numbers(2, "x", 3, one=True, above=0), [2.0, 2.0, 2.0])
    assert_array_equal(as_numbers((1, 2, 3), "x", 3), [1.0, 2.0, 3.0])
    assert_array_equal(as_times([0, 1, 3], count=3), [0.0, 1.0, 3.0])
    assert as_choice("a", "kind", ("a", "b")) == "a"
    generator = np.random.default_rng(0)
    assert as_generator(generator) is generator
    assert as_generator(5).random() == as_generator(np.int32(5)).random()
    assert isinstance(as_generator(None), np.random.Generator)


def test_a_wrong_name_is_one_kind_of_error_at_every_door():
    """A word out of a few and the name of a thing are refused by the same error, which also is a wrong value."""
    for door in (lambda: as_choice("speed", "kind", ("force",)), lambda: shipped_recording("wave")):
        with pytest.raises(UnknownNameError, match=r"^unknown .*'(speed|wave)'; there are, nearest first: '") as caught:
            door()
        assert isinstance(caught.value, InvalidInputError)


def test_checks_do_not_write_to_their_input():
    """A read-only array passes and is not returned for writing in place of a copy."""
    matrix = np.array([[2.0, 1.0 + 1e-12], [1.0, 2.0]])
    before = matrix.copy()
    matrix.setflags(write=False)
    as_spd(matrix, "m")
    as_finite(matrix, "m")
    assert_array_equal(matrix, before)


HARD = {
    "SPD": lambda x: x,
    "asymmetry of rounding size": lambda x: x + 1e-12 * np.triu(np.ones(x.shape[-2:]), 1),
    "asymmetric": lambda x: x + np.triu(np.ones(x.shape[-2:]), 1),
    "one nan": lambda x: np.where(np.arange(x.size).reshape(x.shape) == x.size // 2, np.nan, x),
    "infinite": lambda x: np.where(np.arange(x.size).reshape(x.shape) == x.size - 1, np.inf, x),
    "indefinite": lambda x: x - 0.5 * np.trace(x, axis1=-2, axis2=-1)[..., None, None] * np.eye(x.shape[-1]),
    "singular": lambda x: x * np.r_[np.ones(x.shape[-1] - 1), 0.0] * np.r_[np.ones(x.shape[-1] - 1), 0.0][:, None],
    "nearly singular": lambda x: x * np.outer(np.logspace(0, -6.9, x.shape[-1]), np.logspace(0, -6.9, x.shape[-1])),
    "zero": np.zeros_like,
    "huge": lambda x: 1e80 * x,
    "tiny": lambda x: 1e-80 * x,
}


@pytest.mark.parametrize("check", [as_symmetric, as_spd, as_positive_semidefinite, as_points])
@pytest.mark.parametrize("kind", list(HARD))
@pytest.mark.parametrize("d", [2, 3, 6, 12])
def test_the_compiled_check_has_the_verdict_of_the_plain_one(check, kind, d, monkeypatch):
    """With or without the compiled pass, the same input passes with the same numbers or fails by the same message."""
    factor = np.random.default_rng(d).standard_normal((7, d, 2 * d))
    value = HARD[kind](factor @ np.swapaxes(factor, 1, 2))

    def outcome():
        try:
            return check(value, "m")
        except InvalidInputError as error:
            return f"{type(error).__name__}: {error}"

    quick = outcome()
    monkeypatch.setattr(validation, "vouched", lambda *_, **__: None)
    if isinstance(quick, str):
        assert quick == outcome()
    else:
        assert_array_equal(quick, outcome())


def test_checked_input_is_copied_unless_it_is_only_read():
    """A checked array is the caller's own; without a copy, exactly symmetric input comes back as it is."""
    matrices = at(2.0 * EYE)
    assert not np.shares_memory(as_spd(matrices, "m"), matrices)
    assert not np.shares_memory(as_points(matrices, "m"), matrices)
    assert np.shares_memory(as_spd(matrices, "m", copy=False), matrices)
    matrices[1, 0, 1] = 1e-12
    averaged = as_spd(matrices, "m", copy=False)
    assert averaged[1, 0, 1] == averaged[1, 1, 0] == 0.5e-12
    assert matrices[1, 1, 0] == 0.0


@pytest.mark.parametrize(
    ("found", "wanted", "words"),
    [
        ((3,), (3,), ""),
        ((5, 3, 3), ("n", 3, 3), ""),
        ((3,), (..., 3), ""),
        ((4, 0, 3), (..., 3), ""),
        ((0, 3), ("n", 3), r"a must have shape (n, 3) of points; found shape (0, 3)"),
        ((3,), ("n", 3), r"a must have shape (n, 3) of points; found shape (3,)"),
        ((2,), (3,), r"a must have shape (3,) of points; found shape (2,)"),
        ((), (..., 3), r"a must have shape (..., 3) of points; found shape ()"),
        ((3, 4), (..., 3), r"a must have shape (..., 3) of points; found shape (3, 4)"),
    ],
)
def test_shapes_are_of_numbers_and_names(found, wanted, words):
    """A number asks for that size, a name for any from one on, dots for any axes; else both shapes are told."""
    if not words:
        require_shape(np.zeros(found), "a", wanted, " of points")
        return
    with pytest.raises(InvalidInputError, match=f"^{re.escape(words)}$"):
        require_shape(np.zeros(found), "a", wanted, " of points")
