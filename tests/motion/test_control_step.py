from types import SimpleNamespace

import numpy as np
import pytest

from arm_problems import arm_problem
from maniport.arms import Arm, load_arm
from maniport.arms.collisions import Collisions
from maniport.motion.controller import Controller, ControlProblem, ControlState
from maniport.motion.costs.cost import NormalEquations
from maniport.motion.problem import FOLLOWING_WEIGHT, CostWeights


class NoTargets:
    position = None

    def at(self, q):
        return SimpleNamespace(joint_positions=q)

    def normal_equations(self, q, at):
        return NormalEquations.zeros(*q.shape)


@pytest.mark.parametrize("seed", range(3))
def test_limits_never_contradict_one_another(panda, seed):
    """Whatever velocity is desired and whatever steps last, position, velocity and acceleration limits are kept."""
    rng = np.random.default_rng(seed)
    accelerations = rng.uniform(1, 20, 7) if seed < 2 else np.full(7, np.inf)
    driver = Controller(panda, panda.velocity_limits, accelerations)
    state = ControlState.at_rest(panda.sample(1, seed)[0])
    for i in range(2000):
        if i % 200 == 0:
            desired = 10.0 * rng.choice([-1.0, 1.0], 7)
        dt = 0.01 if i < 1000 else rng.uniform(0.001, 0.03)
        before = state
        state = driver.step(ControlProblem((NoTargets(),), state.q + desired, 1.0), state, dt)
        assert state.solved
        change = 0.5 * accelerations * (dt + (before.dt or dt))
        assert np.all(np.abs(state.velocity - before.velocity) <= change * (1 + 1e-9) + 1e-9)
        assert np.all(np.abs(state.velocity) <= panda.velocity_limits * (1 + 1e-12))
        assert np.all((state.q >= panda.lower - 1e-9) & (state.q <= panda.upper + 1e-9))


@pytest.fixture(scope="module")
def hand():
    """The Panda with its hand on a table, samples of it, and their clearance."""
    arm = load_arm("panda", frame="panda_hand_tcp")
    collisions = Collisions.of(arm, table=0.0)
    q = arm.sample(512, 0)
    return arm, collisions, q, clearance_of(collisions, q)


def clearance_of(collisions, q):
    """Smallest distances at configurations (n, dof), of links with at most two coordinates between four times that."""
    rows, distance, _ = collisions.gradient(q, 1.0, scaled=True)
    clearance = np.full(len(q), np.inf)
    np.minimum.at(clearance, rows, distance)
    return clearance


def moved(arm, collisions, start, goal, acceleration=10.0):
    """Configurations on the motion from one configuration towards another."""
    driver = Controller(arm, 0.5 * arm.velocity_limits, np.full(7, acceleration), collisions)
    state = ControlState.at_rest(start)
    path = []
    for _ in range(150):
        state = driver.step(ControlProblem((NoTargets(),), goal, 1.0), state, 0.02)
        path.append(state.q)
    return np.array(path)


def test_configurations_that_collide_are_not_reached(hand):
    arm, collisions, q, clearance = hand
    for start, goal in zip(q[clearance > 0.03][:2], q[clearance < -0.02][:2], strict=True):
        path = moved(arm, collisions, start, goal)
        assert clearance_of(collisions, path).min() > 0.015
        assert not collisions.collides(path).any()
        assert clearance_of(collisions, moved(arm, None, start, goal)).min() < 0.0


WIDE = Arm.from_dh("wide", [[0.0, 0.0, 0.1, 0.0]] * 7, -9.0, 9.0)
SLOW = np.full(7, 5.0), np.full(7, 2.0)  # velocities and accelerations


class OneAxis:
    """Target positions of the end effector that is moved along x by the first joint, as in `ArmProblem`."""

    position = SimpleNamespace(positions=np.array([[1.0, 0.0, 0.0]]), weight=200.0)

    def at(self, q):
        jacobians = np.zeros((1, 6, 7))
        jacobians[0, 0, 0] = 1.0
        return SimpleNamespace(joint_positions=q, jacobians=jacobians)

    def normal_equations(self, q, at):
        """Cost (200 (q₀ − 1))² of the first joint, which moves the end effector by 1 m/rad."""
        offset = q[:, 0] - 1.0
        slope = 200.0 * at.jacobians[:, 0]
        return NormalEquations(
            ellipsoid_square=np.zeros(1),
            square=(200.0 * offset) ** 2,
            gradient=200.0 * offset * slope,
            hessian=slope[:, :, None] @ slope[:, None],
        )


def approached(horizon, limits=(), steps=150):
    """States of a joint that accelerates by at most 2/s² and goes from 0 to 1 by steps of 0.01 s."""
    driver = Controller(WIDE, *SLOW, limits=limits)
    state = ControlState.at_rest(np.zeros(7))
    states = []
    for _ in range(steps):
        problem = ControlProblem((OneAxis(),), np.zeros(7), 1e-3, 0.0, None, horizon)
        states.append(state := driver.step(problem, state, 0.01))
    return states


def test_a_horizon_brakes_before_the_target():
    without, short, long = (
        np.array([state.q[0] for state in approached(horizon, steps=300)])
        for horizon in ((), (0.05, 0.1), (0.1, 0.2, 0.4))
    )
    assert without.max() > 1.5
    assert 1.0 < short.max() < without.max() - 0.3
    assert long.max() < 1.1
    for q in (short, long):
        assert np.abs(np.diff(q, 2)).max() <= 2.0 * 0.01**2 + 1e-12


def test_later_positions_start_an_arm_before_its_target_moves():
    """The first joint, which moves the end effector by 1 m/rad, starts early; equal positions change nothing."""
    driver = Controller(WIDE, *SLOW)
    rest = ControlState.at_rest(np.eye(7)[0])
    speeds = []
    for ends in (None, [1.0, 1.0, 1.0], [1.0, 1.05, 1.2]):
        positions = None if ends is None else (np.outer(ends, [1.0, 0.0, 0.0]),)
        problem = ControlProblem(
            (OneAxis(),), np.zeros(7), 1e-3, 0.0, None, (0.05, 0.1), positions=positions
        )
        speeds.append(driver.step(problem, rest, 0.01).velocity[0])
    assert speeds[0] == speeds[1] == pytest.approx(0.0, abs=1e-6)
    assert speeds[2] == pytest.approx(0.02)


def test_inequalities_beyond_accelerations_are_violated_as_little_as_possible():
    """A wall that appears before a moving arm: it brakes as its accelerations allow, and each such step is reported."""

    class Wall:
        at = np.inf

        def inequalities(self, q, dt):
            return np.eye(7)[:1], np.minimum([self.at - q[0]], 1e6)

    wall = Wall()
    states = approached((0.05, 0.1), (wall,), steps=60)
    assert all(state.solved for state in states)
    driver = Controller(WIDE, *SLOW, limits=(wall,))
    state = states[-1]
    wall.at = states[-1].q[0] + 0.01
    problem = ControlProblem((OneAxis(),), np.zeros(7), 1e-3, 0.0, None, (0.05, 0.1))
    for _ in range(20):
        last = state
        state = driver.step(problem, state, 0.01)
        assert not state.solved
        assert state.velocity[0] == pytest.approx(last.velocity[0] - 0.02)


def test_inequalities_that_contradict_one_another_do_not_stop_the_arm():
    """Joints 0 and 1 must have a sum of velocities below −1 and above 1 rad/s: a sum of 0 violates both the least."""
    sides = SimpleNamespace(
        inequalities=lambda q, dt: (np.outer([1.0, -1.0], np.arange(7) < 2), np.full(2, -dt))
    )
    state = approached((0.05, 0.1), (sides,), steps=60)[-1]
    assert state.q[0] > 0.1
    assert state.q[:2].sum() == pytest.approx(0.0, abs=1e-3)


def test_position_has_priority_over_the_ellipsoid():
    """While the target ellipsoid departs from the feasible ones, the distance grows and the end effector stays."""
    panda = load_arm("panda")
    start = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5])
    shapes = panda.manipulability(start) + np.linspace(0.0, 3.0, 60)[:, None, None] * np.diag(
        [0.0, 0.0, 1.0]
    )
    position = panda.forward(start)[:3, 3]
    driver = Controller(panda, panda.velocity_limits, np.full(7, 10.0))
    state = ControlState.at_rest(start)
    weights = CostWeights(FOLLOWING_WEIGHT)
    distances = []
    errors = []
    for shape in shapes:
        targets = arm_problem(panda, shape[None], position[None], weights=weights)
        problem = ControlProblem((targets,), start, 1e-2, 0.0, None, (0.05, 0.1))
        state = driver.step(problem, state, 0.01)
        distances.append(targets.distance(state.q[None])[0])
        errors.append(np.linalg.norm(panda.forward(state.q)[:3, 3] - position))
    assert distances[-1] > 1.0 > distances[0]
    assert max(errors) < 2e-3
