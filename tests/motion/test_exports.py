"""What controllers, players and simulators get is the motion, with time from 0."""

import json
import sys

import mujoco
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

from maniport.arms import Arm
from maniport.errors import InvalidInputError, MissingPackageError, UnknownNameError
from maniport.motion import ArmMotion
from maniport.motion.exports import export_motion
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.time_parameterization import retime

NAMES = ("on", 'a "b": c', "wrist")
PLANAR = Arm.from_dh("planar", [[0, 0, 0.5, 0], [0, 0, 0.4, 0], [0, 0, 0.3, 0]], joint_names=NAMES)


@pytest.fixture(scope="module")
def motion():
    """A motion at 1000 Hz that begins at 2 s."""
    limits, time = MotionLimits.of(PLANAR), np.linspace(0.0, 1.0, 21)
    timed = retime(limits, time, 0.5 * np.sin(np.outer(time, [1.0, 2.0, 3.0])))
    q = timed.joint_positions
    return ArmMotion.of_motion(
        PLANAR, 2.0 + timed.time, PLANAR.manipulability(q), 2.0 + timed.control_time, timed.control_positions,
        path=PLANAR.forward(q)[:, :3, 3],
    )  # fmt: skip


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


def test_mcap_gets_messages(motion, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    export_motion(tmp_path / "m.mcap", motion, "mcap")
    with open(tmp_path / "m.mcap", "rb") as stream:
        actual = list(reader.make_reader(stream).iter_messages())
    assert {(schema.encoding, channel.topic) for schema, channel, _ in actual} == {
        ("jsonschema", "/joint_states")
    }
    texts = [json.loads(message.data) for _, _, message in actual]
    assert tuple(texts[0]["name"]) == NAMES
    states = ([text[key] for text in texts] for key in ("position", "velocity", "acceleration"))
    require_states(motion, [1e-9 * message.log_time for _, _, message in actual], states)


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
        qpos, qvel, step = arrays["qpos"], arrays["qvel"], float(arrays["timestep"])
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


@pytest.mark.parametrize(("file", "format", "robot", "error", "word"), [
    ("m.yaml", "ros", None, UnknownNameError, "'ros2'"), ("m.yaml", "mujoco", None, InvalidInputError, "path"),
    ("m.parquet", "parquet", "planar", InvalidInputError, "robot"),
    ("m.rrd", "rerun", None, InvalidInputError, "write_results"), ("m.mcap", "mcap", None, MissingPackageError, "mcap"),
])  # fmt: skip
def test_impossible_exports_are_errors(
    motion, tmp_path, monkeypatch, file, format, robot, error, word
):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(error, match=word):
        export_motion(tmp_path / file, motion, format, robot)
    with pytest.raises(InvalidInputError, match="NoneType"):
        export_motion(tmp_path / "m.yaml", None, "ros2")
    assert not list(tmp_path.iterdir())
