"""The ROS 2 examples without ROS: `ros_stand_in` has its classes, and MuJoCo is the robot."""

import signal
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

import maniport as mp
import ros_stand_in
from ros_stand_in import TIME, publish

COMMANDS = "/forward_position_controller/commands"
MARKERS = "/markers"
STATES = "/joint_states"


@pytest.fixture
def examples(monkeypatch):
    """Import both examples, with simulated time; keep the handler of Ctrl-C."""
    ros_stand_in.NODES.clear()
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples")
    handler = signal.getsignal(signal.SIGINT)
    with patch.dict(sys.modules, ros_stand_in.MODULES):
        import ros2_node
        import ros2_simulation

        for module in (ros2_node, ros2_simulation):
            monkeypatch.setattr(module, "time", TIME)
        yield ros2_node, ros2_simulation
    signal.signal(signal.SIGINT, handler)


@pytest.fixture
def node(examples, small_result):
    """Return the node, the commands that it sent, and a function that sends messages to it."""
    node = examples[0].Follow(mp.Live.of(small_result, clock=TIME.monotonic))
    sent = []
    array, joints = (ros_stand_in.MESSAGES[name][0] for name in ("std_msgs", "sensor_msgs"))
    marker, markers = ros_stand_in.MESSAGES["mocap4r2_msgs"]
    ros_stand_in.Node("controller").create_subscription(
        array, COMMANDS, lambda message: sent.append(message.data), 1
    )

    def send(points=None, time=0.0, **q):
        if points is None:
            return publish(joints, STATES, joints(name=[*q], position=[*q.values()]))
        message = markers(markers=[marker(marker_name=name) for name in points])
        message.header.stamp.sec = int(time)
        message.header.stamp.nanosec = round(1e9 * (time % 1.0))
        for item, xyz in zip(message.markers, points.values(), strict=True):
            item.translation.x, item.translation.y, item.translation.z = xyz
        return publish(markers, MARKERS, message)

    return node, sent, send


def test_a_simulated_robot_follows_markers(examples, small_result, second, monkeypatch, capsys):
    """The joints stay within limits and near the commands; the robot rests in the end."""
    monkeypatch.setattr(mp, "read_recording", lambda _: second)
    monkeypatch.setattr(mp, "transfer_recording", lambda *_, **__: small_result)
    live = mp.Live.of(small_result, clock=TIME.monotonic)
    monkeypatch.setattr(mp.Live, "of", lambda _: live)
    examples[1].main()
    node, simulation = ros_stand_in.NODES
    arm = node.live.robot
    command = simulation.command
    assert ((command >= arm.lower) & (command <= arm.upper)).all()
    assert not node.state.joint_velocities.any()
    assert simulation.sent == len(second.time)
    assert len(simulation.errors) > 50
    assert simulation.lag < 0.2
    assert "Position error" in capsys.readouterr().out


def test_nothing_is_sent_before_the_robot_is_known(node, second):
    """The first command is where the robot is; it moves after a message to engage, and brakes after another."""
    node, sent, send = node
    names = node.live.robot.joint_names
    measured = node.live.joint_positions + 0.06 * np.array([1, -1, -1, 1, 1, 1, 1])
    joints = dict(zip(names, measured.tolist(), strict=True))
    points = dict(
        zip(node.live.points, second.select(node.live.points).positions[0].tolist(), strict=True)
    )
    for known in ({}, dict(list(joints.items())[1:])):
        send(**known)
        send(points)
        TIME.sleep(0.01)
        node.move()
        assert sent == []
    assert "panda_joint1" in node.log.error.call_args.args[0]
    send(**dict(reversed(joints.items())), finger=0.04)
    for i in range(10):
        TIME.sleep(0.01)
        send(points, 1.0 + 0.01 * i)
    np.testing.assert_allclose(sent, [measured] * 10)
    engage = ros_stand_in.MESSAGES["std_msgs"][1]
    publish(engage, "/maniport/engage", engage(data=True))
    TIME.sleep(0.01)
    send(points, 2.0)
    assert node.state.state == "approaching"
    publish(engage, "/maniport/engage", engage(data=False))
    TIME.sleep(0.01)
    send(points, 2.01)
    assert node.state.state == "waiting"


def test_wrong_markers_and_times_do_not_stop_the_node(node, second):
    node, sent, send = node
    send(**dict(zip(node.live.robot.joint_names, node.live.joint_positions.tolist(), strict=True)))
    frames = second.select(node.live.points)
    rows = [
        dict(zip(node.live.points, points.tolist(), strict=True)) for points in frames.positions
    ]
    first = rows[0]
    wrong = {node.live.points[0]: (np.inf, 0.0, 0.0)}
    for points, time, refused in (
        (first, 1.0, False),
        (wrong, 1.1, True),
        (first, 1.0, True),
        (first, 0.5, True),
        ({}, 1.1, False),
        ({"a lamp": (0.0, 0.0, 0.0), **rows[1]}, 1.2, False),
        ({**first, node.live.points[0]: (np.nan,) * 3}, 1.3, False),
    ):
        count = len(sent)
        node.log.error.called = False
        send(points, time)
        assert (len(sent) == count, node.log.error.called) == (refused, refused)
        TIME.sleep(0.01)
        node.move()
    for i, points in enumerate(rows[1:6]):
        TIME.sleep(0.03)
        send(points, 2.0 + 0.03 * i)
    assert node.state.state == "waiting"
    assert np.isfinite(sent).all()


def test_without_markers_the_robot_brakes(node, second):
    node, sent, send = node
    send(**dict(zip(node.live.robot.joint_names, node.live.joint_positions.tolist(), strict=True)))
    node.live.engage()
    for t, points in zip(second.time[:10], second.select(node.live.points).positions, strict=False):
        TIME.sleep(0.03)
        send(dict(zip(node.live.points, points.tolist(), strict=True)), t)
    while node.state.state != "holding" or node.state.joint_velocities.any():
        TIME.sleep(0.01)
        node.move()
    assert len(sent) > 10
