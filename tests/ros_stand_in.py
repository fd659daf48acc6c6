"""Stand-in for the parts of ROS 2 that the node of docs/live.md uses: three messages arrive, then none."""

import time
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np


class Node:
    def __init__(self, name):
        self.callbacks, self.timers, self.sent = [], [], []
        self.create_publisher = lambda *_: SimpleNamespace(publish=self.sent.append)
        self.create_subscription = lambda kind, topic, callback, depth: self.callbacks.append(callback)
        self.create_timer = lambda period, callback: self.timers.append(callback)
        self.get_clock = lambda: SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=time.monotonic_ns()))
        self.get_logger = MagicMock()


def spin(node, frames=3):
    arm = node.live.robot
    for i in range(frames):
        markers = [
            SimpleNamespace(marker_name=name, translation=SimpleNamespace(x=0.1 * k, y=0.01 * k * k, z=1.0 + 0.01 * i))
            for k, name in enumerate(node.live.points)
        ]
        node.callbacks[0](SimpleNamespace(markers=markers))
    time.sleep(0.03)
    node.timers[0]()
    sent = np.array([message.data for message in node.sent])
    assert sent.shape == (frames + 1, arm.dof)
    assert np.all((sent >= arm.lower) & (sent <= arm.upper))


MODULES = {
    "rclpy": SimpleNamespace(init=lambda: None, spin=spin, shutdown=lambda: None),
    "rclpy.node": SimpleNamespace(Node=Node), "mocap4r2_msgs": SimpleNamespace(),
    "mocap4r2_msgs.msg": SimpleNamespace(Markers=object), "std_msgs": SimpleNamespace(),
    "std_msgs.msg": SimpleNamespace(Float64MultiArray=SimpleNamespace),
}  # fmt: skip
