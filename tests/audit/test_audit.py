"""Audits: planted faults are found, units and columns are never guessed, and what cannot be judged is named."""

import json
import os
import shutil

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

pytest.importorskip("pyarrow")

import pyarrow.parquet as pq

from benchmarks.audit import Judge, score, write_dataset
from maniport.arms import load_arm
from maniport.arms.collisions import Collisions
from maniport.arms.directional import polytope_extent
from maniport.audit import KINDS, AuditOptions, audit_dataset
from maniport.audit.checks import Checks, derivatives
from maniport.audit.write import AUDIT_FILES
from maniport.cli import app
from maniport.datasets.lerobot import STATE, Episode, Feature, write_lerobot
from maniport.errors import FileFormatError, InvalidInputError
from maniport.motion import MotionLimits

ARM = """<mujoco model="bench"><compiler angle="radian" autolimits="true"/>
  <option><flag filterparent="enable"/></option>
  <worldbody><geom name="column" type="capsule" size="0.05" fromto="0 0 0 0 0 0.35"/>
  <body name="a" pos="0 0 0.4"><joint name="a" axis="0 0 1" range="-2.5 2.5"/>
    <geom type="capsule" size="0.04" fromto="0 0 0.02 0 0 0.1" density="3000"/>
    <inertial mass="2" pos="0 0 0" diaginertia="0.01 0.01 0.01"/>
  <body name="b" pos="0 0 0.15"><joint name="b" axis="0 1 0" range="-2 2"/>
    <geom type="capsule" size="0.04" fromto="0.1 0 0 0.25 0 0"/>
    <inertial mass="2" pos="0.15 0 0" diaginertia="0.02 0.02 0.02"/>
  <body name="c" pos="0.3 0 0"><joint name="c" axis="0 1 0" range="-2.8 2.8"/>
    <geom type="capsule" size="0.04" fromto="0.1 0 0 0.2 0 0"/>
    <inertial mass="1" pos="0.12 0 0" diaginertia="0.01 0.01 0.01"/>
  <body name="d" pos="0.25 0 0"><joint name="d" axis="1 0 0" range="-2.5 2.5"/>
    <inertial mass="0.3" pos="0.02 0 0" diaginertia="0.001 0.001 0.001"/>
  <body name="e" pos="0.05 0 0"><joint name="e" axis="0 1 0" range="-2 2"/>
    <geom type="capsule" size="0.03" fromto="0.05 0 0 0.15 0 0"/>
    <inertial mass="0.5" pos="0.08 0 0" diaginertia="0.003 0.003 0.003"/>
  </body></body></body></body></body></worldbody></mujoco>"""
RATE = 50.0


def run(*words):
    done = CliRunner().invoke(app, ["audit", *map(str, words)])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        assert isinstance(done.exception, InvalidInputError | FileFormatError), done.exception
        return 2, str(done.exception)
    return done.exit_code, done.output


def numbers(folder):
    return json.loads((folder / "audit.json").read_text())


def rows(folder):
    return pq.read_table(folder / "episodes.parquet").to_pylist()


def smooth(arm, seconds=2.0, scale=0.2, seed=0):
    """A slow motion in the middle of the joints' ranges."""
    generator = np.random.default_rng(seed)
    time = np.arange(int(RATE * seconds)) / RATE
    middle = 0.5 * (arm.lower + arm.upper)
    return middle + scale * np.sin(0.8 * time[:, None] + generator.uniform(0.0, 6.0, arm.dof))


def dataset(folder, arm, motions, names=None, extra=0):
    """Write motions as a LeRobot dataset, with further columns that are no joints."""
    columns = tuple(names or (f"{name}.pos" for name in arm.joint_names))
    columns += tuple(f"gripper{i}" for i in range(extra))
    features = (Feature(STATE, columns), Feature("action", columns))
    episodes = []
    for number, q in enumerate(motions):
        values = np.column_stack([q, np.zeros((len(q), extra))])
        episodes.append(Episode(f"clip {number}", "move", {STATE: values, "action": values}))
    write_lerobot(folder, episodes, features, int(RATE), arm.name)
    return folder


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    (folder / "bench.xml").write_text(ARM)
    return folder / "bench.xml"


@pytest.fixture(scope="module")
def planted(bench, tmp_path_factory):
    """Twenty motions, ten of them with a planted fault, and their audit."""
    pytest.importorskip("mujoco")
    folder = tmp_path_factory.mktemp("planted")
    judge = Judge.of(load_arm(bench, "e"), bench)
    (folder / "limits.yaml").write_text(yaml.safe_dump(judge.limits()))
    kinds = write_dataset(folder / "set", judge, 20, 0, frames=150)
    words = ("--robot", bench, "--frame", "e", "--unit", "rad", "--limits", folder / "limits.yaml")
    code, _ = run(folder / "set", *words, "-o", folder / "out", "--processes", "1")
    return folder, kinds, code, words


def test_planted_faults_are_found_without_false_alarms(planted):
    folder, kinds, code, _ = planted
    assert code == 1
    assert set(kinds) == {"", *KINDS}
    assert score(kinds, rows(folder / "out")) == {**dict.fromkeys(KINDS, 1.0), "false alarms": 0.0}
    kept = json.loads((folder / "out" / "keep.json").read_text())["episodes"]
    assert kept == [number for number, kind in enumerate(kinds) if not kind]


def test_files_of_an_audit(planted):
    folder, kinds, *_ = planted
    assert {file.name for file in (folder / "out").iterdir()} == AUDIT_FILES
    found = numbers(folder / "out")
    assert (found["episodes"], found["frames"], found["clean"]) == (20, 3000, False)
    for kind in KINDS:
        assert found["findings"][kind]["episodes"] == kinds.count(kind)
    table = pq.read_table(folder / "out" / "frames.parquet")
    assert table.num_rows == 3000
    exceeded = np.array(table["collision_exceeded"])
    episode = np.array(table["episode"])
    assert {kinds[number] for number in episode[exceeded]} == {"collision"}
    page = (folder / "out" / "audit.html").read_text()
    assert page.count("<svg") == 6
    assert "Not checked" in page
    for kind in KINDS:
        assert kind in page


def test_workers_give_the_same_files(planted, tmp_path, monkeypatch):
    monkeypatch.setattr("maniport.audit.audit.BLOCK_FRAMES", 600)
    folder, _, _, words = planted
    code, _ = run(folder / "set", *words, "-o", tmp_path / "out", "--processes", "2")
    assert code == 1
    for name in ("audit.json", "keep.json"):
        assert (tmp_path / "out" / name).read_bytes() == (folder / "out" / name).read_bytes()
    assert rows(tmp_path / "out") == rows(folder / "out")


def test_findings_that_count_are_chosen(planted, tmp_path):
    folder, kinds, _, words = planted
    code, _ = run(
        folder / "set",
        *words,
        "-o",
        tmp_path / "out",
        "--fail-on",
        "position,collision",
        "--processes",
        "1",
    )
    assert code == 1
    failed = numbers(tmp_path / "out")["failed"]
    assert {kinds[number] for number in failed} == {"position", "collision"}


def test_the_numbers_of_a_motion(panda, tmp_path):
    q = smooth(panda, 1.0)
    folder = dataset(tmp_path / "set", panda, [q])
    code, _ = run(
        folder,
        "--robot",
        "panda",
        "--frame",
        "panda_link8",
        "--unit",
        "rad",
        "-o",
        tmp_path / "out",
    )
    assert code == 0
    table = pq.read_table(tmp_path / "out" / "frames.parquet")
    frames = {name: np.array(table[name]) for name in table.column_names if "joint" not in name}
    q = np.float32(q).astype(float)  # as the dataset stores them
    time = np.arange(len(q)) / RATE
    velocities, accelerations = derivatives(time, q)
    limits = MotionLimits.of(panda, None, 0.0)
    expected = {
        "velocity": np.abs(velocities) / limits.velocity,
        "acceleration": np.abs(accelerations) / limits.acceleration,
        "torque": np.abs(limits.dynamics.torques(q, velocities, accelerations)) / limits.effort,
    }
    for kind, share in expected.items():
        np.testing.assert_allclose(frames[f"{kind}_share"], share.max(axis=1), rtol=1e-4)
    jacobians = panda.jacobian(q)[:, :3]
    smallest = np.linalg.svd(jacobians, compute_uv=False)[:, -1]
    np.testing.assert_allclose(frames["singular_value"], smallest, rtol=1e-4)
    speeds = np.einsum("nij,nj->ni", jacobians, velocities)
    norms = np.linalg.norm(speeds, axis=1)
    np.testing.assert_allclose(frames["speed_m_s"], norms, rtol=1e-4)
    directions = (speeds / norms[:, None])[:, None]
    extents = polytope_extent(panda, q, directions, "velocity")[:, 0]
    np.testing.assert_allclose(frames["speed_share"], norms / extents, rtol=1e-4)
    forces = polytope_extent(panda, q, directions, "force")[:, 0]
    np.testing.assert_allclose(frames["force_n"], forces, rtol=1e-4)
    assert np.all(frames["speed_share"] <= 1.0)


def test_a_payload_counts(panda, tmp_path):
    q = np.tile([0.0, 1.2, 0.0, -0.2, 0.0, 1.5, 0.0], (20, 1))
    folder = dataset(tmp_path / "set", panda, [q])
    words = (folder, "--robot", "panda", "--unit", "rad", "--processes", "1")
    code, _ = run(*words, "-o", tmp_path / "light")
    assert code == 0
    code, _ = run(*words, "--payload", "9", "-o", tmp_path / "heavy")
    assert code == 1
    assert numbers(tmp_path / "heavy")["findings"]["torque"]["episodes"] == 1


def test_units_are_never_guessed(panda, tmp_path):
    q = smooth(panda)
    radians = dataset(tmp_path / "radians", panda, [q])
    degrees = dataset(tmp_path / "degrees", panda, [np.degrees(q)])
    words = ("--robot", "panda", "--processes", "1")
    for folder in (radians, degrees):
        code, text = run(folder, *words, "-o", tmp_path / "out")
        assert code == 2
        assert "rad" in text
        code, text = run(folder, *words, "--unit", "normalized", "-o", tmp_path / "out")
        assert code == 2
        assert "calibration" in text
        assert not (tmp_path / "out").exists()
    assert run(radians, *words, "--unit", "rad", "-o", tmp_path / "a")[0] == 0
    assert run(degrees, *words, "--unit", "deg", "-o", tmp_path / "b")[0] == 0
    assert run(degrees, *words, "--unit", "rad", "-o", tmp_path / "c")[0] == 1


def test_stated_units_are_used_and_not_contradicted(small_result, tmp_path):
    small_result.save(tmp_path / "result")
    words = ("--robot", "panda", "--processes", "1", "--no-collisions")
    for name in ("result", "result/joints.csv", "result/joints.npz"):
        code, text = run(
            tmp_path / name, *words, "-o", tmp_path / f"out-{name.replace(chr(47), chr(45))}"
        )
        assert code == 0, text
        found = numbers(tmp_path / f"out-{name.replace(chr(47), chr(45))}")
        assert found["columns"]["panda_joint1"] == "panda_joint1"
    code, text = run(tmp_path / "result", *words, "--unit", "deg", "-o", tmp_path / "no")
    assert code == 2
    assert not (tmp_path / "no").exists()


@pytest.mark.parametrize(
    ("names", "place"),
    [
        (["joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6", "joint_7"], 0),
        ([f"panda_joint{i}.pos" for i in (7, 6, 5, 4, 3, 2, 1)], 6),
        ([f"main_panda_joint{i}.pos" for i in range(1, 8)], 0),
        ([f"state.dof_pos.panda_joint{i}" for i in range(1, 8)], 0),
    ],
    ids=["numbers", "other order", "prefix", "path"],
)
def test_columns_are_matched_by_their_names(panda, tmp_path, names, place):
    q = smooth(panda)
    ordered = q[:, ::-1] if place else q
    folder = dataset(tmp_path / "set", panda, [ordered], names, extra=1)
    code, text = run(folder, "--robot", "panda", "--unit", "rad", "-o", tmp_path / "out")
    assert code == 0, text
    found = numbers(tmp_path / "out")
    assert found["columns"]["panda_joint1"] == names[place]
    assert found["ignored_columns"] == ["gripper0"]


@pytest.mark.parametrize(
    "names",
    [
        [f"joint_{i}" for i in range(7)],
        ["joint_0", *(f"joint_{i}" for i in range(1, 8))],
        [f"servo{chr(97 + i)}" for i in range(7)],
        [*(f"panda_joint{i}" for i in range(1, 7)), "gripper"],
    ],
    ids=["from 0", "from 0 with a gripper", "letters", "one missing"],
)
def test_doubtful_columns_are_not_decided(panda, tmp_path, names):
    q = smooth(panda)
    values = np.column_stack([q, np.zeros(len(q))])[:, : len(names)]
    folder = dataset(tmp_path / "set", panda, [values], names)
    words = (folder, "--robot", "panda", "--unit", "rad", "--processes", "1")
    code, text = run(*words, "-o", tmp_path / "out")
    assert code == 2
    assert "columns" in text
    if len(names) == 7:
        given = ",".join(panda.joint_names)
        assert run(*words, "--columns", given, "-o", tmp_path / "out")[0] == 0


def test_columns_without_names_are_given(panda, tmp_path):
    q = smooth(panda)
    folder = dataset(tmp_path / "set", panda, [q], extra=1)
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    for key in (STATE, "action"):
        info["features"][key]["names"] = None
    path.write_text(json.dumps(info))
    words = (folder, "--robot", "panda", "--unit", "rad", "--processes", "1")
    code, text = run(*words, "-o", tmp_path / "out")
    assert code == 2
    assert "8 columns" in text
    given = ",".join([*panda.joint_names, "-"])
    assert run(*words, "--columns", given, "-o", tmp_path / "out")[0] == 0
    for wrong in (given[:-2], given.replace("panda_joint3", "panda_joint2"), f"x{given}"):
        assert run(*words, "--columns", wrong, "-o", tmp_path / "no")[0] == 2


URDF = """<robot name="toy"><link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/>
{joints}</robot>"""
JOINT = """<joint name="j{i}" type="revolute"><parent link="l{p}"/><child link="l{i}"/><origin xyz="0.2 0 0"/>
<axis xyz="{axis}"/><limit lower="-2" upper="2" velocity="{velocity}" effort="{effort}"/></joint>"""


@pytest.mark.parametrize(("velocity", "judged"), [(10, False), (0, False), (2.5, True)])
def test_placeholders_and_unknown_limits_are_not_checked(tmp_path, velocity, judged):
    joints = [
        JOINT.format(i=i, p=i - 1, axis=axis, velocity=velocity, effort=10)
        for i, axis in enumerate(("0 0 1", "0 1 0", "0 1 0"), 1)
    ]
    (tmp_path / "toy.urdf").write_text(URDF.format(joints="".join(joints)))
    arm = load_arm(tmp_path / "toy.urdf")
    folder = dataset(tmp_path / "set", arm, [smooth(arm)])
    words = (folder, "--robot", tmp_path / "toy.urdf", "--unit", "rad", "--processes", "1")
    code, _ = run(*words, "-o", tmp_path / "out")
    assert code == 0
    found = numbers(tmp_path / "out")
    unchecked = {one["kind"] for one in found["not_checked"] if one["complete"]}
    assert ("velocity" in unchecked) == (not judged)
    assert {"acceleration", "torque", "collision"} <= unchecked
    assert ("velocity" in found["fail_on"]) == judged
    code, text = run(*words, "--fail-on", "velocity", "-o", tmp_path / "chosen")
    assert code == (0 if judged else 2), text

    limits = {"default": {"velocity": 10.0, "acceleration": 20.0}}
    (tmp_path / "limits.yaml").write_text(yaml.safe_dump(limits))
    code, _ = run(*words, "--limits", tmp_path / "limits.yaml", "-o", tmp_path / "stated")
    assert code == 0
    assert {"velocity", "acceleration"} <= set(numbers(tmp_path / "stated")["fail_on"])


def test_a_robot_whose_description_excludes_all_contacts_has_no_verdict_on_them(bench, tmp_path):
    text = ARM.replace('filterparent="enable"', 'contact="disable"')
    (tmp_path / "free.xml").write_text(text)
    arm = load_arm(tmp_path / "free.xml", "e")
    folder = dataset(tmp_path / "set", arm, [smooth(arm)])
    words = (folder, "--robot", tmp_path / "free.xml", "--frame", "e", "--unit", "rad")
    code, _ = run(*words, "-o", tmp_path / "out", "--processes", "1")
    assert code == 0
    assert not Collisions.of(arm).pairs
    found = numbers(tmp_path / "out")
    assert "collision" not in found["fail_on"]
    assert "collision" in {one["kind"] for one in found["not_checked"] if one["complete"]}


def test_the_tolerance_is_of_limits_of_resampled_motions(panda, tmp_path):
    time = np.arange(100) / RATE
    limits = MotionLimits.of(panda, None, 0.0)
    q = np.tile(0.5 * (panda.lower + panda.upper), (100, 1))
    frequency = 3.0
    q[:, 0] += 1.03 * limits.velocity[0] / frequency * np.sin(frequency * time)
    folder = dataset(tmp_path / "set", panda, [q])
    words = (folder, "--robot", "panda", "--unit", "rad", "--no-collisions", "--processes", "1")
    assert run(*words, "-o", tmp_path / "out")[0] == 0
    assert run(*words, "--tolerance", "0", "-o", tmp_path / "strict")[0] == 1


def test_faulty_data_leave_nothing(panda, tmp_path):
    q = smooth(panda)
    words = ("--robot", "panda", "--unit", "rad", "--processes", "1", "-o", tmp_path / "out")
    folder = dataset(tmp_path / "set", panda, [q, q])
    path = folder / "data/chunk-000/file-000.parquet"
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    assert run(folder, *words)[0] == 2
    path.write_bytes(content)
    info = folder / "meta" / "info.json"
    info.write_text(info.read_text().replace('"total_episodes": 2', '"total_episodes": 3'))
    assert run(folder, *words)[0] == 2
    shutil.rmtree(folder)
    assert run(folder, *words)[0] == 2
    assert os.listdir(tmp_path) == []


def test_mixed_files_are_an_error(small_result, panda, tmp_path):
    folder = tmp_path / "files"
    folder.mkdir()
    motion = small_result.motion.trajectory
    motion.save_joints_csv(folder / "one.csv")
    text = (folder / "one.csv").read_text().splitlines()
    (folder / "two.csv").write_text("\n".join([text[0], *text[1::2]]))
    words = ("--robot", "panda", "--no-collisions", "--processes", "1")
    code, message = run(folder, *words, "-o", tmp_path / "out")
    assert code == 2
    assert "rate" in message


def test_python(panda, tmp_path):
    folder = dataset(tmp_path / "set", panda, [smooth(panda), 3.0 * smooth(panda)])
    limits = MotionLimits.of(panda, None, 0.0)
    checks = Checks.of(panda, limits, None, 0.05)
    result = audit_dataset(folder, checks, AuditOptions(unit="rad"))
    assert result.kept == (0,)
    assert "position" in result.failed[0].failed
    assert result.worst[0][0] is result.failed[0]
    with pytest.raises(InvalidInputError, match="collision"):
        audit_dataset(folder, checks, AuditOptions(unit="rad", fail_on=("collision",)))


@pytest.mark.parametrize(
    "options",
    [{"unit": "grad"}, {"fail_on": ("speed",)}, {"tolerance": -0.1}, {"processes": 0}],
)
def test_wrong_options(options):
    with pytest.raises(InvalidInputError):
        AuditOptions(**options)
