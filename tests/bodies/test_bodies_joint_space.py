"""Samples and joint limits."""

import numpy as np
import pytest

from maniport.bodies import load_arm
from maniport.errors import InvalidInputError


@pytest.fixture
def panda():
    """The embedded robot."""
    return load_arm("panda")


@pytest.mark.parametrize("sequence", ["sobol", "uniform"])
@pytest.mark.parametrize("name", ["panda", "myoarm", "rhuman"])
def test_samples_lie_within_limits_and_fill_them(name, sequence):
    """All samples respect the limits, and they reach into the outer tenth on every side."""
    arm = load_arm(name)
    q = arm.sample(500, random_state=0, sequence=sequence)
    assert q.shape == (500, 7)
    assert np.all((q >= arm.lower) & (q <= arm.upper))
    margin = 0.1 * (arm.upper - arm.lower)
    assert np.all(q.min(axis=0) < arm.lower + margin)
    assert np.all(q.max(axis=0) > arm.upper - margin)


@pytest.mark.parametrize("sequence", ["sobol", "uniform"])
def test_same_seed_same_bits(panda, sequence):
    """A seed fixes every bit, as number or as generator; another seed and no seed give other samples."""
    draw = lambda seed: panda.sample(100, random_state=seed, sequence=sequence)  # noqa: E731
    np.testing.assert_array_equal(draw(7), draw(7))
    np.testing.assert_array_equal(draw(7), draw(np.random.default_rng(7)))
    assert not np.any(draw(7) == draw(8))
    assert not np.any(draw(None) == draw(None))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 0}, "n must be a whole number of at least 1; found 0"),
        ({"n": 2.5}, "n must be a whole number of at least 1; found 2.5"),
        ({"n": 4, "sequence": "halton"}, "unknown sequence 'halton'"),
        ({"n": 4, "random_state": "seed"}, "random_state must be None, .* found 'seed'"),
    ],
)
def test_wrong_sampling_arguments_are_named(panda, arguments, message):
    """Each wrong argument gets an error that says what is allowed."""
    with pytest.raises(InvalidInputError, match=message):
        panda.sample(**arguments)


def test_outside_limits_names_joint_index_value_and_limits(panda):
    """The error says which value of which joint lies outside which limits, and how many do."""
    q = np.tile(0.5 * (panda.lower + panda.upper), (2, 3, 1))
    q[1, 2, 3] = 0.25
    message = (
        r"path\[1, 2, 3\] = 0.25 lies outside the limits -3.0718 to -0.0698 of joint 'panda_joint4' of 'panda' "
        r"\(1 of 42 values lie outside\)"
    )
    with pytest.raises(InvalidInputError, match=message):
        panda.require_within_limits(q, "path")


@pytest.mark.parametrize(
    ("q", "message"),
    [
        (np.zeros(6), r"q must have shape \(\.\.\., 7\).*'panda' \(panda_joint1, .*\); found shape \(6,\)"),
        (0.0, r"q must have shape \(\.\.\., 7\).*found shape \(\)"),
        ([[0, 0, np.nan, 0, 0, 0, 0]], r"q must be finite; found nan at index \(0, 2\)"),
        ("home", "q must be an array of numbers; found str"),
    ],
)
def test_wrong_configurations_are_refused(panda, q, message):
    """Shape, nan and type of a configuration are checked by every method that takes one."""
    methods = (panda.forward, panda.jacobian, panda.manipulability, panda.skeleton, panda.require_within_limits)
    for method in methods:
        with pytest.raises(InvalidInputError, match=message):
            method(q)
