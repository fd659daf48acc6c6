from pathlib import Path
from runpy import run_path

import numpy as np
import pink
import pytest
from numpy.testing import assert_allclose
from pink.exceptions import TargetNotSet

from maniport import spd
from maniport.motion import robot_model

EXAMPLE = Path(__file__).parents[1] / "examples" / "pink_task.py"


def test_the_error_is_the_distance(panda):
    model = robot_model(panda)
    task = run_path(str(EXAMPLE))["EllipsoidTask"](panda, lm_damping=0.0)
    epsilon = task.damping.epsilon * np.eye(3)
    q = panda.sample(1, 1)[0]
    target = panda.manipulability(panda.sample(1, 2)[0])

    def at(q):
        return pink.Configuration(model, model.createData(), q)

    with pytest.raises(TargetNotSet):
        task.compute_error(at(q))
    task.set_target(target)

    def half_square(q):
        return 0.5 * np.sum(task.compute_error(at(q)) ** 2)

    distance = spd.distance(target + epsilon, panda.manipulability(q) + epsilon)
    assert_allclose(np.linalg.norm(task.compute_error(at(q))), distance, rtol=1e-9)
    slope = [(half_square(q + step) - half_square(q - step)) / 2e-6 for step in 1e-6 * np.eye(7)]
    assert_allclose(task.compute_jacobian(at(q)).T @ task.compute_error(at(q)), slope, atol=1e-6)
