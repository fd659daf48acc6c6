"""Stand-in for the parts of ROS 2 that `examples/ros2_node.py` and `ros2_simulation.py` use, in one process.

A message that is published reaches subscriptions at once; timers run at their periods of simulated time.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock

NODES = []


class Clock:
    """Simulated time, in place of the module `time`."""

    now = 1000.0

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


TIME = Clock()


class Node:
    def __init__(self, name):
        self.name = name
        self.callbacks = {}
        self.timers = []
        self.log = MagicMock()
        self.get_logger = lambda: self.log
        NODES.append(self)

    def create_publisher(self, kind, topic, depth):
        return SimpleNamespace(publish=lambda message: publish(kind, topic, message))

    def create_subscription(self, kind, topic, callback, depth):
        self.callbacks[kind, topic] = callback

    def create_timer(self, period, callback):
        self.timers.append([TIME.now, period, callback])


def publish(kind, topic, message):
    """Give a message to the nodes that subscribe to its topic by its type."""
    assert type(message) is kind
    for callback in [
        node.callbacks[kind, topic] for node in NODES if (kind, topic) in node.callbacks
    ]:
        callback(message)


class Future:
    def __init__(self):
        self.results = []
        self.set_result, self.done = self.results.append, lambda: bool(self.results)


def spin(node, future):
    """Run the timers of all nodes until the future is done."""
    while not future.done():
        for timer in [timer for own in NODES for timer in own.timers]:
            if timer[0] <= TIME.now:
                timer[0] += timer[1]
                timer[2]()
        TIME.sleep(1e-3)


def message(name, /, **defaults):
    """Make the type of a message."""

    def fill(self, /, **fields):
        assert fields.keys() <= defaults.keys()
        vars(self).update({key: make() for key, make in defaults.items()} | fields)

    return type(name, (), {"__init__": fill})


def point():
    return SimpleNamespace(x=0.0, y=0.0, z=0.0)


def header():
    return SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0))


MESSAGES = {
    "mocap4r2_msgs": [
        message("Marker", marker_name=str, translation=point),
        message("Markers", header=header, markers=list),
    ],
    "sensor_msgs": [message("JointState", name=list, position=list)],
    "std_msgs": [message("Float64MultiArray", data=list), message("Bool", data=bool)],
}
MODULES = {
    "rclpy": SimpleNamespace(
        init=lambda **_: None,
        Future=Future,
        spin_until_future_complete=spin,
        get_global_executor=MagicMock(),
    ),
    "rclpy.node": SimpleNamespace(Node=Node),
    "rclpy.qos": MagicMock(),
    "rclpy.signals": MagicMock(),
    **{name: SimpleNamespace() for name in MESSAGES},
    **{
        f"{name}.msg": SimpleNamespace(**{kind.__name__: kind for kind in kinds})
        for name, kinds in MESSAGES.items()
    },
}
