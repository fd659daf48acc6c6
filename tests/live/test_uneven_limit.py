"""Limits for control steps of unequal length."""

import numpy as np
import pytest

import maniport as mp
from maniport.tracking import MotionLimits
from maniport.tracking.limits import UnevenLimit


@pytest.mark.parametrize("seed", range(4))
def test_some_step_is_always_allowed(seed):
    """Driven about at random, for times that differ a hundredfold, an arm keeps every limit and always has a step."""
    limits, draw = MotionLimits.of(mp.load_arm("panda")), np.random.default_rng(seed)
    bound, q = UnevenLimit(limits), limits.arm.sample(1, seed)[0]
    wanted = draw.choice([-10.0, 10.0], limits.arm.dof)
    for _ in range(400):
        dt = 10.0 ** draw.uniform(-4, -2)
        least, most = bound.bounds(q, dt)
        change = 0.5 * limits.acceleration * (dt + (dt if bound.last is None else bound.last))
        assert (most >= bound.velocity - change - 1e-9).all()
        assert (least <= bound.velocity + change + 1e-9).all()
        assert (least <= most).all()
        turned = draw.random(limits.arm.dof) < 0.02
        wanted = np.where(turned, -wanted, wanted)
        velocity, (q, stop) = bound.step(q, wanted, dt)
        np.testing.assert_array_equal(velocity, np.clip(wanted, least, most))
        assert (np.abs(velocity - bound.velocity) <= change * (1 + 1e-9) + 1e-12).all()
        bound.velocity, bound.last = velocity, dt
        for posture in (q, stop):
            assert (posture >= limits.lower - 1e-9).all()
            assert (posture <= limits.upper + 1e-9).all()
