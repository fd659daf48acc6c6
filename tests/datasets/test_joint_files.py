"""Joint trajectories of maniport, and joint states of ROS 2 bags, are read as motions."""

import json

import numpy as np
import pytest
from test_humanoid_files import DEPTH, G1_JOINTS, motion_of

from maniport.arms import load_arm
from maniport.datasets import open_dataset, read_joints_csv, read_joints_npz, read_ros_bag
from maniport.datasets.unitree_csv import write_unitree_csv
from maniport.errors import FileFormatError, InvalidInputError
from maniport.motion.exports import export_motion
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.trajectory import Trajectory


@pytest.fixture(scope="module")
def trajectory():
    """A motion of the Panda at 100 Hz."""
    panda = load_arm("panda")
    time = np.arange(0.0, 1.005, 0.01)
    middle = 0.5 * (panda.lower + panda.upper)
    q = middle + 0.1 * np.sin(2.0 * time[:, None] + np.arange(7))
    return Trajectory.of_positions(panda, time, time, q, MotionLimits.of(panda))


def test_the_table_of_joints(trajectory, tmp_path):
    trajectory.save_joints_csv(tmp_path / "joints.csv")
    motion = read_joints_csv(tmp_path / "joints.csv")
    assert motion.columns == trajectory.joint_names
    assert set(motion.units) == {"rad"}
    np.testing.assert_allclose(motion.positions, trajectory.control_positions, atol=1e-9)
    np.testing.assert_allclose(motion.time, trajectory.control_time, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda text: text.replace("time_s", "t"), "time_s"),
        (lambda text: text.replace("_rad", "_deg"), "NAME_rad"),
        (lambda text: text[: len(text) // 2], "numbers|header|columns"),
        (lambda text: text.replace("0.010000,", "0.000000,", 1), "increase"),
        (lambda text: text.split("\n")[0], "2 frames|numbers|header"),
    ],
)
def test_faulty_tables(trajectory, tmp_path, change, word):
    trajectory.save_joints_csv(tmp_path / "joints.csv")
    text = change((tmp_path / "joints.csv").read_text())
    (tmp_path / "joints.csv").write_text(text)
    with pytest.raises(FileFormatError, match=word):
        read_joints_csv(tmp_path / "joints.csv")


def test_the_arrays_of_joints(trajectory, tmp_path):
    np.savez(tmp_path / "joints.npz", **trajectory.joint_arrays())
    motion = read_joints_npz(tmp_path / "joints.npz")
    assert motion.columns == trajectory.joint_names
    assert set(motion.units) == {"rad"}
    np.testing.assert_array_equal(motion.positions, trajectory.control_positions)
    np.savez(tmp_path / "less.npz", control_positions=np.zeros((3, 2)))
    with pytest.raises(FileFormatError, match="control_time"):
        read_joints_npz(tmp_path / "less.npz")


def test_a_bag_of_ros(trajectory, tmp_path):
    pytest.importorskip("mcap.writer")
    export_motion(tmp_path / "m.mcap", trajectory, "mcap", load_arm("panda"), start=1e9)
    motion = read_ros_bag(tmp_path / "m.mcap")
    assert motion.columns == trajectory.joint_names
    assert set(motion.units) == {"rad"}
    np.testing.assert_allclose(motion.positions, trajectory.control_positions, atol=1e-8)
    np.testing.assert_allclose(motion.time, trajectory.control_time, atol=1e-9)
    with pytest.raises(FileFormatError, match="other"):
        read_ros_bag(tmp_path / "m.mcap", "/other")
    content = (tmp_path / "m.mcap").read_bytes()
    for share in (0.0, 0.02, 0.5):
        (tmp_path / "cut.mcap").write_bytes(content[: int(share * len(content))])
        with pytest.raises(FileFormatError):
            read_ros_bag(tmp_path / "cut.mcap")


def write_bag(path, messages):
    """Write JSON joint states of topics, as an earlier version of maniport did."""
    writer_module = pytest.importorskip("mcap.writer")
    with open(path, "wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start()
        schema = writer.register_schema("JointState", "jsonschema", b"{}")
        channels = {}
        for number, (topic, names, positions) in enumerate(messages):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", schema)
            stamp = {"sec": number, "nsec": 5}
            text = json.dumps({"timestamp": stamp, "name": names, "position": positions})
            writer.add_message(channels[topic], number, text.encode(), number)
        writer.finish()


def test_topics_and_joints_of_a_bag(tmp_path):
    both = [(topic, ["a", "b"], [0.1 * i, 0.2]) for i in range(4) for topic in ("/left", "/right")]
    write_bag(tmp_path / "two.mcap", both)
    with pytest.raises(InvalidInputError, match="/left"):
        read_ros_bag(tmp_path / "two.mcap")
    motion = read_ros_bag(tmp_path / "two.mcap", "/right")
    assert motion.columns == ("a", "b")
    np.testing.assert_allclose(motion.time, [0, 2, 4, 6])
    changing = [("/s", ["a", "b"], [0.1, 0.2]), ("/s", ["b", "a"], [0.1, 0.2])]
    write_bag(tmp_path / "changing.mcap", changing)
    with pytest.raises(FileFormatError, match="same joints"):
        read_ros_bag(tmp_path / "changing.mcap")
    write_bag(tmp_path / "empty.mcap", [])
    with pytest.raises(FileFormatError, match="JointState"):
        read_ros_bag(tmp_path / "empty.mcap")


def test_datasets_of_files(trajectory, tmp_path):
    folder = tmp_path / "clips"
    folder.mkdir()
    for name in ("b.csv", "a.csv"):
        write_unitree_csv(folder / name, motion_of(G1_JOINTS))
    source = open_dataset(folder)
    motions = list(source.motions())
    assert source.count == 2
    assert [number for number, _ in motions] == [0, 1]
    assert motions[0][1].name.endswith("a.csv")
    assert motions[0][1].columns == G1_JOINTS

    trajectory.save_joints_csv(tmp_path / "joints.csv")
    assert open_dataset(tmp_path / "joints.csv").kind == "joints of maniport"
    write_unitree_csv(tmp_path / "short.csv", motion_of(DEPTH))
    with pytest.raises(InvalidInputError, match="13 columns"):
        open_dataset(tmp_path / "short.csv")
    for wrong in (tmp_path / "nothing", tmp_path / "file.txt"):
        with pytest.raises(FileFormatError):
            open_dataset(wrong)
    (tmp_path / "none").mkdir()
    with pytest.raises(FileFormatError, match="holds neither"):
        open_dataset(tmp_path / "none")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(FileFormatError, match="joint_pos"):
        open_dataset(tmp_path / "other.npz")
