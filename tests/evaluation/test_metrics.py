import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import spearmanr

from maniport.errors import InvalidInputError, NotSPDError
from maniport.evaluation import distance_preservation, rmse, step_ratio
from maniport.util.sampling import rank_correlation


def diagonals(logarithms):
    """Diagonal SPD matrices with these logarithms of their entries, shape (n, d)."""
    return np.exp(np.asarray(logarithms))[:, :, None] * np.eye(np.shape(logarithms)[1])


def test_rmse_of_balls_in_three_forms():
    """Balls that are all exp(δ) too large are √3 δ off; dispersions are √3 times those of the logarithms."""
    t = np.array([-1.0, 0.0, 0.5, 0.5])
    delta = 0.3
    truth, mapped = (np.exp(values)[:, None, None] * np.eye(3) for values in (t, t + delta))
    measured = rmse(truth, mapped)
    assert measured.undivided == pytest.approx(np.sqrt(3.0) * delta)
    assert measured.per_dispersion == pytest.approx(delta / np.mean(np.abs(t)))
    assert measured.per_squared_dispersion == pytest.approx(delta / (np.sqrt(3.0) * np.mean(t**2)))
    truth[0] *= np.exp(0.8 / np.sqrt(3.0))
    assert rmse(truth, np.exp(t)[:, None, None] * np.eye(3)).undivided == pytest.approx(
        0.4
    )  # one of four


def test_steps_of_a_dilated_profile_are_dilated():
    """M → M^s about the identity multiplies every step by s when the ellipsoids have common axes."""
    path = np.cumsum(
        np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]), axis=0
    )
    assert step_ratio(diagonals(0.5 * path), diagonals(path)) == pytest.approx(0.5)


@pytest.mark.parametrize(("angle", "turn"), [(25.0, 25.0), (171.0, 9.0)])
def test_a_rotation_keeps_distances_and_turns_axes(angle, turn):
    """M → R M Rᵀ is an isometry; axes have no sign, so that a rotation by 171° is one by 9°."""
    shapes = diagonals(
        np.array([[2.0, 0.5, -1.0]]) + 0.1 * np.random.default_rng(11).standard_normal((20, 3))
    )
    rotation = Rotation.from_euler("z", angle, degrees=True).as_matrix()
    measured = distance_preservation(rotation @ shapes @ rotation.T, shapes)
    assert measured.rank_correlation == pytest.approx(1.0)
    assert measured.major_axis_angle == pytest.approx(turn, abs=1e-6)


def test_axes_that_are_not_distinct_are_left_out():
    discs = diagonals([[1.0, 1.0, 0.0], [1.5, 1.5, 0.0], [2.0, 1.0, 0.0]])
    assert distance_preservation(discs, discs).major_axis_angle == pytest.approx(0.0)
    balls = diagonals([[0.0] * 3, [1.0] * 3, [3.0] * 3])
    assert distance_preservation(balls, balls).major_axis_angle is None


def test_rank_correlation_on_a_line():
    """Points 0, 1, 3 mapped to 0, 2, 3 have the distances 2, 3, 1 for 1, 3, 2."""
    mapped, original = (
        diagonals([[x, 0.0, 0.0] for x in points]) for points in ((0, 2, 3), (0, 1, 3))
    )
    assert distance_preservation(mapped, original).rank_correlation == pytest.approx(0.5)
    a, b = np.random.default_rng(0).integers(9, size=(2, 200))  # ties are averaged
    assert rank_correlation(a, b) == pytest.approx(spearmanr(a, b).statistic, abs=1e-12)


POINTS = diagonals(np.random.default_rng(0).standard_normal((5, 3)))
STILL = np.tile(np.eye(3), (5, 1, 1))


@pytest.mark.parametrize(
    ("call", "error", "word"),
    [
        (lambda: rmse(POINTS, POINTS[:4]), InvalidInputError, "5 and 4"),
        (
            lambda: rmse(POINTS, np.tile(np.diag([1.0, 1.0, 0.0]), (5, 1, 1))),
            NotSPDError,
            r"mapped\[0\]",
        ),
        (lambda: rmse(POINTS, STILL), InvalidInputError, "dispersion"),
        (lambda: step_ratio(POINTS, STILL), InvalidInputError, "original"),
        (lambda: distance_preservation(POINTS, STILL), InvalidInputError, "original"),
        (
            lambda: distance_preservation(POINTS, POINTS, most_points=2),
            InvalidInputError,
            "most_points",
        ),
    ],
)
def test_bad_input_is_refused(call, error, word):
    with pytest.raises(error, match=word):
        call()
