"""Tracking stops in local minima, and the result says so."""

from dataclasses import replace

import numpy as np
import pytest

from maniport.arms import Arm
from maniport.errors import ConvergenceWarning
from maniport.motion import track
from maniport.motion.targets import TargetTrajectory

TIME = np.linspace(0.0, 6.0, 31)
START = np.array([np.pi / 2, -np.pi / 6, -np.pi / 2, -np.pi / 2])
REACHABLE = np.array([np.pi / 16, np.pi / 4, np.pi / 8, -np.pi / 8])


@pytest.fixture(scope="module")
def planar():
    """Four links of 4 m in a plane."""
    return Arm.from_dh("planar", [[0.0, 0.0, 4.0, 0.0]] * 4, -np.pi, np.pi)


def target_of(arm, factor=1.0):
    """Return one reachable ellipsoid, times a factor, at all times."""
    ellipsoids = np.tile(factor * arm.manipulability(REACHABLE), (len(TIME), 1, 1))
    return TargetTrajectory.checked(arm, TIME, ellipsoids)


def test_a_local_minimum_is_reported(planar):
    target = target_of(planar)
    with pytest.warns(ConvergenceWarning, match="local minimum"):
        own = track(planar, target, start=START).arms[0]
    assert own.distance[-1] > 0.1
    assert own.local_minimum[-1]
    assert not own.local_minimum[0]


def test_from_the_right_start_nothing_is_reported(planar, recwarn):
    target = target_of(planar)
    plain = track(planar, target, start=REACHABLE + 0.2).arms[0]
    assert plain.distance[-1] < 0.01
    assert not plain.local_minimum.any()
    assert not recwarn.list


def test_an_infeasible_target_is_no_local_minimum(planar):
    target = target_of(planar, 100.0)
    own = track(planar, target, start=0.1 * REACHABLE).arms[0]
    assert own.distance[-1] > 1.0
    assert not own.local_minimum[-1]


def test_with_a_path_nothing_is_searched(planar):
    target = target_of(planar)
    placed = replace(target, positions=np.zeros((len(TIME), 3)))
    assert track(planar, placed, start=REACHABLE).arms[0].local_minimum is None
