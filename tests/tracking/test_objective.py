"""What following costs: derivatives by finite differences, with everything that may be asked for at once."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import load_arm
from maniport.tracking import Objective


@pytest.mark.parametrize("weighed", [False, True])
def test_derivatives_are_those_of_the_cost(weighed):
    """√f, half the gradient and a Gauss-Newton Hessian, with ellipsoid, position and two axes of the tip."""
    arm, random, n = load_arm("panda"), np.random.default_rng(0), 6
    objective = replace(Objective.of(arm), axis_weights=(3.0, 0.0, 7.0))
    metric = random.normal(size=(n, 6, 6)) if weighed else None
    targets = objective.targets(
        arm.manipulability(arm.sample(n, 2)),
        random.normal(size=(n, 3)),
        None if metric is None else metric @ np.swapaxes(metric, 1, 2),
        Rotation.random(n, random).as_matrix(),
    )
    q, step = arm.sample(n, 1), 1e-6
    length, gradient, hessian = targets.evaluate(q)
    assert length**2 == pytest.approx(targets.cost(q), rel=1e-12)
    moved = [(targets.cost(q + step * e) - targets.cost(q - step * e)) / (4.0 * step) for e in np.eye(arm.dof)]
    assert np.stack(moved, axis=1) == pytest.approx(gradient, abs=1e-6 * np.abs(gradient).max())
    assert np.linalg.eigvalsh(hessian).min() > -1e-9 * np.abs(hessian).max()


def test_axes_angles_are_those_between_directions():
    """The angle told is that between the axis of the tip that counts and where it shall point."""
    arm, n = load_arm("panda"), 5
    objective = replace(Objective.of(arm), axis_weights=(0.0, 0.0, 1.0))
    q, wanted = arm.sample(n, 1), Rotation.random(n, np.random.default_rng(1)).as_matrix()
    targets = objective.targets(arm.manipulability(q), rotations=wanted)
    cosine = np.sum(arm.forward(q)[:, :3, 2] * wanted[:, :, 2], axis=1)
    assert targets.axis_angles(q) == pytest.approx(np.arccos(cosine))
    assert objective.targets(arm.manipulability(q)).axis_angles(q) is None
