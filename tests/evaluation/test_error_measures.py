"""Tests of the root mean squared error."""

import numpy as np
import pytest

from maniport.errors import InvalidInputError, NotSPDError
from maniport.evaluation import rmse


def test_three_forms_on_balls():
    """Balls that are all exp(δ) too large are √3 δ off; dispersions are √3 times those of the logarithms."""
    t, delta = np.array([-1.0, 0.0, 0.5, 0.5]), 0.3
    truth, mapped = (np.exp(values)[:, None, None] * np.eye(3) for values in (t, t + delta))
    found = rmse(truth, mapped)
    assert found.undivided == pytest.approx(np.sqrt(3.0) * delta)
    assert found.per_dispersion == pytest.approx(delta / np.mean(np.abs(t)))
    assert found.per_squared_dispersion == pytest.approx(delta / (np.sqrt(3.0) * np.mean(t**2)))


def test_is_a_root_mean_square():
    """One of four ellipsoids that is off by d gives d / 2."""
    truth = np.exp(np.array([-1.0, 0.0, 0.5, 0.5]))[:, None, None] * np.eye(3)
    mapped = truth.copy()
    mapped[0] = mapped[0] * np.diag([np.exp(0.8), 1.0, 1.0])
    assert rmse(truth, mapped).undivided == pytest.approx(0.4)


def test_the_truth_itself_is_zero_off(make_cloud, rng):
    """All three forms vanish where nothing is wrong."""
    points = make_cloud(rng, 20)
    found = rmse(points, points)
    assert max(found.undivided, found.per_dispersion, found.per_squared_dispersion) < 1e-9


def test_bad_input_is_told(make_cloud, rng):
    """Other counts, singular ellipsoids and a mapped set without dispersion are errors that name the argument."""
    points = make_cloud(rng, 5)
    with pytest.raises(InvalidInputError, match="truth and mapped must be equally many; found 5 and 4"):
        rmse(points, points[:4])
    with pytest.raises(NotSPDError, match=r"mapped\[0\] is singular"):
        rmse(points, np.tile(np.diag([1.0, 1.0, 0.0]), (5, 1, 1)))
    with pytest.raises(InvalidInputError, match="mapped has no dispersion"):
        rmse(points, np.tile(np.eye(3), (5, 1, 1)))
