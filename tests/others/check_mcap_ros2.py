"""Bags of maniport read by mcap-ros2-support, besides rosbags: ``python -m pytest tests/others/check_mcap_ros2.py``."""

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from maniport.arms import load_arm
from maniport.motion import ArmMotion
from maniport.motion.exports import export_motion


def test_bag(tmp_path):
    arm = load_arm("panda")
    time = np.linspace(0.0, 1.0, 101)
    q = 0.5 * (arm.lower + arm.upper) + 0.1 * np.sin(time)[:, None]
    path = arm.forward(q)[:, :3, 3]
    motion = ArmMotion.of_motion(arm, time, arm.manipulability(q), time, q, path=path)
    export_motion(tmp_path / "motion.mcap", motion, "mcap", arm, start=1.75e9)

    found: dict[str, list[tuple[int, object]]] = {}
    with open(tmp_path / "motion.mcap", "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    states = found["/joint_states"]
    markers = found["/manipulability"]
    assert len(states) == len(markers) == 101
    assert states[0][0] == 1_750_000_000 * 10**9
    assert tuple(states[0][1].name) == arm.joint_names
    np.testing.assert_allclose([state.position for _, state in states], q, atol=1e-8)
    place = markers[50][1].markers[0].pose.position
    np.testing.assert_allclose([place.x, place.y, place.z], path[50], atol=1e-6)
