"""Motions and their limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from maniport.motion import MotionLimits, retime, with_approach
from properties.strategies import fewer

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
seeds = st.integers(0, 2**32 - 1)


@fewer(0.2)
@given(seed=seeds, slower=st.floats(1.0, 20.0), origin=st.sampled_from([0.0, -3.0, 1e6]))
def test_timed_motions_keep_their_limits(panda, seed, slower, origin):
    """Whatever the pace, postures are passed in order, from rest to rest, within every limit, from any time on."""
    limits = MotionLimits.of(panda)
    time = slower * np.linspace(0.0, 1.0, 6)
    ends = np.sort(panda.sample(2, seed), axis=0)
    q = np.clip(ends[0] + np.linspace(0.0, 1.0, 6)[:, None] * (ends[1] - ends[0]), limits.lower, limits.upper)
    timed = retime(limits, time, q, rate=20.0)
    shifted = retime(limits, time + origin, q, rate=20.0)
    assert_allclose(shifted.control_positions, timed.control_positions, atol=5e-4)
    assert np.all(np.diff(timed.time) > 0.0)
    assert np.ptp(timed.time) >= slower * (1.0 - 1e-6) - 0.1
    assert limits.use(timed.control_time, timed.control_positions).within
    led = with_approach(timed, limits, q[-1])
    assert limits.use(led.control_time, led.control_positions).within
    assert_allclose(led.control_positions[[0, -1]], q[[-1, -1]], atol=1e-9)
    assert np.ptp(led.time) == pytest.approx(np.ptp(timed.time))
