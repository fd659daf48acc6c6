"""Gravity torques and inverse dynamics against Pinocchio, payloads, and ellipsoids that depend on gravity."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from drawn_arms import inertias, model_of
from numpy.testing import assert_allclose

from maniport.arms import Arm, EllipsoidSpec, load_arm
from maniport.arms.chain import Chain
from maniport.arms.restriction import mirrored, standing
from maniport.errors import InvalidInputError


def heavy(arm, seed=0):
    random = np.random.default_rng(seed)
    inertia = []
    for _ in range(len(arm.chain.joints) + 1):
        spread = random.normal(size=(3, 3)) * 0.1
        inertia.append(
            pin.Inertia(
                random.uniform(1, 3), random.normal(size=3) * 0.2, spread @ spread.T
            ).matrix()
        )
    limits = np.linspace(80.0, 40.0, arm.dof)
    return Arm(
        replace(arm.chain, inertia=np.array(inertia), effort_limits=limits, gravity=Chain.gravity)
    )


def assert_like_pinocchio(arm):
    q = arm.sample(5, 3)
    model = model_of(arm.chain)
    chain = arm.chain
    torques = arm.gravity_torques(q)
    data = model.createData()
    for i, positions in enumerate(q @ chain.coupling.T + chain.offset):
        gravity = pin.computeGeneralizedGravity(model, data, positions)
        assert_allclose(torques[i], chain.coupling.T @ gravity, rtol=1e-12, atol=1e-10)


@pytest.fixture(params=["panda", "rhuman", "crane"])
def arm(request, crane):
    return heavy(crane.arms[0] if request.param == "crane" else load_arm(request.param))


def test_gravity_agrees_with_pinocchio(arm):
    assert_like_pinocchio(arm)
    assert_like_pinocchio(Arm(mirrored(arm.chain)))
    leaning = np.eye(4)
    leaning[:3] = pin.SE3(
        pin.rpy.rpyToMatrix(0.4, 0.2, 0.3), np.array([0.1, -0.2, 0.3])
    ).homogeneous[:3]
    other = Arm(standing(arm.chain, leaning))
    assert_like_pinocchio(other)
    assert (
        np.abs(
            other.gravity_torques(other.sample(3, 0)) - arm.gravity_torques(arm.sample(3, 0))
        ).max()
        > 1.0
    )


def test_restricted_chains_keep_their_masses():
    """Locked joints, another end effector and another base leave the torques of a robot at rest as they are."""
    arm = heavy(load_arm("panda"))
    q = np.clip(np.zeros(7), arm.lower, arm.upper)
    q[:3] = [0.2, 0.4, -0.3]
    held = {name: q[i] for i, name in enumerate(arm.joint_names) if i > 2}
    torques = arm.gravity_torques(q)
    inertia = inertias(arm, q[None])[0]
    for part in (arm.restricted(lock=held), arm.restricted("panda_link3")):
        if part.frame == "panda_link3":  # the omitted joints are at rest
            q[3:] = np.clip(0.0, arm.lower, arm.upper)[3:]
            torques = arm.gravity_torques(q)
            inertia = inertias(arm, q[None])[0]
        assert_allclose(part.gravity_torques(q[:3]), torques[:3], rtol=1e-9, atol=1e-12)
        assert_allclose(inertias(part, q[None, :3])[0], inertia[:3, :3], rtol=1e-9)
        assert_allclose(part.effort_limits, arm.effort_limits[:3])
    q[:3] = 0.0
    seen = arm.restricted(base="panda_link2")
    assert_allclose(seen.gravity_torques(q[2:]), arm.gravity_torques(q)[2:], rtol=1e-9, atol=1e-9)


def test_payload_pulls_the_end_effector_down():
    arm = heavy(load_arm("panda"))
    center = np.array([0.05, 0.0, 0.1])
    q = arm.sample(4, 0)
    loaded = arm.with_payload(2.5, center)
    lever = arm.forward(q)[:, :3, :3] @ center
    jacobian = arm.jacobian(q)
    linear = jacobian[:, :3] + np.cross(jacobian[:, 3:], lever[..., None], axis=1)
    expected = arm.gravity_torques(q) + 2.5 * 9.81 * linear[:, 2]
    assert_allclose(loaded.gravity_torques(q), expected, atol=1e-9)
    assert_like_pinocchio(loaded)
    with pytest.raises(InvalidInputError, match=r"mass.*-1"):
        arm.with_payload(-1.0)
    light = Arm(replace(load_arm("panda").chain, inertia=None))
    with pytest.raises(InvalidInputError, match=r"masses.*'panda'"):
        light.with_payload(1.0)
    with pytest.raises(InvalidInputError, match=r"'panda'.*masses"):
        light.gravity_torques(np.zeros(7))


@pytest.mark.parametrize("name", ["panda", "rhuman"])
@pytest.mark.parametrize("weights", [None, "joint-limits", "numbers"])
@pytest.mark.parametrize("part", ["translation", "full"])
def test_changes_of_ellipsoids_are_finite_differences(name, weights, part):
    massive = heavy(load_arm(name))
    weights = np.linspace(40.0, 90.0, massive.dof) if weights == "numbers" else weights
    spec = EllipsoidSpec("force", part, weights).bounded
    q = massive.sample(60, 1)
    step = 1e-5
    held = np.abs(massive.gravity_torques(q))
    q = q[
        ((held > 0.01) | (held < 1e-9)).all(axis=1)
        & (np.abs(held - 0.95 * massive.effort_limits) > 0.1).all(1)
    ]
    shifts = step * np.eye(massive.dof)
    m = {n: massive.ellipsoids(q[:, None] + n * shifts, spec) for n in (-2, -1, 1, 2)}
    expected = (8 * (m[1] - m[-1]) - (m[2] - m[-2])) / (12 * step)
    _, _, ellipsoids, changes = massive.posed_differentials(q, spec)
    assert_allclose(
        ellipsoids, massive.ellipsoids(q, spec), rtol=1e-9, atol=1e-12 * np.abs(ellipsoids).max()
    )
    scale = np.abs(expected).max(axis=(1, 2, 3), keepdims=True)
    assert len(q) > 20
    assert_allclose(changes / scale, expected / scale, atol=1e-6)


def test_ellipsoids_hold_the_limits_of_each_joint():
    """They are the formulas of `EllipsoidSpec`; force and load are inverse, and a floor keeps torques above zero."""
    arm = heavy(load_arm("panda")).with_payload(12.0)
    q = arm.sample(50, 2).reshape(5, 10, 7)
    limits = arm.effort_limits
    jacobian = arm.jacobian(q)[..., :3, :]
    gravity = np.abs(arm.gravity_torques(q))
    assert np.any(gravity > limits)
    torques = np.maximum(limits - gravity, 0.05 * limits)
    load = (jacobian / torques[..., None, :] ** 2) @ np.swapaxes(jacobian, -1, -2)
    force = arm.manipulability(q, "force", joint_weights="joint-limits")
    spec = EllipsoidSpec("force", joint_weights="joint-limits")
    assert_allclose(arm.ellipsoids(q, spec.bounded), load, rtol=1e-9)
    assert_allclose(force @ load, np.broadcast_to(np.eye(3), load.shape), atol=1e-8)
    assert EllipsoidSpec("force", joint_weights="joint-limits").unit == "N"
    assert_allclose(arm.with_limits(velocity=2.0, effort=5.0).effort_limits, 5.0)


def test_missing_limits_are_named():
    arm = Arm(replace(load_arm("panda").chain, effort_limits=None))
    with pytest.raises(InvalidInputError, match="effort limits"):
        arm.manipulability(np.ones(7), "force", joint_weights="joint-limits")


def test_ellipsoids_are_of_velocity_or_force():
    with pytest.raises(InvalidInputError, match="kind"):
        EllipsoidSpec("acceleration")
