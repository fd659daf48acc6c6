"""Checks of arguments: each returns a valid value, or raises an error with the argument, the value and the rule."""

import math
import operator
from collections.abc import Iterable
from types import EllipsisType
from typing import SupportsIndex, TypedDict, TypeGuard, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.errors import InvalidInputError, NotSPDError, shown, spoken, unknown_name

Array = NDArray[np.float64]
RandomState = (
    int | np.random.Generator | None
)  # Seed or generator; None draws other numbers each time
Shape = tuple[int | str | EllipsisType, ...]  # Sizes, names of any size, and at the front any axes
Rows = slice | NDArray[np.intp] | NDArray[np.bool_]  # Selection of rows of an array

MIN_DIMENSION = 2
MAX_DIMENSION = 12
SYMMETRY_TOLERANCE = 1e-8  # Largest |A - Aᵀ| that counts as rounding, relative to the largest entry
SPD_TOLERANCE = 1e-14
"""Largest ratio of the smallest eigenvalue to the trace of a matrix that counts as singular.

It lies above the rounding of J Jᵀ with a rank-deficient J (about 1e-16) and admits condition numbers up to about 1e13.
"""
MIN_MAGNITUDE = 1e-70
MAX_MAGNITUDE = 1e70
"""Range of a nonzero trace: beyond it, products of eigenvalues overflow or underflow."""
MAX_POSITION = 1e4  # Larger positions [m] are in another unit
LATEST = 1e12  # Later times [s], even since 1970, are in another unit


class Bounds(TypedDict, total=False):
    """The range of a number: `minimum` and `maximum` belong to it, `above` and `below` do not."""

    minimum: float
    above: float
    maximum: float
    below: float


@overload
def inside(values: float, bounds: Bounds) -> bool: ...


@overload
def inside(values: Array, bounds: Bounds) -> NDArray[np.bool_]: ...


def inside(values: float | Array, bounds: Bounds) -> bool | NDArray[np.bool_]:
    """Return which numbers lie in a range."""
    low = bounds.get("minimum", -np.inf)
    above = bounds.get("above", -np.inf)
    high = bounds.get("maximum", np.inf)
    below = bounds.get("below", np.inf)
    return (values >= low) & (values > above) & (values <= high) & (values < below)


def _in_words(bounds: Bounds) -> str:
    """Describe a range for a message, with a leading space; empty without bounds."""
    if "above" in bounds:
        left = f"({bounds['above']:.12g}"
    elif "minimum" in bounds:
        left = f"[{bounds['minimum']:.12g}"
    else:
        left = ""
    if "below" in bounds:
        right = f"{bounds['below']:.12g})"
    elif "maximum" in bounds:
        right = f"{bounds['maximum']:.12g}]"
    else:
        right = ""
    if left and right:
        return f" in {left}, {right}"
    words = {"above": "above", "minimum": "of at least", "below": "below", "maximum": "of at most"}
    return "".join(f" {words[key]} {value:.12g}" for key, value in bounds.items())


def _first(mask: NDArray[np.bool_]) -> tuple[int, ...]:
    """Return the index of the first true entry."""
    return tuple(int(i) for i in np.argwhere(mask)[0])


def _at(index: tuple[int, ...]) -> str:
    """Format an index behind a name."""
    if index:
        return f"[{', '.join(map(str, index))}]"
    return ""


def _behind(index: tuple[int, ...]) -> str:
    """Format an index behind a value."""
    if index:
        return f" at index {index[0] if len(index) == 1 else index}"
    return ""


def _is_plain(value: object) -> TypeGuard[Array]:
    """Whether a value is a float64 array, of no derived class such as that of masked arrays."""
    return type(value) is np.ndarray and value.dtype == np.float64


def as_finite(value: object, name: str) -> Array:
    """Convert to a float64 array without nan or infinity."""
    if _is_plain(value) and math.isfinite(np.vdot(value, value)):
        return value  # control steps call this often
    rule = f"{name} must be an array of numbers"
    if value is None or np.ma.is_masked(value):
        found = "None" if value is None else "masked entries"
        raise InvalidInputError(f"{rule}; found {found}")
    try:
        array = np.asarray(value)
        if np.iscomplexobj(array):  # NumPy would drop the imaginary part with a mere warning
            raise TypeError("its numbers are complex")
        array = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInputError(f"{rule}; found {type(value).__name__}: {error}") from None
    bad = ~np.isfinite(array)
    if bad.any():
        index = _first(bad)
        if index:
            count = f" ({int(bad.sum())} such entries)"
        else:
            count = ""
        raise InvalidInputError(
            f"{name} must be finite; found {array[index]}{_behind(index)}{count}"
        )
    return array


def require_shape(array: NDArray[np.generic], name: str, shape: Shape, note: str = "") -> None:
    """Raise unless an array has a shape of numbers and names (any size ≥ 1); a leading ``...`` means any axes."""
    axes = shape
    sizes = array.shape
    if shape[0] is ...:
        axes = shape[1:]
        sizes = array.shape[-len(axes) :]
    fits = len(sizes) == len(axes)
    for size, axis in zip(sizes, axes, strict=False):
        if isinstance(axis, str):
            fits = fits and size >= 1
        else:
            fits = fits and size == axis
    if fits:
        return
    words = ["..." if axis is ... else str(axis) for axis in shape]
    text = ", ".join(words)
    if len(shape) == 1:
        text += ","
    raise InvalidInputError(f"{name} must have shape ({text}){note}; found shape {array.shape}")


def as_square(value: ArrayLike, name: str, dimension: int | None = None) -> Array:
    """Convert to finite square matrices, shape (..., d, d) with d from 2 to 12 (or exactly `dimension`)."""
    array = as_finite(value, name)
    if array.ndim < 2 or array.shape[-1] != array.shape[-2]:
        raise InvalidInputError(
            f"{name} must hold square matrices, shape (..., d, d); found shape {array.shape}"
        )
    d = array.shape[-1]
    if dimension is not None and d != dimension:
        raise InvalidInputError(f"{name} must hold {dimension}×{dimension} matrices; found {d}×{d}")
    if not MIN_DIMENSION <= d <= MAX_DIMENSION:
        allowed = f"from {MIN_DIMENSION}×{MIN_DIMENSION} to {MAX_DIMENSION}×{MAX_DIMENSION}"
        raise InvalidInputError(f"{name} must hold matrices {allowed}; found {d}×{d}")
    return array


def as_symmetric(value: ArrayLike, name: str, dimension: int | None = None) -> Array:
    """Convert to symmetric matrices, shape (..., d, d); rounding-sized asymmetry is averaged away."""
    return _symmetric(None, value, name, dimension)


def as_positive_semidefinite(value: ArrayLike, name: str, dimension: int | None = None) -> Array:
    """Convert to symmetric matrices without negative eigenvalues, shape (..., d, d); singular ones may pass."""
    return _symmetric(-SPD_TOLERANCE, value, name, dimension, "no negative eigenvalue is allowed")


def as_spd(
    value: ArrayLike, name: str, dimension: int | None = None, hint: str = "", copy: bool = True
) -> Array:
    """Convert to symmetric positive-definite matrices, shape (..., d, d).

    A `hint` is what the caller may do about singular matrices (see `SPD_TOLERANCE`). Without `copy` the result is
    only read, and valid input may be returned as it is.
    """
    rule = "all eigenvalues must be positive" + (f". {hint}" if hint else "")
    return _symmetric(SPD_TOLERANCE, value, name, dimension, rule, copy)


def as_points(
    value: ArrayLike,
    name: str,
    dimension: int | None = None,
    minimum: int = 2,
    hint: str = "",
    copy: bool = True,
) -> Array:
    """Convert to a set of SPD matrices, shape (n, d, d), with at least `minimum` members; `copy` as in `as_spd`."""
    array = as_spd(value, name, dimension, hint, copy)
    if array.ndim != 3:
        raise InvalidInputError(
            f"{name} must be a set of matrices, shape (n, d, d); found shape {array.shape}"
        )
    if len(array) < minimum:
        raise InvalidInputError(f"{name} must hold at least {minimum} matrices; found {len(array)}")
    return array


def as_scalar(values: Array) -> Array | np.float64:
    """Return an array of numbers as it is, and one without axes as the number, which is a float."""
    if values.ndim == 0:
        return np.float64(values)
    return values


def require_broadcast(**arrays: Array) -> None:
    """Raise unless the leading axes of matrices, shapes (..., d, d), broadcast against each other."""
    try:
        np.broadcast_shapes(*(array.shape[:-2] for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise InvalidInputError(f"the leading axes must broadcast; found shapes {shapes}") from None


def as_rotation(value: ArrayLike, name: str, dimension: int | None = None) -> Array:
    """Convert to one rotation matrix, shape (d, d), orthonormal to 1e-6 with determinant +1."""
    matrix = as_square(value, name, dimension)
    if matrix.ndim != 2:
        raise InvalidInputError(
            f"{name} must be one rotation matrix, shape (d, d); found shape {matrix.shape}"
        )
    gap = float(np.abs(matrix @ matrix.T - np.eye(len(matrix))).max())
    determinant = float(np.linalg.det(matrix))
    if gap > 1e-6 or determinant < 0:
        raise InvalidInputError(
            f"{name} must be a rotation: R Rᵀ = I to 1e-6 and determinant +1; "
            f"found |R Rᵀ - I| = {gap:.3g}, determinant {determinant:.3g}"
        )
    left, _, right = np.linalg.svd(matrix)
    return np.asarray(left @ right)


def as_count(value: object, name: str, minimum: int = 1, maximum: int | None = None) -> int:
    """Convert to an integer from `minimum` to `maximum`."""
    if maximum is None:
        bounds = Bounds(minimum=minimum)
    else:
        bounds = Bounds(minimum=minimum, maximum=maximum)
    rule = f"{name} must be a whole number{_in_words(bounds)}"
    try:
        if not isinstance(value, SupportsIndex):
            raise TypeError
        count = operator.index(value)
    except TypeError:
        raise InvalidInputError(f"{rule}; found {shown(value)}") from None
    if isinstance(value, bool) or not inside(count, bounds):
        raise InvalidInputError(f"{rule}; found {shown(value)}")
    return count


def as_number(value: object, name: str, **bounds: Unpack[Bounds]) -> float:
    """Convert to one finite number within `bounds`."""
    try:
        number = value if type(value) is float else float(as_finite(value, name)[()])
    except (InvalidInputError, TypeError):
        number = np.nan
    if isinstance(value, bool | str | bytes) or not (
        math.isfinite(number) and inside(number, bounds)
    ):
        raise InvalidInputError(f"{name} must be a number{_in_words(bounds)}; found {shown(value)}")
    return number


def as_numbers(
    value: ArrayLike,
    name: str,
    count: int | None = None,
    broadcast: bool = False,
    **bounds: Unpack[Bounds],
) -> Array:
    """Convert to `count` numbers (or any) within `bounds`, shape (count,); `broadcast` also accepts one number."""
    single = ""
    if broadcast and count != 1:
        single = "one number or "
    rule = f"{name} must be {single}{count or 'a sequence of'} number{'s' * (count != 1)}{_in_words(bounds)}"
    array = as_finite(value, name)
    entries = value if isinstance(value, list | tuple) else [value]
    if any(isinstance(entry, bool | str | bytes) for entry in entries):
        raise InvalidInputError(f"{rule}; found {shown(value)}")
    is_single = broadcast and array.ndim == 0
    is_sequence = array.ndim == 1 and count in (None, len(array))
    if not (is_single or is_sequence):
        raise InvalidInputError(f"{rule}; found shape {array.shape}")
    wrong = ~inside(array, bounds)
    if wrong.any():
        index = _first(wrong)
        raise InvalidInputError(f"{rule}; found {array[index]:g}{_behind(index)}")
    return np.array(array if count is None else np.broadcast_to(array, (count,)))


def as_times(
    value: ArrayLike, name: str = "time", count: int | None = None, fewest: int = 1
) -> Array:
    """Convert to strictly increasing times [s], shape (n,), with n = `count` or at least `fewest`."""
    times = as_finite(value, name)
    if times.ndim != 1 or len(times) < fewest or count not in (None, len(times)):
        shape = f"(n,) with n ≥ {fewest}" if count is None else f"({count},)"
        raise InvalidInputError(f"{name} must have shape {shape}; found shape {times.shape}")
    late = np.flatnonzero(np.diff(times) <= 0)
    if len(late):
        i = int(late[0]) + 1
        raise InvalidInputError(
            f"{name} must increase strictly; found {times[i]:g} s at index {i} after {times[i - 1]:g} s"
        )
    if np.abs(times).max(initial=0.0) > LATEST or np.diff(times).min(initial=1.0) < 1e-9:
        rule = f"{name} must be in seconds, within ±{LATEST:g} and at least 1e-09 apart"
        raise InvalidInputError(f"{rule}; found {times[0]:g} to {times[-1]:g}")
    return times


def as_metres(value: ArrayLike, name: str) -> Array:
    """Convert to positions in space [m], of any shape, within ±`MAX_POSITION`."""
    positions = as_finite(value, name)
    farthest = float(np.abs(positions).max(initial=0.0))
    if farthest > MAX_POSITION:
        raise InvalidInputError(
            f"{name} must be in meters, within ±{MAX_POSITION:g}; found {farthest:g}"
        )
    return positions


def as_choice(value: object, name: str, choices: Iterable[str]) -> str:
    """Require one of a few words; raises `UnknownNameError`."""
    names = tuple(choices)
    if not isinstance(value, str) or value not in names:
        raise unknown_name(spoken(name), value, names)
    return value


def as_flag(value: object, name: str) -> bool:
    """Require True or False; NumPy's and the numbers 1 and 0 count as such."""
    if (
        isinstance(value, str | list | tuple | dict)
        or np.asarray(value).ndim
        or value not in (True, False)
    ):
        raise InvalidInputError(f"{name} must be True or False; found {shown(value)}")
    return bool(value)


def as_generator(random_state: RandomState, name: str = "random_state") -> np.random.Generator:
    """Make a random generator from None, a whole number or a `numpy.random.Generator`."""
    if random_state is None or isinstance(random_state, np.random.Generator):
        return np.random.default_rng(random_state)
    return np.random.default_rng(
        as_count(random_state, f"{name} (unless None or a numpy Generator)", minimum=0)
    )


def vouched(
    value: ArrayLike, dimension: int | None, fraction: float | None, copy: bool = True
) -> Array | None:
    """Return the symmetric parts of matrices that one compiled pass proves valid; None if it does not."""
    if not _is_plain(value) or not _holds_matrices(value, dimension):
        return None
    from maniport.util.spd_check import vouch  # here, since Numba takes its time to import

    d = value.shape[-1]
    flat = np.ascontiguousarray(value).reshape(-1, d, d)
    if not (flat.flags.writeable and flat.flags.aligned):  # else Numba would compile again
        flat = flat.copy()
    limits = fraction or 0.0, SYMMETRY_TOLERANCE, MIN_MAGNITUDE, MAX_MAGNITUDE, fraction is not None
    if not copy and vouch(flat, np.empty((0, d, d)), *limits):
        return flat.reshape(value.shape)
    results = np.empty(flat.shape)
    if vouch(flat, results, *limits):
        return results.reshape(value.shape)
    return None


def _holds_matrices(array: Array, dimension: int | None) -> bool:
    """Whether an array has matrices of an allowed size, shape (..., d, d)."""
    if array.ndim < 2 or not array.size:
        return False
    d: int = array.shape[-1]
    if array.shape[-2] != d:
        return False
    if dimension is not None:
        return d == dimension
    return MIN_DIMENSION <= d <= MAX_DIMENSION


def _symmetric(
    fraction: float | None,
    value: ArrayLike,
    name: str,
    dimension: int | None,
    rule: str = "",
    copy: bool = True,
) -> Array:
    """Convert to symmetric matrices; every eigenvalue must lie above `fraction` of the trace, unless it is None."""
    plain = vouched(value, dimension, fraction, copy)
    if plain is not None:
        return plain
    array = as_square(value, name, dimension)
    transposed = np.swapaxes(array, -1, -2)
    gap = np.abs(array - transposed).max(axis=(-1, -2))
    scale = np.abs(array).max(axis=(-1, -2))
    asymmetric = gap > SYMMETRY_TOLERANCE * scale
    if np.any(asymmetric):
        index = _first(asymmetric)
        raise NotSPDError(
            f"{name}{_at(index)} is not symmetric: |A - Aᵀ| reaches {gap[index]:.3g}; "
            f"allowed is {SYMMETRY_TOLERANCE:g} of its largest entry, {scale[index]:.3g}"
        )
    array = 0.5 * (array + transposed)
    if fraction is None:
        return array
    trace = np.trace(array, axis1=-2, axis2=-1)
    outside = (np.abs(trace) > MAX_MAGNITUDE) | ((np.abs(trace) < MIN_MAGNITUDE) & (trace != 0))
    if np.any(outside):
        index = _first(outside)
        raise InvalidInputError(
            f"{name}{_at(index)} has the trace {trace[index]:.3g}; allowed are zero and magnitudes from "
            f"{MIN_MAGNITUDE:g} to {MAX_MAGNITUDE:g}: choose another unit"
        )
    worst = np.linalg.eigvalsh(array)[..., 0] - fraction * np.abs(trace)
    if fraction > 0.0:
        bad = worst <= 0.0
    else:
        bad = worst < 0.0
    if np.any(bad):
        index = _first(bad)
        low, high = np.linalg.eigvalsh(array[index])[[0, -1]]
        if fraction > 0 and low >= -SPD_TOLERANCE * abs(trace[index]):
            kind = "singular"
        else:
            kind = "indefinite"
        if bad.size > 1:
            more = f" ({np.sum(bad)} of {bad.size} matrices)"
        else:
            more = ""
        raise NotSPDError(
            f"{name}{_at(index)} is {kind}: its eigenvalues range from {low:.3g} to {high:.3g}{more}; {rule}"
        )
    return array
