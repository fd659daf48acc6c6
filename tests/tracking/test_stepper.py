"""What is computed more quickly than by Pink is what Pink computes."""

import numpy as np
import pink
from pink.tasks import PostureTask

import maniport as mp
from maniport.tracking import robot_model
from maniport.tracking.follow.stepper import NearTask


def test_staying_near_a_posture_is_pinks_task():
    """To the last bit, in postures of the Panda."""
    arm = mp.load_arm("panda")
    model = robot_model(arm)
    ours, pinks = NearTask(cost=0.3), PostureTask(cost=0.3)
    for q, near in zip(arm.sample(5, 0), arm.sample(5, 1), strict=True):
        configuration = pink.Configuration(model, model.createData(), q)
        found = []
        for task in (ours, pinks):
            task.set_target(near)
            found.append(task.compute_qp_objective(configuration))
        for one, other in zip(*found, strict=True):
            np.testing.assert_array_equal(one, other)
