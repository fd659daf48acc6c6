"""Tests of smoothness and structure."""

import numpy as np
import pytest

from maniport.errors import InvalidInputError
from maniport.evaluation import smoothness, structure


def diagonals(logarithms):
    """Diagonal SPD matrices with these logarithms of their entries, shape (n, d)."""
    return np.exp(np.asarray(logarithms))[:, :, None] * np.eye(np.shape(logarithms)[1])


def test_steps_of_a_dilated_profile_are_dilated():
    """M → M^s about the identity multiplies every step by s when the ellipsoids have common axes."""
    path = np.cumsum(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]), axis=0)
    found = smoothness(diagonals(0.5 * path), diagonals(path))
    assert (found.original_median, found.original_largest) == pytest.approx((2.0, 3.0))
    assert (found.median, found.largest) == pytest.approx((1.0, 1.5))
    assert (found.median_ratio, found.largest_ratio) == pytest.approx((0.5, 0.5))


def test_a_jump_shows_in_the_largest_step_only():
    """A staircase that gathers many steps into one has the same sum, but its largest step is the whole way."""
    path = np.linspace(0.0, 1.0, 11)[:, None] * np.array([[1.0, 0.0, 0.0]])
    stairs = np.where(path < 0.55, 0.0, path.max(axis=0))
    found = smoothness(diagonals(stairs), diagonals(path))
    assert found.largest_ratio == pytest.approx(10.0)
    assert found.median_ratio == pytest.approx(0.0)


def test_pauses_of_the_teacher_do_not_count_for_the_median():
    """Where the teacher stands still there is no ratio; the median is over the steps in which it moves."""
    path = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 2.0])[:, None] * np.array([[1.0, 0.0, 0.0]])
    found = smoothness(diagonals(path), diagonals(path))
    assert (found.original_median, found.median_ratio) == pytest.approx((1.0, 1.0))
    with pytest.raises(InvalidInputError, match="original stands still"):
        smoothness(diagonals(path), diagonals(0.0 * path))


def test_a_rotation_keeps_distances_and_turns_axes(make_cloud, rng, turn_about):
    """M → R M Rᵀ is an isometry; the turn of the axes is the rotation's angle, less where the axis is aslant."""
    shapes = diagonals(np.array([[2.0, 0.5, -1.0]]) + 0.1 * rng.standard_normal((20, 3)))
    turn = turn_about(25.0)
    turned = turn @ shapes @ turn.T
    found = structure(turned, shapes)
    assert found.spearman == pytest.approx(1.0)
    assert found.distortion < 1e-9
    assert found.major_turn == pytest.approx(25.0)
    assert found.minor_turn == pytest.approx(0.0, abs=1e-6)
    assert (found.major_left_out, found.minor_left_out) == (0, 0)


def test_axes_have_no_sign(rng, turn_about):
    """A turn by 170° is one by 10°."""
    shapes = diagonals(np.array([[2.0, 0.5, -1.0]]) + 0.1 * rng.standard_normal((20, 3)))
    whole = turn_about(170.0)
    assert structure(whole @ shapes @ whole.T, shapes).major_turn == pytest.approx(10.0)


def test_axes_that_do_not_exist_are_left_out_and_counted():
    """A disc has a shortest axis but no longest one; a ball has neither."""
    discs = diagonals([[1.0, 1.0, 0.0], [1.5, 1.5, 0.0], [2.0, 1.0, 0.0]])
    found = structure(discs, discs)
    assert (found.major_left_out, found.minor_left_out) == (2, 0)
    assert found.major_turn == pytest.approx(0.0, abs=1e-6)
    balls = diagonals([[0.0] * 3, [1.0] * 3, [3.0] * 3])
    found = structure(balls, balls)
    assert (found.major_turn, found.minor_turn, found.major_left_out) == (None, None, 3)


def test_distortion_on_a_line():
    """Points 0, 1, 3 mapped to 0, 2, 3 have the ratios 2, 1/2 and 1: median ratio 1, median distortion log 2."""
    original, mapped = (
        diagonals(np.array(line)[:, None] * np.array([[1.0, 0.0, 0.0]])) for line in ([0, 1, 3], [0, 2, 3])
    )
    found = structure(mapped, original)
    assert found.distortion == pytest.approx(np.log(2.0))
    assert found.spearman == pytest.approx(0.5)  # ranks of 1, 3, 2 against those of 2, 3, 1


def test_mapping_all_to_one_loses_all_structure(make_cloud, rng):
    """Then no rank is left and distances are infinitely distorted; that is an answer, not an error."""
    points = make_cloud(rng, 10)
    found = structure(np.tile(points[0], (10, 1, 1)), points)
    assert (found.spearman, found.distortion) == (0.0, np.inf)


def test_long_profiles_are_thinned_for_the_pairs(make_cloud, rng):
    """Pairs are taken between a few ellipsoids, axes of all."""
    points = make_cloud(rng, 60)
    assert structure(points, points, most_points=10).spearman == pytest.approx(1.0)
    with pytest.raises(InvalidInputError, match="most_points must be a whole number of at least 3"):
        structure(points, points, most_points=2)
    with pytest.raises(InvalidInputError, match="original does not vary"):
        structure(points, np.tile(points[0], (60, 1, 1)))
