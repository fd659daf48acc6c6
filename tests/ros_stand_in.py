"""As much of ROS 2 as a page's node asks for: three messages come in, then none, and all is published within limits."""

import time
from types import SimpleNamespace

import numpy as np

FRAMES, PAUSE = 3, 0.03  # s


class Node:
    """Keeps what is subscribed, timed and published."""

    def __init__(self, name):
        self.callbacks, self.timers, self.sent = [], [], []

    def create_publisher(self, kind, topic, depth):
        """What publishes."""
        return SimpleNamespace(publish=self.sent.append)

    def create_subscription(self, kind, topic, callback, depth):
        """Call back for each message."""
        self.callbacks.append(callback)

    def create_timer(self, period, callback):
        """Call back again and again."""
        self.timers.append(callback)

    def get_clock(self):
        """A clock in nanoseconds."""
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=time.monotonic_ns()))

    def get_logger(self):
        """A log that nobody reads."""
        return SimpleNamespace(info=lambda text: None)


def spin(node):
    """Send markers, then let the timer run."""
    arm = node.live.robot
    for i in range(FRAMES):
        markers = [
            SimpleNamespace(marker_name=name, translation=SimpleNamespace(x=0.1 * k, y=0.01 * k * k, z=1.0 + 0.01 * i))
            for k, name in enumerate(node.live.points)
        ]
        node.callbacks[0](SimpleNamespace(markers=markers))
    time.sleep(PAUSE)
    node.timers[0]()
    sent = np.array([message.data for message in node.sent])
    assert sent.shape == (FRAMES + 1, arm.dof)
    assert np.all((sent >= arm.lower) & (sent <= arm.upper))


MODULES = {
    "rclpy": SimpleNamespace(init=lambda: None, spin=spin, shutdown=lambda: None),
    "rclpy.node": SimpleNamespace(Node=Node),
    "mocap4r2_msgs": SimpleNamespace(),
    "mocap4r2_msgs.msg": SimpleNamespace(Markers=object),
    "std_msgs": SimpleNamespace(),
    "std_msgs.msg": SimpleNamespace(Float64MultiArray=SimpleNamespace),
}
