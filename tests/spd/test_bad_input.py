"""Every public function of the space checks every argument and names the wrong one."""

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


@pytest.mark.parametrize(
    ("function", "name", "value", "words"),
    [
        (lambda t: spd.geodesic(EYE, EYE, t), "t", [0.0, np.nan], "must be finite; found nan"),
        (lambda t: spd.geodesic(EYE, EYE, t), "t", "half", "must be an array of numbers; found str"),
        (lambda t: spd.geodesic(np.stack([EYE] * 3), EYE, t), "the leading axes", [0.0, 1.0], "must broadcast"),
        *((lambda e: spd.powm(EYE, e), "exponent", value, "must be") for value in (np.nan, "two", [1.0, 2.0], None)),
    ],
)
def test_parameters_must_be_numbers(function, name, value, words):
    """A parameter of a geodesic or an exponent that is nan, no number, or does not fit the batch is refused by name."""
    with pytest.raises(InvalidInputError, match=f"^{name} {words}"):
        function(value)


def test_points_too_ill_conditioned_for_each_other_are_refused(random_spd):
    """Where rounding moves a result too far, an error says how far; the distance, which it moves less, is computed."""
    a, b = random_spd(np.random.default_rng(0), (2, 500), 6, condition=5e12)
    assert np.all(np.abs(spd.distance(a, b) - spd.distance(b, a)) < 0.01)
    for operation in (
        spd.log,
        spd.whiten,
        spd.unwhiten,
        lambda x, y: spd.exp(x, x),
        lambda x, y: spd.geodesic(x, y, 0.5),
        lambda x, y: spd.transport(x, x, y),
    ):
        with pytest.raises(NotSPDError, match=r"too ill-conditioned together: rounding may move .*; allowed .* 0\.01"):
            operation(a, b)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [-5000.0, 5000.0])
def test_results_out_of_range_are_refused(size):
    """A result that would overflow or vanish is an error that names the argument, not inf, zero or a warning."""
    for call, name in (
        (lambda: spd.exp(EYE, size * EYE), "tangent"),
        (lambda: spd.geodesic(EYE, 2 * EYE, size), "t"),
        (lambda: spd.powm(2 * EYE, size), "exponent"),
        (lambda: spd.expm(size * EYE), "symmetric"),
    ):
        with pytest.raises(ValueError, match=f"{name} takes the result out of range"):
            call()


@pytest.mark.parametrize("length", [0, 1, 2, 4, 5, 91])
def test_vectors_of_impossible_length_are_refused(length):
    """A vector whose length belongs to no matrix from 2×2 to 12×12 is refused with its shape."""
    with pytest.raises(ValueError, match=rf"vector must have d \(d \+ 1\) / 2 entries.*found shape \({length},\)"):
        spd.from_vector(np.zeros(length))
    with pytest.raises(ValueError, match=r"vector .*found shape \(\)"):
        spd.from_vector(1.0)
