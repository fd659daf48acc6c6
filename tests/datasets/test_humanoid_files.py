"""Motions of humanoids in the files of Unitree, GMR, BeyondMimic and mjlab, read and written."""

import contextlib
import pickle
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniport.datasets import (
    G1_JOINTS,
    JointMotion,
    read_gmr_pickle,
    read_mjlab_npz,
    read_unitree_csv,
    write_gmr_pickle,
    write_mjlab_npz,
    write_unitree_csv,
)
from maniport.datasets.gmr_pickle import read_pickle
from maniport.errors import FileFormatError, InvalidInputError

HUMANOID = """<mujoco model="small"><compiler angle="radian"/><worldbody>
  <body name="pelvis" pos="0 0 0.8"><freejoint/><geom size="0.1"/>
    <body name="l_hip" pos="0 0.1 0"><joint name="l_hip" axis="0 1 0" range="-2 2"/><geom size="0.05"/>
      <body name="l_knee" pos="0 0 -0.3"><joint name="l_knee" axis="0 1 0" range="-2 2"/><geom size="0.05"/>
        <body name="l_foot" pos="0.05 0 -0.3"><geom size="0.02"/></body></body></body>
    <body name="r_hip" pos="0 -0.1 0"><joint name="r_hip" axis="0 1 0" range="-2 2"/><geom size="0.05"/>
      <body name="r_knee" pos="0 0 -0.3"><joint name="r_knee" axis="0 1 0" range="-2 2"/><geom size="0.05"/>
      </body></body>
    <body name="arm" pos="0 0 0.4"><joint name="arm" axis="1 0 0" range="-3 3"/><geom size="0.05"/>
      <body name="hand" pos="0 0 0.3"><joint name="hand" axis="0 0 1" range="-3 3"/><geom size="0.05"/></body></body>
  </body></worldbody></mujoco>"""
DEPTH = ("l_hip", "l_knee", "r_hip", "r_knee", "arm", "hand")
BREADTH = ("l_hip", "r_hip", "arm", "l_knee", "r_knee", "hand")
BREADTH_BODIES = ("pelvis", "l_hip", "r_hip", "arm", "l_knee", "r_knee", "hand")


def motion_of(names, count=20, rate=30.0):
    """A smooth motion of joints and a base that turns and moves."""
    generator = np.random.default_rng(3)
    time = np.arange(count) / rate
    phases = generator.uniform(0.0, 6.0, len(names))
    positions = 0.5 * np.sin(2.0 * time[:, None] + phases)
    root = np.column_stack([0.3 * time, 0.1 * time, np.full(count, 0.8)])
    quaternions = np.column_stack(
        [0.1 * time, np.zeros(count), np.sin(0.2 * time), np.cos(0.2 * time)]
    )
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return JointMotion.checked("made", positions, time, names, "rad", (root, quaternions))


def assert_same(first, second, atol=1e-7):
    assert first.columns == second.columns
    np.testing.assert_allclose(first.positions, second.positions, atol=atol)
    np.testing.assert_allclose(first.time, second.time, atol=1e-9)
    np.testing.assert_allclose(first.root_positions, second.root_positions, atol=atol)
    np.testing.assert_allclose(first.root_rotations, second.root_rotations, atol=atol)


@pytest.fixture
def robot(tmp_path):
    (tmp_path / "small.xml").write_text(HUMANOID)
    return tmp_path / "small.xml"


def test_the_csv_of_unitree(tmp_path):
    motion = motion_of(G1_JOINTS)
    write_unitree_csv(tmp_path / "walk.csv", motion)
    lines = (tmp_path / "walk.csv").read_text().splitlines()
    assert len(lines) == 20
    assert {len(line.split(",")) for line in lines} == {36}
    assert_same(read_unitree_csv(tmp_path / "walk.csv"), motion)

    numbered = [f"{7 + i},{line}" for i, line in enumerate(lines)]
    (tmp_path / "numbered.csv").write_text("\n".join(numbered))
    assert_same(read_unitree_csv(tmp_path / "numbered.csv"), motion)
    again = read_unitree_csv(tmp_path / "walk.csv", rate=60.0)
    np.testing.assert_allclose(np.diff(again.time), 1 / 60)


def test_the_csv_of_another_robot(tmp_path):
    motion = motion_of(DEPTH)
    write_unitree_csv(tmp_path / "walk.csv", motion)
    assert_same(read_unitree_csv(tmp_path / "walk.csv", DEPTH), motion)
    with pytest.raises(FileFormatError, match="36"):
        read_unitree_csv(tmp_path / "walk.csv")


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda lines: ["x,y,z,a", *lines], "header"),
        (lambda lines: [*lines[:3], lines[3].rpartition(",")[0], *lines[4:]], "columns"),
        (lambda lines: [lines[0].replace(lines[0].split(",")[8], "nan"), *lines[1:]], "finite"),
        (lambda lines: [",".join(["3"] * 36), *lines], "length"),
        (lambda lines: lines[:1], "2 frames"),
        (lambda lines: [f"{3 * i},{line}" for i, line in enumerate(lines)], "37"),
    ],
    ids=["header", "short row", "nan", "no quaternion", "one frame", "no frame numbers"],
)
def test_faulty_csv(tmp_path, change, word):
    write_unitree_csv(tmp_path / "walk.csv", motion_of(G1_JOINTS))
    lines = change((tmp_path / "walk.csv").read_text().splitlines())
    (tmp_path / "walk.csv").write_text("\n".join(lines))
    with pytest.raises(FileFormatError, match=word):
        read_unitree_csv(tmp_path / "walk.csv")


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
def test_the_pickle_of_gmr(tmp_path, protocol):
    motion = motion_of(DEPTH)
    content = {
        "fps": np.float64(30.0) if protocol == 5 else 30,
        "root_pos": motion.root_positions.astype(np.float32),
        "root_rot": motion.root_rotations,
        "dof_pos": np.asfortranarray(motion.positions),
        "local_body_pos": None,
        "link_body_list": ["pelvis", "hand"],
    }
    (tmp_path / "walk.pkl").write_bytes(pickle.dumps(content, protocol=protocol))
    assert_same(read_gmr_pickle(tmp_path / "walk.pkl", DEPTH), motion)
    assert read_gmr_pickle(tmp_path / "walk.pkl").columns == ()


def test_the_pickle_is_read_by_pickle(tmp_path):
    motion = motion_of(DEPTH)
    write_gmr_pickle(tmp_path / "walk.pkl", motion)
    content = pickle.loads((tmp_path / "walk.pkl").read_bytes())
    assert set(content) >= {"fps", "root_pos", "root_rot", "dof_pos", "local_body_pos"}
    np.testing.assert_array_equal(content["dof_pos"], motion.positions)
    assert_same(read_gmr_pickle(tmp_path / "walk.pkl", DEPTH), motion)


class Harm:
    """An object whose pickle would make a file when it is loaded."""

    def __init__(self, path, function):
        self.path = path
        self.function = function

    def __reduce__(self):
        return self.function, (str(self.path), "w")


@pytest.mark.parametrize("protocol", [0, 1, 2, 3, 4, 5])
def test_no_code_of_a_pickle_runs(tmp_path, protocol):
    mark = tmp_path / "mark"
    content = {"fps": 30, "root_pos": Harm(mark, open)}
    with pytest.raises(FileFormatError):
        read_pickle(pickle.dumps(content, protocol=protocol), "file")
    assert not mark.exists()


@pytest.mark.parametrize(
    "value",
    [
        np.array([{}], dtype=object),
        np.array(["a", "b"]),
        np.array([1 + 1j]),
        np.zeros(2, dtype=[("a", "f8")]),
        np.array(["2020-01-01"], dtype="M8[D]"),
        {1, 2},
        complex(1),
        JointMotion,
        np.random.default_rng(0),
    ],
    ids=["objects", "text", "complex", "fields", "dates", "set", "number", "class", "generator"],
)
def test_other_values_are_refused(value):
    with pytest.raises(FileFormatError):
        read_pickle(pickle.dumps({"a": value}, protocol=4), "file")


@given(st.data())
def test_damaged_pickles_are_errors_or_values(data):
    motion = motion_of(DEPTH, count=3)
    content = bytearray(
        pickle.dumps(
            {"fps": 30, "dof_pos": motion.positions, "names": ["a", ("b", 2.5)]},
            protocol=data.draw(st.sampled_from([2, 3, 4, 5])),
        )
    )
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(content) - 1))
        content[place] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(1, len(content)))
    for damaged in (bytes(content), bytes(content[:cut])):
        with contextlib.suppress(FileFormatError):
            read_pickle(damaged, "file")


@given(st.binary(max_size=60))
def test_random_bytes_are_no_pickle(content):
    with contextlib.suppress(FileFormatError):
        read_pickle(content, "file")


BOMB = b"K\x01\x85q\x00" + b"".join(bytes([104, i, 104, i, 134, 113, i + 1]) for i in range(60))
"""Instructions for a tuple whose text would have 2^60 numbers."""


def bomb_as(before, after):
    return b"\x80\x04" + before + BOMB + after + b"."


@pytest.mark.parametrize(
    "content",
    [
        bomb_as(b"", b"\x93"),
        bomb_as(b"cnumpy\ndtype\n", b"\x85R"),
        bomb_as(b"cnumpy\ndtype\nX\x02\x00\x00\x00f8\x85R(K\x03", b"tb"),
        bomb_as(
            b"cnumpy._core.numeric\n_frombuffer\n(C\x00cnumpy\ndtype\nX\x02\x00\x00\x00f8\x85R",
            b"X\x01\x00\x00\x00CtR",
        ),
    ],
    ids=["name", "code", "order", "shape"],
)
def test_values_that_are_short_and_have_no_end(content):
    with pytest.raises(FileFormatError):
        read_pickle(content, "file")


def test_bytes_are_not_copied_without_end():
    """A call of five bytes copies a text of a megabyte; 100 000 calls would need 100 GB."""
    text = b"a" * 1_000_000
    head = b"\x80\x02c_codecs\nencode\nq\x00X" + len(text).to_bytes(4, "little") + text
    head += b"X\x06\x00\x00\x00latin1\x86q\x01"
    with pytest.raises(FileFormatError, match="copies"):
        read_pickle(head + 100_000 * b"h\x00h\x01R" + b".", "file")


def test_lists_of_numbers_are_read_and_lists_without_end_are_not(tmp_path):
    motion = motion_of(DEPTH)
    content = {
        "fps": 30,
        "root_pos": motion.root_positions.tolist(),
        "root_rot": motion.root_rotations.tolist(),
        "dof_pos": motion.positions.tolist(),
    }
    (tmp_path / "walk.pkl").write_bytes(pickle.dumps(content))
    assert_same(read_gmr_pickle(tmp_path / "walk.pkl", DEPTH), motion)
    endless = []
    endless += [endless, endless]
    row = [0.0] * 3000
    for value in (endless, [row] * 3000, [[1.0], [1.0, 2.0]], [[10**400]], "text"):
        (tmp_path / "walk.pkl").write_bytes(pickle.dumps({**content, "dof_pos": value}))
        with pytest.raises(FileFormatError, match="dof_pos"):
            read_gmr_pickle(tmp_path / "walk.pkl")


@pytest.mark.parametrize(
    "change",
    [
        {"fps": 10**5000},
        {"fps": [30]},
        {"fps": np.zeros(0)},
        {"fps": float("nan")},
        {"dof_pos": np.zeros((2**40, 0))},
        {"dof_pos": np.zeros((0, 2**40))},
        {"root_rot": np.zeros((2, 4))},
    ],
)
def test_wrong_entries_of_a_pickle(tmp_path, change):
    motion = motion_of(DEPTH)
    content = {
        "fps": 30,
        "root_pos": motion.root_positions,
        "root_rot": motion.root_rotations,
        "dof_pos": motion.positions,
    }
    (tmp_path / "walk.pkl").write_bytes(pickle.dumps({**content, **change}))
    with pytest.raises(FileFormatError):
        read_gmr_pickle(tmp_path / "walk.pkl")


@pytest.mark.parametrize(
    "program",
    [
        b"cmark_module\nmark\n)R.",
        b"\x80\x04\x8c\x0bmark_module\x8c\x04mark\x93)R.",
        b"(imark_module\nmark\n.",
        b"(cmark_module\nmark\no.",
        b"\x80\x02cmark_module\nmark\n)\x81.",
        b"\x80\x04cmark_module\nmark\n)}\x92.",
        b"\x80\x02\x82\x01.",
        b"Pmark_module\n.",
        b"\x80\x05\x97.",
        b"cnumpy\ndtype\ncmark_module\nmark\n\x85R.",
        b"cnumpy\nndarray\n)R.",
        b"cbuiltins\ngetattr\n(cnumpy\nndarray\nVtofile\ntR.",
        b"cnumpy.core.multiarray\nfrombuffer\n.",
    ],
)
def test_nothing_is_imported(tmp_path, monkeypatch, program):
    """A module that a pickle names would leave a mark when it is imported."""
    (tmp_path / "mark_module.py").write_text("def mark():\n    return 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(FileFormatError):
        read_pickle(program, "file")
    assert "mark_module" not in sys.modules


def test_deep_and_large_pickles_end():
    deep = b"\x80\x04" + b"]" * 100_000 + b"a" * 99_999 + b"."
    with contextlib.suppress(FileFormatError):
        read_pickle(deep, "file")
    with pytest.raises(FileFormatError):
        read_pickle(b"\x80\x04\x8e\xff\xff\xff\xff\xff\xff\xff\x7f.", "file")


@pytest.mark.parametrize("missing", ["fps", "root_pos", "root_rot", "dof_pos"])
def test_a_pickle_without_an_entry(tmp_path, missing):
    motion = motion_of(DEPTH)
    write_gmr_pickle(tmp_path / "walk.pkl", motion)
    content = pickle.loads((tmp_path / "walk.pkl").read_bytes())
    del content[missing]
    (tmp_path / "walk.pkl").write_bytes(pickle.dumps(content))
    with pytest.raises(FileFormatError, match=missing):
        read_gmr_pickle(tmp_path / "walk.pkl")


def mujoco_arrays(text, motion, joints, bodies):
    """Arrays of bodies by MuJoCo, in an order of joints and bodies."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    columns = dict(zip(motion.columns, motion.positions.T, strict=True))
    places = []
    turns = []
    for row in range(len(motion)):
        data.qpos[:3] = motion.root_positions[row]
        data.qpos[3:7] = motion.root_rotations[row][[3, 0, 1, 2]]
        for name, values in columns.items():
            data.qpos[model.joint(name).qposadr[0]] = values[row]
        mujoco.mj_forward(model, data)
        places.append([data.body(name).xpos.copy() for name in bodies])
        turns.append([data.body(name).xquat.copy() for name in bodies])
    return {
        "fps": np.array([30]),
        "joint_pos": np.stack([columns[name] for name in joints], axis=1).astype(np.float32),
        "joint_vel": np.zeros((len(motion), len(joints)), dtype=np.float32),
        "body_pos_w": np.array(places, dtype=np.float32),
        "body_quat_w": np.array(turns, dtype=np.float32),
    }


@pytest.mark.parametrize(
    ("joints", "bodies", "order"),
    [
        (DEPTH, ("pelvis", "l_hip", "l_knee", "l_foot", "r_hip", "r_knee", "arm", "hand"), "depth"),
        (BREADTH, BREADTH_BODIES, "breadth"),
        (
            BREADTH,
            ("pelvis", "l_hip", "r_hip", "arm", "l_knee", "r_knee", "hand", "l_foot"),
            "breadth",
        ),
    ],
    ids=["mjlab", "isaac", "isaac with fixed bodies"],
)
def test_the_order_of_joints_is_identified(tmp_path, robot, joints, bodies, order):
    motion = motion_of(DEPTH)
    np.savez(tmp_path / "walk.npz", **mujoco_arrays(HUMANOID, motion, joints, bodies))
    found = read_mjlab_npz(tmp_path / "walk.npz", robot=robot)
    assert found.columns == joints
    assert order in found.notes[0]
    columns = dict(zip(found.columns, found.positions.T, strict=True))
    for name, expected in zip(DEPTH, motion.positions.T, strict=True):
        np.testing.assert_allclose(columns[name], expected, atol=1e-6)
    named = read_mjlab_npz(tmp_path / "walk.npz", joints)
    assert named.columns == joints
    assert read_mjlab_npz(tmp_path / "walk.npz").columns == ()


def test_an_order_that_fits_no_body_is_an_error(tmp_path, robot):
    motion = motion_of(DEPTH)
    arrays = mujoco_arrays(HUMANOID, motion, DEPTH[::-1], BREADTH_BODIES)
    np.savez(tmp_path / "walk.npz", **arrays)
    with pytest.raises(FileFormatError, match="order"):
        read_mjlab_npz(tmp_path / "walk.npz", robot=robot)
    np.savez(
        tmp_path / "few.npz",
        **{
            **arrays,
            "body_pos_w": arrays["body_pos_w"][:, :3],
            "body_quat_w": arrays["body_quat_w"][:, :3],
        },
    )
    with pytest.raises(FileFormatError, match="bodies"):
        read_mjlab_npz(tmp_path / "few.npz", robot=robot)


def test_a_motion_that_is_written_has_the_bodies_of_mujoco(tmp_path, robot):
    motion = motion_of(BREADTH)
    write_mjlab_npz(tmp_path / "walk.npz", motion, robot)
    with np.load(tmp_path / "walk.npz") as arrays:
        written = dict(arrays)
    bodies = ("pelvis", "l_hip", "l_knee", "l_foot", "r_hip", "r_knee", "arm", "hand")
    expected = mujoco_arrays(HUMANOID, motion, DEPTH, bodies)
    for name in ("joint_pos", "body_pos_w"):
        np.testing.assert_allclose(written[name], expected[name], atol=1e-6)
    dots = np.abs(np.sum(written["body_quat_w"] * expected["body_quat_w"], axis=-1))
    np.testing.assert_allclose(dots, 1.0, atol=1e-6)
    steps = np.diff(written["body_pos_w"], axis=0) * 30.0
    between = 0.5 * (steps[1:] + steps[:-1])
    np.testing.assert_allclose(written["body_lin_vel_w"][1:-1], between, atol=1e-4)
    again = read_mjlab_npz(tmp_path / "walk.npz", robot=robot)
    assert again.columns == DEPTH


def test_angular_velocities_of_a_turning_base(tmp_path, robot):
    time = np.arange(30) / 30.0
    turn = np.column_stack([np.zeros((30, 2)), np.sin(0.4 * time), np.cos(0.4 * time)])
    root = (np.zeros((30, 3)), turn)
    motion = JointMotion.checked("made", np.zeros((30, 6)), time, DEPTH, "rad", root)
    write_mjlab_npz(tmp_path / "turn.npz", motion, robot)
    with np.load(tmp_path / "turn.npz") as arrays:
        np.testing.assert_allclose(
            arrays["body_ang_vel_w"], np.broadcast_to([0, 0, 0.8], (30, 8, 3)), atol=1e-4
        )


@pytest.mark.parametrize(
    "change",
    [
        {"joint_pos": np.zeros((20, 6, 1))},
        {"body_pos_w": np.zeros((19, 7, 3))},
        {"body_quat_w": np.zeros((20, 7, 3))},
        {"fps": np.array([0])},
        {"joint_pos": np.full((20, 6), np.nan)},
        {"joint_pos": np.array("text")},
    ],
    ids=lambda change: next(iter(change)),
)
def test_faulty_arrays(tmp_path, change):
    motion = motion_of(DEPTH)
    arrays = mujoco_arrays(HUMANOID, motion, BREADTH, BREADTH_BODIES)
    np.savez(tmp_path / "walk.npz", **{**arrays, **change})
    with pytest.raises(FileFormatError):
        read_mjlab_npz(tmp_path / "walk.npz", BREADTH)


@pytest.mark.parametrize("write", [write_unitree_csv, write_gmr_pickle])
def test_a_motion_without_a_base_or_in_degrees_is_not_written(tmp_path, write):
    time = np.arange(3) / 30.0
    without = JointMotion.checked("made", np.zeros((3, 6)), time, DEPTH, "rad")
    root = (np.zeros((3, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)))
    degrees = JointMotion.checked("made", np.zeros((3, 6)), time, DEPTH, "deg", root)
    for motion in (without, degrees):
        with pytest.raises(InvalidInputError):
            write(tmp_path / "file", motion)
    assert list(tmp_path.iterdir()) == []
