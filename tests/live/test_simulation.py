"""A simulated robot executes live commands: with its masses, or exactly where it has none."""

import os
import signal
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import maniport as mp
from maniport import cli
from maniport.errors import MissingPackageError
from maniport.live.simulation import SimulatedRobot, Simulation
from maniport.motion import robot_model


def without_masses(arm):
    return type(arm)(replace(arm.chain, inertia=None))


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_the_inertia_is_that_of_the_robot(name):
    pin = pytest.importorskip("pinocchio")
    arm = mp.load_arm(name)
    rng = np.random.default_rng(0)
    q = arm.sample(1, 0)[0]
    robot = SimulatedRobot(arm, q)
    model = robot_model(arm)
    robot._data.qvel[:] = velocity = rng.normal(size=arm.dof)
    robot._data.qfrc_applied[:] = torque = rng.normal(size=arm.dof)
    robot._mujoco.mj_forward(robot._model, robot._data)
    assert_allclose(
        robot._data.qacc,
        pin.aba(model, model.createData(), q, velocity, torque),
        rtol=1e-3,
        atol=1e-3,
    )


def test_commands_are_followed_within_the_torque_limits():
    """A smooth motion is followed to 1 mrad; a motion that the motors cannot make is not."""
    arm = mp.load_arm("panda")
    start = 0.5 * (arm.lower + arm.upper)
    change = np.array([0.3, -0.2, 0.1, 0.2, 0.3, 0.1, 0.2])
    for frequency, close in ((0.5, True), (8.0, False)):
        robot = SimulatedRobot(arm, start)
        for t in 0.01 * np.arange(1, 101):
            phase = 2.0 * np.pi * frequency * t
            q = start + change * (1.0 - np.cos(phase))
            robot.move(q, change * np.sin(phase) * 2.0 * np.pi * frequency, 0.01)
        assert (np.abs(robot.q - q).max() < 1e-3) == close
        assert robot.largest_share <= 1.0


def test_a_robot_without_masses_is_where_it_is_commanded():
    arm = without_masses(mp.load_arm("panda"))
    robot = SimulatedRobot(arm, arm.sample(1, 0)[0])
    q = arm.sample(1, 1)[0]
    robot.move(q, np.zeros(7), 0.01)
    assert (robot.q == q).all()
    assert not robot.dynamic


def test_unknown_torque_limits_are_named(small_result):
    simulation = Simulation(mp.Live.of(small_result, clock=None))
    assert "torque at most 0 %" in str(simulation)
    arm = small_result.arm.robot
    simulation.robot = SimulatedRobot(
        type(arm)(replace(arm.chain, effort_limits=None)), arm.sample(1, 0)[0]
    )
    assert "torque without limits" in str(simulation)


def test_two_arms_are_simulated_together(two_arm_result):
    simulation = Simulation(mp.Live.of(two_arm_result, clock=None, auto_engage=True))
    names = simulation._live.points
    frames = np.random.default_rng(0).normal(size=(len(names), 3)) + np.zeros((30, 1, 1))
    states = [simulation.step(points, 0.02 * i) for i, points in enumerate(frames)]
    for arm, pose in zip(
        states[-1].arms, two_arm_result.robot.forward(simulation.robot.q), strict=True
    ):
        assert_allclose(arm.position, pose[:3, 3])
    assert simulation.lag < 0.05


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(MissingPackageError, match=r"\.\[simulate\]"):
        SimulatedRobot(mp.load_arm("panda"), np.zeros(7))


@pytest.mark.slow
def test_a_recording_is_played_to_the_simulated_robot(small_result, second, monkeypatch, capfd):
    """As the library does it, and by the command, which prints the errors and ends without the extra for the view."""
    simulation = Simulation(mp.Live.of(small_result, clock=None, auto_engage=True))
    frames = second.select(mp.Live.of(small_result, clock=None).points)
    states = [
        simulation.step(points, t) for points, t in zip(frames.positions, frames.time, strict=True)
    ]
    arm = small_result.arm.robot
    last = states[-1]
    assert_allclose(last.arm.position, arm.forward(last.joint_positions)[:3, 3])
    assert_allclose(
        last.position_error, np.linalg.norm(last.arm.position - last.arm.target_position)
    )
    assert 0.0 < simulation.lag < 0.05
    monkeypatch.setattr("maniport.pipeline.transfer_recording", lambda *_, **__: small_result)
    monkeypatch.setattr("maniport.cli.live.find_spec", lambda name: None)
    calls = (["--simulate"], 0), (["--simulate", "--quiet"], 0), (["--simulate", "--udp", "0"], 2)
    for words, code in calls:
        monkeypatch.setattr("sys.argv", ["maniport", "live", "ladder", *words])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        assert (stop.value.code or 0) == code
        out, err = capfd.readouterr()
        assert ("position error: median" in out) == (code == 0)
        assert ("options of the transport" in err) == (code == 2)


def test_the_view_shows_the_simulated_robot_until_ctrl_c(small_result, monkeypatch, capfd):
    states = []

    class Page:
        url = "http://page"

        def __init__(self, person, robot):
            assert (person.name, robot.name) == ("myoarm", "panda")

        def show(self, state):
            states.append(state)
            if len(states) == 5:
                os.kill(os.getpid(), signal.SIGINT)

        def stop(self):
            states.append(None)

    monkeypatch.setattr("maniport.pipeline.transfer_recording", lambda *_, **__: small_result)
    monkeypatch.setattr("maniport.viewer.server.Onlooker", Page)
    monkeypatch.setattr("sys.argv", ["maniport", "live", "ladder", "--simulate", "--quiet"])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert (stop.value.code or 0) == 0
    assert states[-1] is None
    assert 5 <= len(states) - 1 < 50
    assert "http://page" in capfd.readouterr()[0]
