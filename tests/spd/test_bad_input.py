"""Every public function of the space checks every argument at its door and names it."""

import numpy as np
import pytest

from maniport import spd
from maniport.errors import InvalidInputError, NotSPDError

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
    "points": ["logm", "powm", "sqrtm", "invsqrtm", "axes", "lengths", "volume", "condition", "mean", "dispersion"],
    "symmetric": ["expm", "to_vector"],
}
TANGENTS = {"tangent", "first", "second", "symmetric"}
BAD = {
    "not square": (np.ones((3, 2)), r"{} must hold square"),
    "nan": (np.full((3, 3), np.nan), r"{} must be finite"),
    "asymmetric": (np.tri(3), r"{} is not symmetric"),
    "1×1": (np.eye(1), r"{} .*1×1"),
    "13×13": (np.eye(13), r"{} .*13×13"),
}
NOT_SPD = {
    "indefinite": (np.diag([1.0, -1.0, 1.0]), r"{} is indefinite"),
    "singular": (np.diag([1.0, 0.0, 1.0]), r"{} is singular"),
}


def cases():
    """List (function, its other arguments, the name of the bad one, bad value, message)."""
    for function, names in METRIC_ARGUMENTS.items():
        for name in names:
            if name == "t":
                continue
            kinds = BAD if name in TANGENTS else BAD | NOT_SPD
            good = {other: 0.5 if other == "t" else EYE for other in names if other != name}
            for kind, (value, message) in kinds.items():
                yield pytest.param(getattr(spd, function), good, name, value, message, id=f"{function}-{name}-{kind}")
    for name, functions in UNARY.items():
        for function in functions:
            kinds = dict(BAD) if name in TANGENTS else BAD | NOT_SPD
            if function in ("axes", "lengths", "volume"):  # these take singular ellipsoids
                del kinds["singular"]
            good = {"exponent": 2.0} if function == "powm" else {}
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


def functions():
    """List (function, arguments that fit together by name) of all functions of several matrices."""
    for function, names in METRIC_ARGUMENTS.items():
        good = {name: 0.5 if name == "t" else EYE for name in names}
        yield pytest.param(getattr(spd, function), good, id=function)
    for function in (spd.whiten, spd.unwhiten):
        yield pytest.param(function, {"points": EYE, "center": EYE}, id=function.__name__)


@pytest.mark.parametrize(("function", "good"), list(functions()))
def test_one_matrix_of_another_size_is_refused(function, good):
    """Whichever argument is of another size, the message begins with one that does not fit, and gives both sizes."""
    for name in good.keys() - {"t"}:
        with pytest.raises(InvalidInputError, match=r" must hold [23]×[23] matrices; found [23]×[23]") as caught:
            function(**good | {name: np.eye(2)})
        assert str(caught.value).split()[0] in good


@pytest.mark.parametrize(("function", "good"), list(functions()))
def test_batches_that_do_not_broadcast_are_refused(function, good):
    """Whichever argument is too many, the message gives every argument's shape by name."""
    batches = {name: np.stack([value, value]) for name, value in good.items()}
    for name, value in good.items():
        with pytest.raises(InvalidInputError, match=r"^the leading axes must broadcast; found shapes ") as caught:
            function(**batches | {name: np.stack([value] * 3)})
        for other in good:
            assert f" {other} ({3 if other == name else 2}, " in str(caught.value)


def test_centers_are_refused_by_name():
    """A center is one SPD matrix of the points' size."""
    points = np.stack([EYE, EYE])
    with pytest.raises(InvalidInputError, match=r"^center must hold 3×3 matrices; found 2×2"):
        spd.dispersion(points, center=np.eye(2))
    with pytest.raises(NotSPDError, match=r"^center is singular"):
        spd.dispersion(points, center=np.diag([1.0, 1.0, 0.0]))
    with pytest.raises(InvalidInputError, match=r"^center must be one matrix, shape \(d, d\); found shape \(2, 3, 3\)"):
        spd.dispersion(points, center=points)


def test_bad_parameters_of_a_geodesic_are_refused():
    """A parameter that is nan, no number, or does not fit the batch is refused by name."""
    with pytest.raises(InvalidInputError, match=r"^t must be finite; found nan"):
        spd.geodesic(EYE, EYE, [0.0, np.nan])
    with pytest.raises(InvalidInputError, match=r"^t must be an array of numbers; found str"):
        spd.geodesic(EYE, EYE, "half")
    with pytest.raises(InvalidInputError, match=r"leading axes must broadcast"):
        spd.geodesic(np.stack([EYE] * 3), EYE, [0.0, 1.0])


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
            spd.powm(EYE, value)
