import numpy as np
import pytest

from maniport import spd
from maniport.errors import InvalidInputError, NotSPDError

EYE = np.eye(3)
CALLS = {
    "distance": "a b",
    "log": "base point",
    "exp": "base tangent",
    "inner": "base first second",
    "geodesic": "a b t",
    "transport": "tangent start end",
    "powm": "points exponent",
    "expm": "symmetric",
    "to_vector": "symmetric",
    **dict.fromkeys(["logm", "axes", "lengths", "volume"], "points"),
    **dict.fromkeys(["mean", "dispersion"], "points"),
}
"""Functions and the names of their arguments."""
NUMBERS = {"t": 0.5, "exponent": 2.0}
TANGENTS = {"tangent", "first", "second", "symmetric"}
BAD = {
    "must hold square": np.ones((3, 2)),
    "must be finite": np.full((3, 3), np.nan),
    "is not symmetric": np.tri(3),
    ".*1×1": np.eye(1),
    ".*13×13": np.eye(13),
    "is indefinite": np.diag([1.0, -1.0, 1.0]),
    "is singular": np.diag([1.0, 0.0, 1.0]),
}


def good(function):
    return {name: NUMBERS.get(name, EYE) for name in CALLS[function].split()}


SEVERAL = [function for function in CALLS if len(good(function).keys() - NUMBERS.keys()) > 1]


@pytest.mark.parametrize("function", CALLS)
@pytest.mark.parametrize("message", BAD)
def test_bad_matrices_are_refused_by_name(function, message):
    for name in good(function).keys() - NUMBERS.keys():
        allowed = name in TANGENTS or (
            function in ("axes", "lengths", "volume") and message == "is singular"
        )
        if message in ("is indefinite", "is singular") and allowed:
            continue
        kind = NotSPDError if message.startswith("is ") else InvalidInputError
        with pytest.raises(kind, match=f"^{name} {message}"):
            getattr(spd, function)(**good(function) | {name: BAD[message]})


@pytest.mark.parametrize("function", SEVERAL)
def test_one_matrix_of_another_size_is_refused(function):
    for name in good(function).keys() - NUMBERS.keys():
        with pytest.raises(InvalidInputError, match=r"[23]×[23].*[23]×[23]") as caught:
            getattr(spd, function)(**good(function) | {name: np.eye(2)})
        assert str(caught.value).split()[0] in good(function)


@pytest.mark.parametrize("function", SEVERAL)
def test_batches_that_do_not_broadcast_are_refused(function):
    batches = {name: np.stack([value, value]) for name, value in good(function).items()}
    for name, value in good(function).items():
        with pytest.raises(InvalidInputError, match="leading axes") as caught:
            getattr(spd, function)(**batches | {name: np.stack([value] * 3)})
        for other in batches:
            assert f" {other} ({3 if other == name else 2}, " in str(caught.value)


@pytest.mark.parametrize(
    ("function", "name", "value", "words"),
    [
        (lambda t: spd.geodesic(EYE, EYE, t), "t", [0.0, np.nan], "must be finite; found nan"),
        (
            lambda t: spd.geodesic(EYE, EYE, t),
            "t",
            "half",
            "must be an array of numbers; found str",
        ),
        (
            lambda t: spd.geodesic(np.stack([EYE] * 3), EYE, t),
            "the leading axes",
            [0.0, 1.0],
            "must broadcast",
        ),
        *(
            (lambda e: spd.powm(EYE, e), "exponent", value, "must be")
            for value in (np.nan, "two", [1.0, 2.0], None)
        ),
    ],
)
def test_parameters_must_be_numbers(function, name, value, words):
    with pytest.raises(InvalidInputError, match=f"^{name} {words}"):
        function(value)


def test_points_too_ill_conditioned_for_each_other_are_refused(random_spd):
    a, b = random_spd(np.random.default_rng(0), (2, 500), 6, condition=5e12)
    assert np.all(np.abs(spd.distance(a, b) - spd.distance(b, a)) < 0.01)
    for operation in (
        spd.log,
        lambda x, y: spd.exp(x, x),
        lambda x, y: spd.geodesic(x, y, 0.5),
        lambda x, y: spd.transport(x, x, y),
    ):
        with pytest.raises(
            NotSPDError,
            match=r"ill-conditioned.*0\.01",
        ):
            operation(a, b)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [-5000.0, 5000.0])
def test_results_out_of_range_are_refused(size):
    for call, name in (
        (lambda: spd.exp(EYE, size * EYE), "tangent"),
        (lambda: spd.geodesic(EYE, 2 * EYE, size), "t"),
        (lambda: spd.powm(2 * EYE, size), "exponent"),
        (lambda: spd.expm(size * EYE), "symmetric"),
    ):
        with pytest.raises(ValueError, match=f"^{name}.*out of range"):
            call()


@pytest.mark.parametrize("length", [0, 1, 2, 4, 5, 91])
def test_vectors_of_impossible_length_are_refused(length):
    with pytest.raises(ValueError, match=rf"^vector.*\({length},\)"):
        spd.from_vector(np.zeros(length))
    with pytest.raises(ValueError, match=r"^vector.*\(\)"):
        spd.from_vector(1.0)
