"""Extents along lines: smooth ones bound the exact ones, and have the derivatives of differences."""

import numpy as np
import pytest

import maniport as mp
from maniport.arms.directional import half_sphere, line_extent, smooth_extents
from maniport.arms.extent_kernels import fill_force_extents, fill_velocity_extents
from maniport.arms.manipulability import EllipsoidSpec

ROBOTS = ("panda", "ur5", "g1_right_arm")
KINDS = ("force", "velocity")


def lines_for(count: int, k: int) -> np.ndarray:
    vectors = np.random.default_rng(3).normal(size=(count, k, 3))
    return vectors / np.linalg.norm(vectors, axis=2, keepdims=True)


@pytest.fixture(params=ROBOTS)
def robot(request):
    return mp.load_arm(request.param)


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_are_those_of_differences(robot, kind):
    q = robot.sample(8, 1)
    lines = lines_for(8, 3)
    extents = smooth_extents(robot, q, lines, kind)
    step = 1e-6
    for k in range(robot.dof):
        change = np.zeros(robot.dof)
        change[k] = step
        above = smooth_extents(robot, q + change, lines, kind).logs
        below = smooth_extents(robot, q - change, lines, kind).logs
        expected = (above - below) / (2.0 * step)
        np.testing.assert_allclose(extents.joint_changes[:, :, k], expected, rtol=2e-6, atol=2e-7)
    for x in range(3):
        change = np.zeros(3)
        change[x] = step
        above = smooth_extents(robot, q, lines + change, kind).logs
        below = smooth_extents(robot, q, lines - change, kind).logs
        expected = (above - below) / (2.0 * step)
        np.testing.assert_allclose(extents.line_changes[:, :, x], expected, rtol=2e-6, atol=2e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_smooth_extents_are_at_most_the_exact_ones(robot, kind):
    q = robot.sample(64, 1)
    lines = lines_for(64, 4)
    logs = smooth_extents(robot, q, lines, kind).logs
    exact = line_extent(robot, q, lines, kind)
    facets = robot.dof
    if kind == "velocity":
        facets = robot.dof * (robot.dof - 1) // 2
    usable = exact > 0.0  # where the arm holds itself
    torques = robot.remaining_torques(q).torques
    usable &= np.all(torques > 0.06 * robot.effort_limits, axis=1)[:, None]
    assert usable.mean() > 0.5
    difference = np.log(exact[usable]) - logs[usable]
    widening = 0.02  # of the cube that is added to velocities
    assert difference.min() > -widening
    assert difference.max() < np.log(facets) / 8.0 + 1e-12


def test_the_second_power_of_forces_is_the_force_ellipsoid():
    arm = mp.load_arm("panda")
    q = arm.sample(16, 1)
    lines = lines_for(16, 2)
    spec = EllipsoidSpec("force", joint_weights="joint-limits")
    inverse = np.linalg.inv(arm.ellipsoids(q, spec))
    expected = 1.0 / np.sqrt(np.einsum("nki,nij,nkj->nk", lines, inverse, lines))
    logs = smooth_extents(arm, q, lines, "force", power=2).logs
    np.testing.assert_allclose(np.exp(logs), expected, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_extents_are_of_lines_and_turn_with_the_base(kind):
    arm = mp.load_arm("panda")
    q = arm.sample(8, 1)
    lines = lines_for(8, 2)
    logs = smooth_extents(arm, q, lines, kind).logs
    np.testing.assert_allclose(smooth_extents(arm, q, -lines, kind).logs, logs)

    turned = q.copy()
    turned[:, 0] += 0.4  # the vertical axis of the first joint
    rotation = np.array([[np.cos(0.4), -np.sin(0.4), 0], [np.sin(0.4), np.cos(0.4), 0], [0, 0, 1]])
    again = smooth_extents(arm, turned, lines @ rotation.T, kind).logs
    tolerance = 1e-9 if kind == "force" else 2e-3  # the cube of velocities has the base's axes
    np.testing.assert_allclose(again, logs, atol=tolerance)


def test_lines_of_each_configuration_have_the_extents_of_common_ones():
    arm = mp.load_arm("ur5")
    q = arm.sample(5, 1)
    lines = half_sphere(7)
    for kind in KINDS:
        together = line_extent(arm, q, lines, kind)
        each = line_extent(arm, q, np.tile(lines, (5, 1, 1)), kind)
        np.testing.assert_array_equal(together, each)


def test_the_force_of_a_lever_is_the_torque_over_its_length():
    lever = mp.Arm.from_dh("lever", [[0.0, 0.0, 0.5, 0.0]])
    arm = lever.with_limits(effort=10.0, velocity=2.0)
    lines = np.array([[[0.0, 1.0, 0.0]]])
    logs = smooth_extents(arm, np.zeros((1, 1)), lines, "force").logs
    assert np.exp(logs[0, 0]) == pytest.approx(20.0)


@pytest.mark.parametrize("kind", KINDS)
def test_arrays_that_cannot_be_written_compile_nothing_more(kind):
    robot = mp.load_arm("panda")
    q = robot.sample(2, 1)
    lines = lines_for(2, 3)
    expected = smooth_extents(robot, q, lines, kind)
    kernel = {"force": fill_force_extents, "velocity": fill_velocity_extents}[kind]
    compiled = len(kernel.signatures)
    lines.setflags(write=False)
    jacobians = np.asfortranarray(robot.jacobian(q))
    jacobians.setflags(write=False)
    extents = smooth_extents(robot, q, lines, kind, jacobians=jacobians)
    np.testing.assert_array_equal(extents.logs, expected.logs)
    assert len(kernel.signatures) == compiled
