"""The senders of devices: their frames become points, in recordings and on the socket of live control."""

import json
import socket
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import maniport as mp
from maniport.live.transport import read_frame


@pytest.fixture
def senders(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples" / "senders")
    import isaac_teleop
    import natnet
    import sending
    import xrobotoolkit

    modules = (sending, xrobotoolkit, isaac_teleop, natnet)
    yield modules
    for module in modules:
        sys.modules.pop(module.__name__)


def body(angle=0.0):
    """A person who stands and looks along −z, as OpenXR has it: x right, y up, z back; the right arm swings."""
    places = {
        "pelvis": (0, 1.0, 0),
        "spine1": (0, 1.1, 0),
        "spine2": (0, 1.2, 0),
        "spine3": (0, 1.3, 0),
        "neck": (0, 1.5, 0),
        "head": (0, 1.65, 0),
    }
    for side, x in (("left", -1.0), ("right", 1.0)):
        places[f"{side}_hip"] = (0.1 * x, 0.95, 0)
        places[f"{side}_knee"] = (0.1 * x, 0.5, 0)
        places[f"{side}_ankle"] = (0.1 * x, 0.1, 0)
        places[f"{side}_foot"] = (0.1 * x, 0.05, -0.15)
        places[f"{side}_collar"] = (0.08 * x, 1.45, 0)
        places[f"{side}_shoulder"] = (0.2 * x, 1.45, 0)
        swing = angle if side == "right" else 0.0
        elbow = np.array([0.2 * x, 1.45 - 0.3 * np.cos(swing), -0.3 * np.sin(swing)])
        places[f"{side}_elbow"] = elbow
        places[f"{side}_wrist"] = elbow + np.array([0, -0.05 * np.sin(swing), -0.25])
        places[f"{side}_hand"] = elbow + np.array([0, -0.06 * np.sin(swing), -0.33])
    return places


def poses(sending, angle=0.0, sign=1.0):
    """The frame of XRoboToolkit."""
    places = body(angle)
    return [[*np.array(places[name]) * [1, 1, sign], 0, 0, 0, 1] for name in sending.BODY_JOINTS]


def test_xrobotoolkit(senders):
    sending, xrobotoolkit, *_ = senders
    assert len(sending.BODY_JOINTS) == 24
    for sign in (1.0, -1.0):  # right-handed and left-handed axes
        points = xrobotoolkit.points_of(poses(sending, 0.5, sign))
        assert set(points) == set(sending.BODY_JOINTS)
        assert not sending.is_mirrored(points)
        np.testing.assert_allclose(points["right_wrist"], body(0.5)["right_wrist"])
    with pytest.raises(ValueError, match="24"):
        xrobotoolkit.points_of(poses(sending)[:-1])


class Joints:
    """The joints of IsaacTeleop, of which the left hand is not tracked."""

    def __init__(self, names):
        self.names = names

    def joints(self, number):
        x, y, z = body()[self.names[number]]
        position = SimpleNamespace(x=x, y=y, z=z)
        return SimpleNamespace(
            pose=SimpleNamespace(position=position), is_valid=self.names[number] != "left_hand"
        )


def test_isaac_teleop(senders):
    sending, _, isaac_teleop, _ = senders
    points = isaac_teleop.points_of(Joints(sending.BODY_JOINTS))
    assert points["left_hand"] is None
    np.testing.assert_allclose(points["right_elbow"], body()["right_elbow"])
    assert not sending.is_mirrored(points)


def test_natnet(senders):
    natnet = senders[3]
    descriptions = [
        SimpleNamespace(marker_set_name=b"all", marker_names_list=[b"1", b"2"]),
        SimpleNamespace(marker_set_name=b"Ann", marker_names_list=[b"Ann_RSHO", b"Ann_RELB"]),
    ]
    names = natnet.names_of(descriptions)
    assert names == {"Ann": ["Ann_RSHO", "Ann_RELB"]}
    sets = [
        SimpleNamespace(model_name=b"all", marker_pos_list=[[1, 1, 1], [2, 2, 2]]),
        SimpleNamespace(model_name=b"Ann", marker_pos_list=[[0.1, 1.4, 0.2], [0.0, 0.0, 0.0]]),
    ]
    assert natnet.points_of(sets, names) == {"RSHO": (0.1, 1.4, 0.2), "RELB": None}
    with pytest.raises(ValueError, match="Ann"):
        natnet.points_of(sets, {"Ann": ["RSHO"]})
    two = [*sets, SimpleNamespace(model_name="Bob", marker_pos_list=[[1.0, 2.0, 3.0]])]
    points = natnet.points_of(two, {**names, "Bob": ["RSHO"]})
    assert points["Bob_RSHO"] == (1.0, 2.0, 3.0)
    assert set(points) == {"Ann_RSHO", "Ann_RELB", "Bob_RSHO"}


def test_a_recording_of_a_sender_is_a_calibration(senders, tmp_path):
    sending, xrobotoolkit, *_ = senders
    frames = []
    for number in range(40):
        time = number / 30.0
        frames.append(
            (100.0 + time, xrobotoolkit.points_of(poses(sending, 0.8 * np.sin(2 * time))))
        )
    sending.record(frames, tmp_path / "me.npz", 1.0)
    recording = mp.read_recording(tmp_path / "me.npz", unit="m")
    assert len(recording) == 31
    assert recording.rate == pytest.approx(30.0)
    fit = mp.fit_arm(recording)
    assert fit.arm.side == "right"
    assert fit.segment_lengths["upper arm"] == pytest.approx(0.3, abs=0.01)


def test_frames_arrive_at_the_socket(senders):
    sending, xrobotoolkit, *_ = senders
    wanted = ["right_shoulder", "right_elbow", "right_wrist"]
    points = dict(xrobotoolkit.points_of(poses(sending)))
    points["right_elbow"] = None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        server.settimeout(30.0)

        def frames():
            yield 0.5, points

        def first_line():
            _, sender = server.recvfrom(65536)
            server.sendto(json.dumps({"points": wanted}).encode(), sender)

        thread = threading.Thread(target=first_line)
        thread.start()
        sending.send(frames(), port=server.getsockname()[1])
        thread.join(30.0)
        frame = read_frame(server.recv(65536), wanted)
    assert frame.t == 0.5
    assert np.isnan(frame.points[1]).all()
    np.testing.assert_allclose(frame.points[2], points["right_wrist"])
    assert frame.order.engage is None
    line = json.loads(sending.frame_line(0.5, points, wanted, engage=True))
    assert line["engage"] is True
