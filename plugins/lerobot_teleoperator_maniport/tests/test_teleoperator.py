"""The teleoperator against LeRobot's own classes, with a server of maniport."""

import json
import math
import socket
import sys
import time
from pathlib import Path

import pytest
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.teleoperators.utils import make_teleoperator_from_config
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

sys.path.insert(0, str(Path(__file__).parents[3] / "tests" / "live"))

from lerobot_teleoperator_maniport import ManiportTeleop, ManiportTeleopConfig
from toy import Toy, serving

from maniport.live.transport import Datagrams

JOINTS = {"lift": "lift", "turn": "shoulder_pan"}


def free_ports():
    """Two ports of this machine that nobody has."""
    links = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for link in links:
        link.bind(("127.0.0.1", 0))
    ports = [link.getsockname()[1] for link in links]
    for link in links:
        link.close()
    return ports


class TurningToy(Toy):
    """A toy whose second joint turns with the first one."""

    def step(self, points, time=None, joints=None):
        state = super().step(points, time, joints)
        self.joint_positions[1] = 0.5 * math.pi * self.joint_positions[0]
        return state


@pytest.fixture
def ports():
    return free_ports()


@pytest.fixture
def server(ports):
    transport = Datagrams(ports[0], send=ports[1])
    with serving(TurningToy(), transport):
        yield transport
    transport.close()


def config(ports, tmp_path, **options):
    udp, send = ports
    named = {"joints": JOINTS, "unit": "deg", "timeout": 5.0, "calibration_dir": tmp_path}
    return ManiportTeleopConfig(id="one", udp=udp, send=send, **{**named, **options})


def test_lerobot_makes_it_by_its_type(ports, tmp_path):
    assert TeleoperatorConfig.get_choice_class("maniport") is ManiportTeleopConfig
    made = make_teleoperator_from_config(config(ports, tmp_path))
    assert isinstance(made, ManiportTeleop)
    assert isinstance(made, Teleoperator)
    assert made.action_features == {"lift.pos": float, "shoulder_pan.pos": float}
    assert made.feedback_features == {}
    assert made.is_calibrated
    assert not made.is_connected
    with pytest.raises(DeviceNotConnectedError):
        made.get_action()
    with pytest.raises(DeviceNotConnectedError):
        made.disconnect()


def test_actions_are_the_joints_of_maniport(server, ports, tmp_path):
    teleop = ManiportTeleop(config(ports, tmp_path, fixed={"gripper.pos": 50.0}))
    with teleop:
        assert teleop.is_connected
        with pytest.raises(DeviceAlreadyConnectedError):
            teleop.connect()
        begin = teleop.get_action()
        assert begin == {"lift.pos": 0.0, "shoulder_pan.pos": 0.0, "gripper.pos": 50.0}
        assert begin.keys() == teleop.action_features.keys()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor:
            points = [[0, 0, 0], [0, 0, 0], [0.2, 0, 0]]
            frame = {"t": 0.0, "points": points}
            sensor.sendto(json.dumps(frame).encode(), ("127.0.0.1", ports[0]))
            action = begin
            end = time.monotonic() + 20.0
            while action["lift.pos"] < 0.2 and time.monotonic() < end:
                action = teleop.get_action()
        assert action["lift.pos"] >= 0.2  # meters stay
        assert action["shoulder_pan.pos"] == pytest.approx(90.0 * action["lift.pos"], abs=1e-6)
        assert teleop.send_feedback({}) is None
    assert not teleop.is_connected
    teleop.connect()  # again
    teleop.disconnect()


def test_radians(server, ports, tmp_path):
    teleop = ManiportTeleop(config(ports, tmp_path, unit="rad"))
    with teleop:
        assert set(teleop.get_action().values()) == {0.0}


def test_nobody_answers(ports, tmp_path):
    teleop = ManiportTeleop(config(ports, tmp_path, timeout=0.3))
    with pytest.raises(ConnectionError, match=str(ports[0])):
        teleop.connect()
    assert not teleop.is_connected
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", ports[1]))  # was closed
        with pytest.raises(ConnectionError, match=str(ports[1])):
            teleop.connect()


def test_other_joints(server, ports, tmp_path):
    teleop = ManiportTeleop(config(ports, tmp_path, joints={"lift": "lift"}))
    with pytest.raises(ValueError, match="turn"):
        teleop.connect()
    assert not teleop.is_connected


@pytest.mark.parametrize(
    "options",
    [
        {"unit": "normalized"},
        {"joints": {}},
        {"joints": {"lift": "a", "turn": "a"}},
        {"fixed": {"lift.pos": 1.0}},
        {"send": 9000, "udp": 9000},
        {"timeout": 0.0},
    ],
    ids=lambda options: next(iter(options)),
)
def test_wrong_options(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        ManiportTeleopConfig(**{"joints": JOINTS, "unit": "deg", **options})


def test_junk_is_no_answer(server, ports, tmp_path):
    teleop = ManiportTeleop(config(ports, tmp_path))
    with teleop, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b'{"joints": {"lift": 9.0, "turn": 9.0}}', ("127.0.0.1", ports[1]))
        time.sleep(0.05)
        assert set(teleop.get_action().values()) == {0.0}
