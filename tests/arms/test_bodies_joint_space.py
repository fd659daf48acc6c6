"""Samples and joint limits."""

import numpy as np
import pytest

from maniport.arms import load_arm
from maniport.errors import InvalidInputError


@pytest.fixture
def panda():
    """The embedded robot."""
    return load_arm("panda")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 0}, "n must be a whole number of at least 1; found 0"),
        ({"n": 2.5}, "n must be a whole number of at least 1; found 2.5"),
        ({"n": 4, "sequence": "halton"}, "unknown sequence 'halton'"),
        ({"n": 4, "random_state": "seed"}, "random_state .*found 'seed'"),
    ],
)
def test_wrong_sampling_arguments_are_named(panda, arguments, message):
    """Each wrong argument gets an error that says what is allowed."""
    with pytest.raises(InvalidInputError, match=message):
        panda.sample(**arguments)


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
