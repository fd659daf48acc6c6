"""What controllers, players and simulators get is the motion, with time from 0."""

import sys
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from maniport.arms import Arm, load_arm
from maniport.errors import InvalidInputError, MissingPackageError, UnknownNameError
from maniport.motion import ArmMotion, ros_messages
from maniport.motion.exports import export_motion
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.time_parameterization import retime

NAMES = ("on", 'a "b": c', "wrist")
PLANAR = Arm.from_dh("planar", [[0, 0, 0.5, 0], [0, 0, 0.4, 0], [0, 0, 0.3, 0]], joint_names=NAMES)


@pytest.fixture(scope="module")
def motion():
    """A motion at 1000 Hz that begins at 2 s."""
    limits = MotionLimits.of(PLANAR)
    time = np.linspace(0.0, 1.0, 21)
    timed = retime(limits, time, 0.5 * np.sin(np.outer(time, [1.0, 2.0, 3.0])))
    q = timed.joint_positions
    return ArmMotion.of_motion(
        PLANAR,
        2.0 + timed.time,
        PLANAR.manipulability(q),
        2.0 + timed.control_time,
        timed.control_positions,
        path=PLANAR.forward(q)[:, :3, 3],
    )


def require_states(motion, seconds, states):
    """Hundred points a second from first to last, each of them a control step."""
    steps = motion.control_time - motion.control_time[0]
    rows = np.round(1000 * np.array(seconds)).astype(int)
    assert_allclose(seconds, steps[rows], atol=1e-9)
    assert rows[0] == 0
    assert rows[-1] == len(steps) - 1
    assert_array_equal(np.diff(rows)[:-1], 10)
    expected = motion.control_positions, motion.control_velocities, motion.control_accelerations
    for values, actual in zip(expected, states, strict=True):
        assert_allclose(actual, values[rows], atol=1e-5)


FIELDS = ("positions", "velocities", "accelerations")


def test_ros2_gets_a_joint_trajectory(motion, tmp_path):
    export_motion(tmp_path / "m.yaml", motion, "ros2")
    message = yaml.safe_load((tmp_path / "m.yaml").read_text())
    assert list(message) == ["header", "joint_names", "points"]
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert tuple(message["joint_names"]) == NAMES
    starts = [point["time_from_start"] for point in message["points"]]
    states = ([p[key] for p in message["points"]] for key in FIELDS)
    require_states(motion, [start["sec"] + 1e-9 * start["nanosec"] for start in starts], states)
    assert {tuple(point) for point in message["points"]} == {
        (*FIELDS, "time_from_start")
    }  # no effort
    assert not any(message["points"][-1]["velocities"])  # joint_trajectory_controller requires it


def read_bag(path):
    """Messages by topic with their times [ns], as rosbags reads them."""
    highlevel = pytest.importorskip("rosbags.highlevel")
    found = {}
    with highlevel.AnyReader([path]) as reader:
        for connection, time, content in reader.messages():
            message = reader.deserialize(content, connection.msgtype)
            found.setdefault(connection.topic, []).append((time, message))
    return found


def test_mcap_is_a_bag_of_joint_states(motion, tmp_path):
    mcap = pytest.importorskip("mcap.reader")
    export_motion(tmp_path / "m.mcap", motion, "mcap", start=1.75e9)
    with open(tmp_path / "m.mcap", "rb") as stream:
        reader = mcap.make_reader(stream)
        assert reader.get_header().profile == "ros2"
        ((schema, channel, _),) = list(reader.iter_messages())[:1]
    assert (schema.name, schema.encoding) == ("sensor_msgs/msg/JointState", "ros2msg")
    assert (channel.topic, channel.message_encoding) == ("/joint_states", "cdr")

    (messages,) = read_bag(tmp_path / "m.mcap").values()
    assert tuple(messages[0][1].name) == NAMES
    assert messages[0][0] == 1_750_000_000 * 10**9
    stamp = messages[-1][1].header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == messages[-1][0]
    seconds = [1e-9 * (time - messages[0][0]) for time, _ in messages]
    rows = np.round(1000 * np.array(seconds)).astype(int)
    expected = {"position": motion.control_positions, "velocity": motion.control_velocities}
    for name, states in expected.items():
        values = np.array([getattr(message, name) for _, message in messages])
        assert_allclose(values, states[rows], atol=1e-5)


def test_mcap_has_the_ellipsoids_and_the_description(motion, tmp_path):
    pytest.importorskip("mcap.writer")
    urdf = tmp_path / "planar.urdf"
    links = "".join(f'<link name="l{i}"/>' for i in range(4))
    joints = "".join(
        f'<joint name={quoteattr(name)} type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<axis xyz="0 0 1"/><origin xyz="{0.1 * i} 0 0"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>'
        for i, name in enumerate(NAMES)
    )
    urdf.write_text(f'<robot name="planar">{links}{joints}</robot>')
    robot = load_arm(urdf)
    export_motion(tmp_path / "m.mcap", motion, "mcap", robot)
    found = read_bag(tmp_path / "m.mcap")
    assert found["/robot_description"][0][1].data == urdf.read_text()
    assert len(found["/manipulability"]) == len(found["/joint_states"])
    for row in (0, -1):
        q = np.array(found["/joint_states"][row][1].position)
        (marker,) = found["/manipulability"][row][1].markers
        assert (marker.type, marker.header.frame_id) == (2, "l0")
        place = marker.pose.position
        assert_allclose([place.x, place.y, place.z], robot.forward(q)[:3, 3], atol=1e-6)
        turn = marker.pose.orientation
        rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
        axes = 0.5 * np.array([marker.scale.x, marker.scale.y, marker.scale.z]) / 0.2
        ellipsoid = rotation @ np.diag(axes**2) @ rotation.T
        assert_allclose(ellipsoid, robot.manipulability(q), atol=1e-5)


def test_definitions_of_messages_are_those_of_ros():
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for name, definition in (
        ("sensor_msgs/msg/JointState", ros_messages.JOINT_STATE),
        ("visualization_msgs/msg/MarkerArray", ros_messages.MARKERS),
        ("std_msgs/msg/String", ros_messages.STRING),
    ):
        text, _ = store.generate_msgdef(name, ros_version=2)
        assert definition.split() == text.split()


def test_parquet_has_columns_with_units(motion, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    export_motion(tmp_path / "m.parquet", motion, "parquet", PLANAR)
    table = parquet.read_table(tmp_path / "m.parquet")
    column = {name: table[name].to_numpy() for name in table.column_names}
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
    assert_array_equal(column["time"], motion.control_time - motion.control_time[0])
    for k, name in enumerate(NAMES):
        assert_array_equal(column[f"{name}_position"], motion.control_positions[:, k])
        assert_array_equal(column[f"{name}_acceleration"], motion.control_accelerations[:, k])
        assert units[f"{name}_velocity"] == "rad/s"
    tips = np.stack([column[f"end_effector_{axis}"] for axis in "xyz"], axis=1)
    assert_array_equal(tips, PLANAR.forward(motion.control_positions)[:, :3, 3])


def test_mujoco_makes_the_same_motion(motion, tmp_path):
    export_motion(tmp_path / "m.npz", motion, "mujoco")
    with np.load(tmp_path / "m.npz") as arrays:
        qpos = arrays["qpos"]
        qvel = arrays["qvel"]
        step = float(arrays["timestep"])
        assert tuple(arrays["joint_names"]) == NAMES
    assert step == pytest.approx(1e-3)
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><body><joint axis="0 0 1"/><geom size=".01"/>
      <body pos=".5 0 0"><joint axis="0 0 1"/><geom size=".01"/>
      <body pos=".4 0 0"><joint axis="0 0 1"/><geom size=".01"/><site name="tip" pos=".3 0 0"/></body></body></body>
      </worldbody></mujoco>""")
    model.opt.timestep = step
    data = mujoco.MjData(model)
    tips = np.empty((len(qpos), 3))
    for row, data.qpos[:] in enumerate(qpos):
        mujoco.mj_kinematics(model, data)
        tips[row] = data.site("tip").xpos
    passed = np.round((motion.time - motion.control_time[0]) / step).astype(int)
    assert_allclose(tips[passed], motion.path, atol=2e-3)  # at most half a step away
    assert_allclose(
        np.diff(qpos, axis=0)[1:] + np.diff(qpos, axis=0)[:-1], 2 * step * qvel[1:-1], atol=1e-9
    )


@pytest.mark.parametrize(
    ("file", "format", "robot", "error", "word"),
    [
        ("m.yaml", "ros", None, UnknownNameError, "'ros2'"),
        ("m.yaml", "mujoco", None, InvalidInputError, "path"),
        ("m.parquet", "parquet", "planar", InvalidInputError, "robot"),
        ("m.rrd", "rerun", None, InvalidInputError, "write_results"),
        ("m.mcap", "mcap", None, MissingPackageError, "mcap"),
    ],
)
def test_impossible_exports_are_errors(
    motion, tmp_path, monkeypatch, file, format, robot, error, word
):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(error, match=word):
        export_motion(tmp_path / file, motion, format, robot)
    with pytest.raises(InvalidInputError, match="NoneType"):
        export_motion(tmp_path / "m.yaml", None, "ros2")
    assert not list(tmp_path.iterdir())
