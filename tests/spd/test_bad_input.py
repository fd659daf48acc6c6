"""Every public function of the space checks every argument at its door and names it."""

import numpy as np
import pytest

from maniport import spd
from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd import log_euclidean

EYE = np.eye(3)
METRIC_ARGUMENTS = {
    "distance": ("a", "b"),
    "log": ("base", "point"),
    "exp": ("base", "tangent"),
    "inner": ("base", "first", "second"),
    "transport": ("tangent", "start", "end"),
    "geodesic": ("a", "b", "t"),
}
UNARY = {
    "points": ["logm", "power", "sqrtm", "invsqrtm", "axes", "lengths", "volume", "condition", "mean", "dispersion"],
    "symmetric": ["expm", "to_vector"],
}
TANGENTS = {"tangent", "first", "second", "symmetric"}
BAD = {
    "not square": (np.ones((3, 2)), r"{} must hold square matrices.*found shape \(3, 2\)"),
    "nan": (np.full((3, 3), np.nan), r"{} must be finite; found nan at index \(0, 0\)"),
    "asymmetric": (np.tri(3), r"{} is not symmetric"),
    "1×1": (np.eye(1), r"{} must hold (matrices from 2×2 to 12×12|3×3 matrices); found 1×1"),
    "13×13": (np.eye(13), r"{} must hold (matrices from 2×2 to 12×12|3×3 matrices); found 13×13"),
}
NOT_SPD = {
    "indefinite": (np.diag([1.0, -1.0, 1.0]), r"{} is indefinite: its eigenvalues range from -1 to 1"),
    "singular": (np.diag([1.0, 0.0, 1.0]), r"{} is singular: its eigenvalues range from 0 to 1"),
}


def cases():
    """List (function, its other arguments, the name of the bad one, bad value, message)."""
    for module in (spd, log_euclidean):
        for function, names in METRIC_ARGUMENTS.items():
            for name in names:
                if name == "t":
                    continue
                kinds = BAD if name in TANGENTS else BAD | NOT_SPD
                good = {other: 0.5 if other == "t" else EYE for other in names if other != name}
                for kind, (value, message) in kinds.items():
                    label = f"{module.__name__.split('.')[-1]}-{function}-{name}-{kind}"
                    yield pytest.param(getattr(module, function), good, name, value, message, id=label)
    for name, functions in UNARY.items():
        for function in functions:
            kinds = dict(BAD) if name in TANGENTS else BAD | NOT_SPD
            if function in ("axes", "lengths", "volume"):  # these take singular ellipsoids
                del kinds["singular"]
            good = {"exponent": 2.0} if function == "power" else {}
            for kind, (value, message) in kinds.items():
                yield pytest.param(getattr(spd, function), good, name, value, message, id=f"{function}-{kind}")


@pytest.mark.parametrize(("function", "good", "name", "value", "message"), list(cases()))
def test_bad_matrices_are_refused_by_name(function, good, name, value, message):
    """A matrix that is not what the argument must be raises an error that names the argument and what was found."""
    message = message.replace("{}", rf"^{name}", 1)
    with pytest.raises(InvalidInputError, match=message) as caught:
        function(**good, **{name: value})
    if "is not symmetric" in message or "eigenvalues" in message:
        assert isinstance(caught.value, NotSPDError)


@pytest.mark.parametrize("module", [spd, log_euclidean], ids=["affine-invariant", "log-Euclidean"])
@pytest.mark.parametrize("function", ["distance", "log", "exp", "inner", "transport", "geodesic"])
def test_matrices_of_different_sizes_are_refused(module, function):
    """The size of the first matrix is required of the second, whose name and size the message gives."""
    names = METRIC_ARGUMENTS[function]
    arguments = dict(zip(names, (EYE, np.eye(2), np.eye(2)), strict=False))
    if function == "geodesic":
        arguments["t"] = 0.5
    with pytest.raises(InvalidInputError, match=r"must hold [23]×[23] matrices; found [23]×[23]"):
        getattr(module, function)(**arguments)


@pytest.mark.parametrize("module", [spd, log_euclidean], ids=["affine-invariant", "log-Euclidean"])
def test_bad_parameters_of_a_geodesic_are_refused(module):
    """A parameter that is nan, no number, or does not fit the batch is refused by name."""
    with pytest.raises(InvalidInputError, match=r"^t must be finite; found nan"):
        module.geodesic(EYE, EYE, [0.0, np.nan])
    with pytest.raises(InvalidInputError, match=r"^t must be an array of numbers; found str"):
        module.geodesic(EYE, EYE, "half")
    with pytest.raises(InvalidInputError, match=r"leading axes must broadcast"):
        module.geodesic(np.stack([EYE] * 3), EYE, [0.0, 1.0])


@pytest.mark.parametrize("function", [spd.mean, spd.dispersion])
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (EYE, r"points must be a set of matrices, shape \(n, d, d\); found shape \(3, 3\)"),
        (np.zeros((0, 3, 3)), r"points must hold at least 1 matrices; found 0"),
        ([], r"points must be a set of matrices.*found shape \(0,\)"),
        ([EYE, np.diag([1.0, 1.0, -1.0])], r"points\[1\] is indefinite"),
    ],
)
def test_what_is_no_set_has_no_mean(function, value, message):
    """A single matrix, an empty set or a set with an indefinite member is refused with its index."""
    with pytest.raises(InvalidInputError, match=message):
        function(value)


def test_exponents_must_be_numbers():
    """A power takes one finite number."""
    for value in (np.nan, "two", [1.0, 2.0], None):
        with pytest.raises(InvalidInputError, match=r"^exponent must be"):
            spd.power(EYE, value)
