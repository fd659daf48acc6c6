"""The node of `ros2_node.py` with a simulated robot and person, connected by ROS 2 messages.

MuJoCo simulates masses, servos and torque limits of the robot at 1 kHz. A recording is sent as markers.

    python ros2_simulation.py [RECORDING] [ROBOT]
"""

import math
import sys
import time

import numpy as np
import rclpy
from mocap4r2_msgs.msg import Marker, Markers
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray

import maniport as mp
from maniport.live.simulation import SimulatedRobot
from ros2_node import COMMANDS, Follow, run

PERIOD = 0.005  # of joint states [s]


class Simulation(Node):
    """Robot at the start configuration, and person."""

    def __init__(self, recording, node):
        super().__init__("simulation")
        self.node, self.frames, self.sent = node, recording.select(node.live.points), 0
        self.plant, self.command = (
            SimulatedRobot(node.live.robot, node.live.joint_positions),
            node.live.joint_positions,
        )
        self.errors, self.lag, self.time, self.begin = (
            [],
            0.0,
            time.monotonic(),
            time.monotonic() + 1.0,
        )
        self.states = self.create_publisher(JointState, "/joint_states", 1)
        self.markers = self.create_publisher(Markers, "/markers", 1)
        self.engage = self.create_publisher(Bool, "/maniport/engage", 1)
        self.create_subscription(Float64MultiArray, COMMANDS, self.on_command, 1)
        self.create_timer(PERIOD, self.on_timer)

    def on_command(self, message):
        """Take joint positions."""
        self.command = np.array(message.data)

    def on_timer(self):
        """Simulate until now, measure errors, send joint states and the newest frame."""
        arm, steps = self.node.live.robot, int((time.monotonic() - self.time) / 1e-3)
        self.plant.move(self.command, np.zeros(arm.dof), 1e-3 * steps)
        self.time += 1e-3 * steps
        self.states.publish(JointState(name=list(arm.joint_names), position=self.plant.q.tolist()))
        if (state := self.node.state) is not None and state.state in ("following", "lagging"):
            self.errors.append(
                math.dist(arm.forward(self.plant.q)[:3, 3], state.arm.target_position)
            )
            self.lag = max(self.lag, float(np.abs(self.plant.q - self.command).max()))
        due = int(
            np.searchsorted(
                self.frames.time - self.frames.time[0], self.time - self.begin, side="right"
            )
        )
        if due > self.sent:
            self.sent, message = (
                due,
                Markers(markers=[Marker(marker_name=name) for name in self.node.live.points]),
            )
            stamp = message.header.stamp
            stamp.sec, stamp.nanosec = divmod(int(1e9 * self.frames.time[due - 1]), 10**9)
            for marker, point in zip(
                message.markers, self.frames.positions[due - 1].tolist(), strict=True
            ):
                marker.translation.x, marker.translation.y, marker.translation.z = point
            self.markers.publish(message)
        if (state := self.node.state) is not None and state.state == "waiting":
            self.engage.publish(Bool(data=True))
        if due == len(self.frames.time):
            self.node.stop.set_result(None)


def main(recording="ladder", robot="panda"):
    """Calibrate with a recording, and send it once."""
    recording = mp.read_recording(recording)
    live = mp.Live.of(mp.transfer_recording(recording, robot=robot, real_time=True))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    simulation = Simulation(recording, node := Follow(live))
    rclpy.get_global_executor().add_node(simulation)
    run(node)
    median, rare, largest = 1e3 * np.quantile(simulation.errors, [0.5, 0.95, 1.0])
    print(
        f"Position error {median:.0f} mm (median), {rare:.0f} mm (95th percentile), {largest:.0f} mm (max)"
    )
    print(
        f"Servo lag {simulation.lag:.3f} rad, torque {100 * simulation.plant.largest_share:.0f} %"
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
