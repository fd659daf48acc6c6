"""The relative and the absolute ellipsoids of a pair: their formulas, derivatives and references."""

import numpy as np
import pytest
from robot_packages import model_of

import maniport as mp
from maniport.arms.loaders.packages import PACKAGES
from real_robots import HERE, MISSING

KINDS = ("relative", "absolute")
SPECS = [
    mp.EllipsoidSpec(), mp.EllipsoidSpec("force"), mp.EllipsoidSpec(part="rotation"),
    mp.EllipsoidSpec("force", "full"), mp.EllipsoidSpec(part="full", joint_weights="velocity-limits"),
]  # fmt: skip


@pytest.fixture(scope="module")
def pandas():
    """Two Pandas on a table."""
    return mp.load_arms("panda", ("panda_link8", "panda_hand_tcp"), bases=((0, 0.3, 0), (0.1, -0.3, 0, 0.4)))


@pytest.fixture(scope="module")
def talos():
    """A humanoid whose torso moves both arms, with two joints."""
    if not HERE:
        pytest.skip(MISSING)
    return mp.load_arms("talos")


def test_ellipsoids_of_arms_without_shared_joints_are_sums(pandas):
    """M_r = M_left + M_right and M_a = (M_left + M_right) / 4 to 1e-12; those of force are their inverses."""
    q = pandas.sample(64, 0)
    for part in ("translation", "rotation", "full"):
        together = pandas.manipulability(q, part=part).sum(axis=1)
        np.testing.assert_allclose(pandas.relative.manipulability(q, part=part), together, rtol=0, atol=1e-12)
        np.testing.assert_allclose(pandas.absolute.manipulability(q, part=part), together / 4, rtol=0, atol=1e-12)
    force = pandas.absolute.manipulability(q, "force")
    np.testing.assert_allclose(force @ pandas.absolute.manipulability(q), np.tile(np.eye(3), (64, 1, 1)), atol=1e-9)


def test_shared_joints_count_once(talos):
    """With the blocks of J = [T A 0; T' 0 B] of a torso and two arms, M is theirs and not the sum of both arms'."""
    q = talos.sample(32, 1)
    jacobian, count = talos.jacobian(q)[..., :3, :], len(talos.shared)
    own = [jacobian[:, i][..., np.setdiff1d(columns, range(count))] for i, columns in enumerate(talos.columns)]
    arms = sum(block @ np.swapaxes(block, -1, -2) for block in own)
    for kind, factors in (("relative", (-1.0, 1.0)), ("absolute", (0.5, 0.5))):
        torso = factors[0] * jacobian[:, 0, :, :count] + factors[1] * jacobian[:, 1, :, :count]
        expected = torso @ np.swapaxes(torso, -1, -2) + arms * factors[1] ** 2
        np.testing.assert_allclose(getattr(talos, kind).manipulability(q), expected, rtol=0, atol=1e-12)
    twice = talos.manipulability(q).sum(axis=1)
    assert np.linalg.norm(talos.relative.manipulability(q) - twice, axis=(1, 2)).min() > 0.01


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("body", ["pandas", "talos"])
def test_derivatives_of_ellipsoids_are_finite_differences(body, kind, request):
    """Central differences of M in every joint, shared ones included, for each kind and part, weighted or not."""
    arms = request.getfixturevalue(body)
    one, h = getattr(arms, kind), 1e-6
    q = 0.6 * arms.sample(3, 2) + 0.4 * np.clip(0.3, arms.lower, arms.upper)
    for spec in SPECS:
        changes = one.manipulability_jacobian(q, spec)
        for k, step in enumerate(h * np.eye(arms.dof)):
            change = (one.ellipsoids(q + step, spec) - one.ellipsoids(q - step, spec)) / (2 * h)
            np.testing.assert_allclose(changes[:, k], change, atol=1e-6 * max(1.0, np.abs(change).max()))


def test_jacobians_of_a_humanoid_are_those_of_mujoco(talos):
    """Relative and absolute Jacobians of Talos against MuJoCo's of both hands, to 1e-9."""
    mujoco = pytest.importorskip("mujoco")
    model = model_of(mujoco, PACKAGES["example-robot-data"].found()["talos_reduced"])
    data = mujoco.MjData(model)
    columns = [model.joint(name).dofadr[0] for name in talos.joint_names]
    for q in talos.sample(4, 0):
        data.qpos[:] = 0.0
        for name, value in zip(talos.joint_names, q, strict=True):
            data.joint(name).qpos = value
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        tips = []
        for arm in talos.arms:
            body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, arm.frame)
            linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, linear, angular, data.xpos[body], body)
            tips.append(np.vstack([linear, angular])[:, columns])
        np.testing.assert_allclose(talos.jacobian(q), tips, atol=1e-9)
        np.testing.assert_allclose(talos.relative.jacobian(q), tips[1] - tips[0], atol=1e-9)
        np.testing.assert_allclose(talos.absolute.jacobian(q), (tips[0] + tips[1]) / 2, atol=1e-9)
