"""A ROS 2 node for live control: markers of a person in, joint positions of a robot out.

It publishes to a `forward_command_controller`. The robot follows after `true` on `/maniport/engage`, and brakes after
`false`, at Ctrl-C, and without markers; then it awaits `true` again. Hidden markers are absent from messages, or nan.

    python ros2_node.py RECORDING [ROBOT]
"""

import signal
import sys
import time

import rclpy
from mocap4r2_msgs.msg import Markers
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray

import maniport as mp

COMMANDS = "/forward_position_controller/commands"
PERIOD = 0.01  # of commands between markers [s]


class Follow(Node):
    """Lets a robot follow a person."""

    def __init__(self, live):
        super().__init__("maniport_live")
        self.live = live
        self.joints = None  # measured
        self.state = None
        self.stop = rclpy.Future()
        self.publisher = self.create_publisher(Float64MultiArray, COMMANDS, 1)
        self.create_subscription(
            JointState, "/joint_states", self.on_joints, qos_profile_sensor_data
        )
        self.create_subscription(Bool, "/maniport/engage", self.on_engage, 1)
        self.create_subscription(Markers, "/markers", self.on_markers, qos_profile_sensor_data)
        self.create_timer(PERIOD, self.move)

    def on_joints(self, message):
        """Keep the measured configuration of the robot for the next step."""
        positions = dict(zip(message.name, message.position, strict=True))
        names = self.live.robot.joint_names
        if set(names) <= positions.keys():
            self.joints = {name: positions[name] for name in names}
        else:
            self.get_logger().error(
                f"/joint_states must contain {names}; found {list(positions)}",
                throttle_duration_sec=5.0,
            )

    def on_engage(self, message):
        """Let the robot follow, or brake."""
        if message.data:
            self.live.engage()
        else:
            self.live.hold()

    def on_markers(self, message):
        """Follow new markers."""
        positions = {m.marker_name: m.translation for m in message.markers}
        stamp = message.header.stamp
        points = {
            name: (p.x, p.y, p.z) for name, p in positions.items() if name in self.live.points
        }
        self.move(points, stamp.sec + 1e-9 * stamp.nanosec)

    def move(self, points=None, stamp=None):
        """Send joint positions, once the robot's configuration is known."""
        joints = self.joints
        self.joints = None
        if self.state is None and joints is None:
            return
        try:
            self.state = self.live.step(points, stamp, joints=joints)
            self.publisher.publish(Float64MultiArray(data=self.state.joint_positions.tolist()))
        except ValueError as error:  # wrong points or joints; the timer goes on
            self.get_logger().error(str(error), throttle_duration_sec=1.0)


def run(node):
    """Spin until Ctrl-C or `node.stop`, then brake."""
    signal.signal(signal.SIGINT, lambda *_: node.stop.set_result(None))
    rclpy.spin_until_future_complete(node, node.stop)
    node.live.hold()
    while node.state is not None and node.state.joint_velocities.any():
        time.sleep(PERIOD)
        node.move()


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    result = mp.transfer_recording(
        sys.argv[1], robot=sys.argv[2] if sys.argv[2:] else "panda", real_time=True
    )
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # commands can be sent after Ctrl-C
    run(Follow(mp.Live.of(result)))
