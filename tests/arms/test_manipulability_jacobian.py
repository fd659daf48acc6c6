"""Laws of the derivative of the manipulability ellipsoid in the joints."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.arms import Arm, EllipsoidSpec, load_arm

STEP = 1e-5


def _mixed() -> Arm:
    """A made-up arm with seven joints, three of them slides, so that all parts are regular."""
    kinds = ["revolute", "prismatic", "revolute", "revolute", "prismatic", "revolute", "revolute", "prismatic"]
    rows = np.random.default_rng(0).uniform(-1, 1, (8, 4))
    return Arm.from_dh("mixed", rows, kinds=kinds)


ARMS = {"panda": lambda: load_arm("panda"), "myoarm": lambda: load_arm("myoarm"), "rhuman": lambda: load_arm("rhuman"),
        "mixed": _mixed}  # fmt: skip


def _differences(arm: Arm, q: np.ndarray, **options) -> np.ndarray:
    """Central differences of the manipulability in every joint, fourth order."""
    moves = STEP * np.eye(arm.dof)
    near, far = (arm.manipulability(q[:, None] + s * moves, **options) for s in (10, 20))
    near_back, far_back = (arm.manipulability(q[:, None] - s * moves, **options) for s in (10, 20))
    return (8 * (near - near_back) - (far - far_back)) / (120 * STEP)


@pytest.fixture(params=ARMS)
def arm(request) -> Arm:
    """ArmGroup with plain, coupled, many and sliding joints."""
    return ARMS[request.param]()


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("part", ["translation", "rotation", "full"])
def test_velocity_derivative_is_that_of_finite_differences(arm, part, weighted):
    """Every entry agrees with central differences of the ellipsoids to 1e-7."""
    options = {"part": part, "joint_weights": np.linspace(0.5, 2, arm.dof) if weighted else None}
    q = arm.sample(20, random_state=1)
    assert_allclose(
        arm.manipulability_jacobian(q, EllipsoidSpec(**options)), _differences(arm, q, **options), rtol=0, atol=1e-7
    )


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("part", ["translation", "rotation"])
def test_force_derivative_is_that_of_finite_differences(arm, part, weighted):
    """The same holds for force ellipsoids, relative to the size of their derivative."""
    options = {"kind": "force", "part": part, "joint_weights": np.linspace(0.5, 2, arm.dof) if weighted else None}
    q = arm.sample(64, random_state=2)
    regular = np.linalg.cond(arm.manipulability(q, **options)) < 100
    found, expected = (
        arm.manipulability_jacobian(q[regular], EllipsoidSpec(**options)),
        _differences(arm, q[regular], **options),
    )
    assert regular.sum() > 5
    scale = np.abs(expected).max(axis=(1, 2, 3), keepdims=True)
    assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-7)
