"""Strategies: SPD matrices of every size, condition and unit; and forms that an array may have."""

from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from maniport.errors import NotSPDError

SIZES = (2, 3, 4, 5, 6, 12)
EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Case:
    """Size, condition number and unit of SPD matrices, and the seed of everything that is drawn for one example."""

    d: int
    condition: float
    scale: float
    seed: int

    @cached_property
    def rng(self):
        return np.random.default_rng(self.seed)

    @property
    def rounding(self):
        """A distance that rounding of such matrices, and of what is computed with a few of them, stays below."""
        return 1e-8 + 100.0 * EPS * self.condition * self.d

    @property
    def rounding_between(self):
        """The same for one matrix seen from another, whose condition there may be the product of both."""
        return 1e-8 + 100.0 * EPS * self.condition**2 * self.d

    def with_scale(self, scale):
        """The same case in another unit, drawn independently."""
        return replace(self, scale=scale, seed=int(self.rng.integers(2**32)))

    def spd(self, *shape):
        """Matrices (*shape, d, d) with the case's condition number, and its unit as largest eigenvalue."""
        exponents = self.rng.uniform(0.0, 1.0, (*shape, self.d))
        exponents[..., 0] = 0.0
        exponents[..., -1] = 1.0
        return self.with_eigenvalues(self.scale * self.condition**-exponents)

    def with_eigenvalues(self, values):
        """Matrices with random axes and given eigenvalues (..., d)."""
        axes = np.linalg.qr(self.rng.standard_normal((*values.shape, self.d)))[0]
        matrices = (axes * values[..., None, :]) @ np.swapaxes(axes, -1, -2)
        return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))

    def symmetric(self, *shape):
        """Symmetric matrices (*shape, d, d) of the case's unit."""
        matrices = self.scale * self.rng.standard_normal((*shape, self.d, self.d))
        return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))

    def change(self):
        """An invertible matrix (d, d) with singular values from 1/3 to 3."""
        left, right = np.linalg.qr(self.rng.standard_normal((2, self.d, self.d)))[0]
        return left * np.linspace(1.0 / 3.0, 3.0, self.d) @ right


@st.composite
def cases(draw, most=12.0, least=0.0, sizes=SIZES):
    """Draw a size, a condition number from 10^least to 10^most, a unit from 1e-6 to 1e6 and a seed."""
    condition = draw(st.floats(least, most))
    scale = draw(st.floats(-6.0, 6.0))
    return Case(
        draw(st.sampled_from(sizes)), 10.0**condition, 10.0**scale, draw(st.integers(0, 2**32 - 1))
    )


TAME = cases(most=2.0).map(lambda case: replace(case, scale=1e4))
"""Cases whose matrices stay SPD when they are rounded to half precision or to integers."""


def fewer(share):
    """Settings of laws that take their time: this share of the examples of the others."""
    return settings(max_examples=max(1, round(share * settings.default.max_examples)))


@contextmanager
def refused_only_above(rounding, words=("too ill-conditioned",)):
    """Let matrices be refused with some of these words, but only where rounding comes near the distance of 0.01."""
    try:
        yield
    except NotSPDError as error:
        if rounding < 1e-5 or not any(one in str(error) for one in words):
            raise


def congruent(change, points):
    """C X Cᵀ, exactly symmetric."""
    result = change @ points @ change.T
    return 0.5 * (result + np.swapaxes(result, -1, -2))


class ArrayLike:
    """Something of another library that NumPy can make an array of."""

    def __init__(self, array):
        self.array = array

    def __array__(self, dtype=None, copy=None):
        return np.array(self.array, dtype=dtype)


def _strided(array):
    whole = np.full((*array.shape[:-1], 2 * array.shape[-1]), np.nan)
    whole[..., ::2] = array
    return whole[..., ::2]


def _read_only(array):
    frozen = array.copy()
    frozen.setflags(write=False)
    return frozen


def _unaligned(array):
    room = np.zeros(array.nbytes + 1, np.uint8)
    shifted = room[1:].view(np.float64).reshape(array.shape)
    shifted[...] = array
    return shifted


FORMS = {
    "Fortran order": np.asfortranarray,
    "strided": _strided,
    "read-only": _read_only,
    "unaligned": _unaligned,
    "other byte order": lambda array: array.astype(">f8"),
    "nested lists": lambda array: array.tolist(),
    "nothing masked": np.ma.masked_invalid,
    "array-like": ArrayLike,
}
"""Forms that hold the numbers of a float64 array in C order, every bit."""

ROUNDED = {
    "float16": lambda array: np.asarray(array, dtype=np.float16),
    "lists of int": lambda array: np.rint(array).astype(int).tolist(),
}
"""Forms that hold nearly those numbers; points of the `TAME` cases stay SPD in each."""


def results_of(call, given):
    results = call(*given)
    return results if isinstance(results, tuple) else (results,)


def require_same_for_every_form(call, arrays, forms=FORMS):
    """Require of a call the bits that it gives for plain arrays, new float64 arrays, and arguments left alone."""
    for form, disguise in forms.items():
        given = [disguise(array.copy()) for array in arrays]
        plain = [np.array(one, dtype=np.float64, order="C") for one in given]
        expected = results_of(call, [one.copy() for one in plain])
        found = results_of(call, given)
        assert len(found) == len(expected)
        for result, wanted in zip(found, expected, strict=True):
            assert np.asarray(result).dtype == np.float64, form
            np.testing.assert_array_equal(
                result, wanted, err_msg=form, strict=isinstance(wanted, np.ndarray)
            )
            for one in given:
                assert not (isinstance(one, np.ndarray) and np.may_share_memory(result, one)), (
                    f"{form}: not fresh"
                )
            assert not isinstance(result, np.ndarray) or result.flags.writeable, (
                f"{form}: the result is read-only"
            )
        for one, before in zip(given, plain, strict=True):
            np.testing.assert_array_equal(
                np.array(one, dtype=np.float64), before, err_msg=f"{form}: written to"
            )
