"""One motion, written in every format, gives the same points and joint angles."""

import json
from dataclasses import replace
from functools import partial

import ezc3d
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from dialect_files import POINTS, SKELETONS, mirrored, write_bvh
from format_files import (
    DOWN,
    HIPS,
    SAUL,
    amass,
    landmarks,
    write_csv,
    write_json,
    write_mot,
    write_motive,
    write_mvnx,
    write_nexus,
    write_qualisys,
    write_trc,
)
from fuzz.c3d_writer import LABELS, Writer
from maniport.errors import FileFormatError, UnknownNameError
from maniport.mocap import fit_arm, read_recording, shipped_recording
from maniport.mocap.readers import UNITS
from maniport.mocap.readers.c3d import DEC, MIPS
from maniport.mocap.roles import load_names

TRUNK = {
    "trunk_low": "pelvis",
    "trunk_high": "neck",
    "trunk_right": "shoulder_r",
    "trunk_left": "shoulder_l",
}
JOINTS = {"shoulder": "shoulder_r", "elbow": "elbow_r", "wrist": "wrist_r"}
RAJAGOPAL = ("arm_flex", "arm_add", "arm_rot", "elbow_flex", "pro_sup")
ORDERS = load_names("joint_orders.yaml")
Y_UP = np.eye(3)[[1, 2, 0]]


@pytest.fixture(scope="module")
def plain(made):
    return fit_arm(made.recording({**JOINTS, **TRUNK})).joint_angles


@pytest.fixture(scope="module")
def smpl(made):
    parts = mirrored(POINTS["SMPL-X"]) | {
        "left_knee": "knee_l",
        "right_knee": "knee_r",
        "left_ankle": "foot_l",
        "right_ankle": "foot_r",
        "left_foot": "toe_l",
        "right_foot": "toe_r",
    }
    return made.recording({name: parts[name] for name in ORDERS["skeletons"]["SMPL body"]})


def angles(recording):
    return fit_arm(
        recording, markers={"hand": None, "elbow_axis": None, "wrist_axis": None}
    ).joint_angles


def noted(recording, *words):
    return any(all(word in note for word in words) for note in recording.notes)


@pytest.mark.parametrize(
    ("write", "name", "unit", "up"),
    [
        (write_trc, "a.trc", "m", "z"),
        (partial(write_trc, unit="mm", scale=0.001), "a.trc", "mm", "z"),
        (write_csv, "a.csv", "m", "z"),
        (partial(write_csv, dot=True), "a.csv", "m", "z"),
        (partial(write_csv, long=True), "a.csv", "m", "z"),
        (write_motive, "a.csv", "mm", "y"),
        (partial(write_motive, solved=False), "a.csv", "mm", "y"),
        (write_nexus, "a.csv", "mm", "z"),
        (write_qualisys, "a.tsv", "mm", "z"),
        (partial(write_qualisys, columns=False), "a.txt", "mm", "z"),
    ],
)
def test_tables_of_points_come_back(tmp_path, markers, write, name, unit, up):
    recording = read_recording(write(tmp_path / name, markers))
    names = tuple(name.rpartition(":")[2] for name in recording.names)
    assert names == markers.names
    assert_allclose(
        recording.positions, markers.positions @ (Y_UP if up == "y" else np.eye(3)).T, atol=1e-6
    )
    assert_allclose(recording.time, markers.time, atol=1e-6)
    assert noted(recording, "unit", unit)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16-be"])
def test_text_of_windows_is_read(tmp_path, made, markers, encoding):
    write_bvh(tmp_path / "a.bvh", SKELETONS["LAFAN1"], made)
    write_trc(tmp_path / "a.trc", markers)
    write_mot(tmp_path / "a.mot", made.time, made.joint_angles, SAUL)
    write_csv(tmp_path / "a.csv", markers)
    for file in list(tmp_path.iterdir()):
        before = read_recording(file)
        text = ("\ufeff" if encoding == "utf-16-be" else "") + file.read_text()
        file.write_bytes(text.replace("\n", "\r\n").encode(encoding))
        after = read_recording(file)
        assert after.names == before.names, file
        assert_allclose(after.positions, before.positions, atol=1e-12)


@pytest.mark.parametrize(("separator", "comma"), [(",", "."), (";", "."), (";", ","), ("\t", ",")])
def test_separators_and_decimal_commas(tmp_path, markers, separator, comma):
    trc = write_trc(tmp_path / "a.trc", markers, "mm", 0.001)
    csv = write_csv(tmp_path / "a.csv", markers)
    for file, old in ((trc, "\t"), (csv, ",")):
        before = read_recording(file)
        file.write_text(
            file.read_text().replace(old, "|").replace(".", comma).replace("|", separator)
        )
        after = read_recording(file)
        assert after.names == before.names
        assert_allclose(after.positions, before.positions, atol=1e-12)
        assert_allclose(after.time, before.time, atol=1e-12)
        assert len(after.quality_warnings) == (file is trc and separator != "\t")


def test_placeholders_of_missing_numbers(tmp_path, markers):
    file = write_csv(tmp_path / "a.csv", markers)
    expected = read_recording(file).positions
    text = file.read_text()
    for word in ("NA", "n/a", "NULL", "None", "nan", "1.#QNAN", "-1.#IND", "-nan(ind)", "inf"):
        file.write_text("sep=,\n" + text.replace(",,,", f",{word},{word},", 1))
        assert_allclose(read_recording(file).positions, expected)
    file.write_text(text.replace(",,,", ",,lost,", 1))
    with pytest.raises(FileFormatError, match=r"line 5.*'lost'"):
        read_recording(file)


@pytest.mark.parametrize("name", SKELETONS)
def test_every_skeleton_gives_the_points_and_angles_of_the_motion(tmp_path, made, plain, name):
    skeleton = SKELETONS[name]
    recording = read_recording(write_bvh(tmp_path / "a.bvh", skeleton, made))
    turn = Y_UP if skeleton.up == "y" else np.eye(3)
    for point, part in mirrored(skeleton.names).items():
        assert_allclose(recording.point(point), made.parts[part] @ turn.T, atol=2e-6)
    assert_allclose(
        fit_arm(recording, markers={"hand": None}, side="right").joint_angles, plain, atol=1e-4
    )


@pytest.mark.parametrize("unit", ["m", "cm", "mm", "inch", "CMU"])
def test_units_are_recognized(tmp_path, made, unit):
    skeleton = replace(SKELETONS["LAFAN1"], unit=UNITS[unit])
    recording = read_recording(write_bvh(tmp_path / "a.bvh", skeleton, made))
    assert_allclose(recording.point("RightHand"), made.parts["wrist_r"] @ Y_UP.T, atol=2e-5)
    assert noted(recording, f"recognized as {unit} ")


def test_a_rest_pose_at_the_start_is_omitted(tmp_path, made):
    file = write_bvh(tmp_path / "a.bvh", SKELETONS["LAFAN1"], made)
    lines = file.read_text().splitlines()
    row = lines.index("MOTION") + 3
    lines[row] = " ".join(["500", "0", "0", "170", *lines[row].split()[4:]])
    file.write_text("\n".join(lines))
    recording = read_recording(file)
    assert (len(recording), recording.time[0]) == (len(made.time) - 1, 0)
    assert noted(recording, "rest pose")


def test_mvnx_gives_the_origins_of_segments(tmp_path, made, plain):
    recording = made.recording(mirrored(POINTS["MVNX"]))
    again = read_recording(write_mvnx(tmp_path / "a.mvnx", recording))
    assert_allclose(again.positions, recording.positions, atol=1e-6)
    assert (again.names, len(again)) == (recording.names, len(recording))
    assert_allclose(angles(again), plain, atol=2e-4)


@pytest.mark.parametrize("degrees", [True, False])
def test_joint_angles_of_saul_come_back(tmp_path, made, degrees):
    fit = fit_arm(
        read_recording(write_mot(tmp_path / "a.mot", made.time, made.joint_angles, SAUL, degrees))
    )
    assert fit.observable.all()
    assert_allclose(np.degrees(fit.joint_angles), np.degrees(made.joint_angles), atol=0.1)


def test_joint_angles_of_rajagopal_in_known_configurations(tmp_path):
    poses = np.radians([[0, 0, 0, 0, 90], [90, 0, 0, 0, 90], [0, -90, 0, 0, 90], [0, 0, 0, 90, 90]])
    names = [f"{name}_{side}" for side in "rl" for name in RAJAGOPAL]
    recording = read_recording(
        write_mot(tmp_path / "a.sto", np.arange(4) / 10, np.tile(poses, 2), names)
    )
    upper = recording.point("right_elbow") - recording.point("right_shoulder")
    upper /= np.linalg.norm(upper, axis=1, keepdims=True)
    assert_allclose(upper, [[0, 0, -1], [1, 0, 0], [0, -1, 0], [0, 0, -1]], atol=0.06)
    fore = recording.point("right_hand") - recording.point("right_elbow")
    assert fore[3, 0] > 0.25 > abs(fore[3, 2])
    assert (recording.point("right_wrist_radial") - recording.point("right_wrist_ulnar"))[
        0, 0
    ] > 0.05
    assert_allclose(
        recording.point("left_hand"), recording.point("right_hand") * [1.0, -1.0, 1.0], atol=1e-12
    )


def test_an_array_with_names_beside_it(tmp_path, markers):
    file = tmp_path / "clip.npy"
    np.save(file, markers.positions)
    with pytest.raises(FileFormatError, match=r"without names.*'clip.names.txt'"):
        read_recording(file, rate=50)
    (tmp_path / "clip.names.txt").write_text("\n".join(markers.names))
    with pytest.raises(FileFormatError, match="rate="):
        read_recording(file)
    again = read_recording(file, rate=50)
    assert_allclose(again.positions, markers.positions)
    assert_allclose(again.time, markers.time)


def test_a_skeleton_is_recognized_by_its_arms(tmp_path, smpl):
    """22 joints are SMPL's body or LAFAN1's: the lengths of the arms decide, and noise is neither."""
    np.savez(tmp_path / "a.npz", joints=smpl.positions, fps=50)
    again = read_recording(tmp_path / "a.npz")
    assert again.names == smpl.names
    assert noted(again, "SMPL body")
    np.savez(tmp_path / "b.npz", joints=np.random.default_rng(0).normal(size=(20, 22, 3)), fps=50)
    with pytest.raises(FileFormatError, match="22 joints"):
        read_recording(tmp_path / "b.npz")


def test_poses_of_smpl_give_the_same_angles_without_the_body_model(tmp_path, made, plain):
    np.savez(tmp_path / "a.npz", **amass(made))
    again = read_recording(tmp_path / "a.npz")
    assert noted(again, "without the body model")
    assert again.rate == pytest.approx(50)
    assert_allclose(angles(again), plain, atol=1e-4)


@pytest.mark.filterwarnings("error")
def test_poses_that_are_unknown_are_missing(tmp_path, made):
    arrays = amass(made)
    poses = arrays["poses"].copy()
    poses[5] = np.nan
    np.savez(tmp_path / "a.npz", **arrays)
    np.savez(tmp_path / "b.npz", **arrays | {"poses": poses})
    expected = read_recording(tmp_path / "a.npz").positions.copy()
    expected[5] = np.nan
    np.testing.assert_allclose(read_recording(tmp_path / "b.npz").positions, expected, atol=1e-12)
    np.savez(tmp_path / "c.npz", **arrays | {"poses": np.full(poses.shape, np.nan)})
    with pytest.raises(FileFormatError):
        read_recording(tmp_path / "c.npz")


@pytest.mark.parametrize("names", [("poses",), ("global_orient", "body_pose")])
def test_poses_as_rotation_matrices(tmp_path, made, names):
    arrays = amass(made)
    np.savez(tmp_path / "vectors.npz", **arrays)
    vectors = arrays.pop("poses").reshape(len(made.time), 52, 3)
    matrices = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(-1, 52, 3, 3)
    parts = [matrices] if len(names) == 1 else [matrices[:, 0], matrices[:, 1:22]]
    np.savez(tmp_path / "matrices.npz", **arrays, **dict(zip(names, parts, strict=True)))
    expected = read_recording(tmp_path / "vectors.npz").positions
    found = read_recording(tmp_path / "matrices.npz").positions
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("kind", ["degrees", "quaternions", "columns", "scaled matrices"])
@pytest.mark.parametrize("is_flat", [False, True])
def test_poses_that_are_no_rotation_vectors_are_rejected(tmp_path, made, kind, is_flat):
    arrays = amass(made)
    count = len(made.time)
    rotations = Rotation.from_rotvec(arrays["poses"].reshape(-1, 3))
    matrices = rotations.as_matrix()
    poses = {
        "degrees": np.degrees(arrays["poses"]).reshape(count, 52, 3),
        "quaternions": rotations.as_quat().reshape(count, 52, 4),
        "columns": matrices[:, :, :2].swapaxes(1, 2).reshape(count, 52, 6),
        "scaled matrices": matrices.reshape(count, 52, 3, 3) * 1.1,
    }[kind]
    if is_flat and kind != "scaled matrices":
        poses = poses.reshape(count, -1)
    np.savez(tmp_path / "a.npz", **arrays | {"poses": poses})
    with pytest.raises(FileFormatError, match="poses"):
        read_recording(tmp_path / "a.npz")


def test_keypoints_of_mediapipe_in_every_layout(tmp_path, made):
    """World landmarks in meters from the hips, y down: names, protocol buffers, a frame a line give the same points."""
    recording = made.recording(mirrored(POINTS["MediaPipe"]))
    timed = landmarks(recording, ORDERS["by_count"][33], DOWN, HIPS)
    first = read_recording(write_json(tmp_path / "a.json", timed))
    assert len(first.names) == 33
    assert first.rate == pytest.approx(50)
    assert noted(first, "below 0.5")
    bone = first.point("right_wrist") - first.point("right_elbow")
    assert_allclose(
        bone, (recording.point("right_wrist") - recording.point("right_elbow")) @ DOWN.T, atol=1e-12
    )
    frames = [frame["pose_world_landmarks"] for frame in timed]
    named = [dict(zip(ORDERS["by_count"][33], frame, strict=True)) for frame in frames]
    for i, content in enumerate(
        (
            frames,
            [{"frame": i, **frame} for i, frame in enumerate(named)],
            [{"landmark": frame} for frame in frames],
            [{"pose_world_landmarks": {"landmark": frame}} for frame in frames],
            [
                {"joints": {name: {"position": point} for name, point in frame.items()}}
                for frame in named
            ],
        )
    ):
        again = read_recording(write_json(tmp_path / f"{i}.json", content), rate=50, unit="m")
        assert again.names == first.names
        assert_allclose(again.point("right_wrist"), first.point("right_wrist"))
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, frames)))
    assert_allclose(read_recording(tmp_path / "a.jsonl", rate=50).positions, first.positions)
    flat = [
        [{"x": 0.5 + p["x"] / 3, "y": 0.5 + p["y"] / 3, "z": p["z"]} for p in frame]
        for frame in frames
    ]
    with pytest.raises(FileFormatError, match="image"):
        read_recording(write_json(tmp_path / "b.json", flat), rate=30)


def test_a_folder_of_openpose(tmp_path, made):
    recording = made.recording(mirrored(POINTS["OpenPose"]))
    names = ORDERS["by_count"][25]
    index = [recording.names.index(name) if name in recording.names else None for name in names]
    for i, places in enumerate(recording.positions[:5]):
        flat = [x for j in index for x in ([*places[j], 0.9] if j is not None else [0, 0, 0, 0])]
        write_json(
            tmp_path / f"walk_{i:012}_keypoints.json",
            {"version": 1.3, "people": [{"pose_keypoints_3d": flat}]},
        )
    again = read_recording(tmp_path, rate=50, unit="m")
    assert_allclose(again.point("RWrist"), recording.point("RWrist")[:5])
    assert np.isnan(again.point("LBigToe")).all()
    two = write_json(tmp_path / "c.json", {"people": [{"pose_keypoints_2d": [1, 2, 0.5] * 25}]})
    with pytest.raises(FileFormatError, match="image"):
        read_recording(two, rate=50)


@pytest.mark.parametrize("order", ["COCO", "human36m"])
def test_the_order_of_seventeen_keypoints_is_recognized(tmp_path, made, order):
    """Of COCO and Human3.6M the one in which arms keep their lengths is used, of the first person."""
    parts = {
        "pelvis": "pelvis",
        "spine": "spine2",
        "thorax": "neck",
        "neck": "neck2",
        "head": "head",
    }
    limbs = {
        "hip": "hip",
        "knee": "knee",
        "ankle": "foot",
        "shoulder": "shoulder",
        "elbow": "elbow",
        "wrist": "wrist",
    }
    parts |= {
        f"{side}_{part}": f"{own}_{side[0]}"
        for side in ("left", "right")
        for part, own in limbs.items()
    }
    parts |= {
        "nose": "nose",
        "left_eye": "eye_l",
        "right_eye": "eye_r",
        "left_ear": "ear_l",
        "right_ear": "ear_r",
    }
    recording = made.recording(
        {name: parts[name] for name in ORDERS.get(order) or ORDERS["by_count"][17]}
    )
    people = [
        [{"keypoints": (places + i).tolist(), "keypoint_scores": [0.9] * 17} for i in (0, 1)]
        for places in recording.positions
    ]
    file = write_json(
        tmp_path / "a.json",
        {"instance_info": [{"frame_id": 1, "instances": one} for one in people]},
    )
    again = read_recording(file, rate=50)
    assert again.names == recording.names
    assert_allclose(again.positions, recording.positions)
    assert noted(again, "several people in 40 frames")


@pytest.mark.parametrize("processor", [84, DEC, MIPS])
@pytest.mark.parametrize(("integer", "analog"), [(False, 0), (False, 3), (True, 0), (True, 3)])
def test_every_kind_of_c3d_is_read(tmp_path, processor, integer, analog):
    writer = Writer(processor, integer, analog)
    file = tmp_path / "a.c3d"
    file.write_bytes(writer.content())
    recording = read_recording(file)
    valid = ~writer.lost
    assert_allclose(recording.positions[valid], writer.points[valid] / 1000, rtol=0, atol=1e-7)
    np.testing.assert_array_equal(np.isnan(recording.positions[..., 0]), writer.lost)
    assert (recording.names, recording.rate) == (LABELS, pytest.approx(50.0))
    if processor != MIPS:  # which ezc3d does not read
        points = ezc3d.c3d(str(file))["data"]["points"][:3]
        assert_allclose(recording.positions[valid], points.T[valid] / 1000, atol=1e-9)


def test_long_c3d_files_state_their_length_elsewhere(tmp_path):
    writer = Writer()
    file = tmp_path / "a.c3d"
    more = writer.group(3, "TRIAL") + writer.parameter(
        3, "ACTUAL_START_FIELD", 2, (2,), writer.short(1, 0)
    )
    more += writer.parameter(3, "ACTUAL_END_FIELD", 2, (2,), writer.short(7, 0))
    file.write_bytes(writer.content(frames=0xFFFF, more=more))
    assert len(read_recording(file)) == 7


def test_missing_points_and_names_of_c3d(tmp_path):
    file = tmp_path / "a.c3d"
    clashing = ("A:RSHO", "B:RSHO", "A:RELB", "B:RELB")
    writer = Writer(frames=10)
    writer.points[3, 0] = writer.points[:, 2] = 0
    file.write_bytes(writer.content())
    recording = read_recording(file)
    assert_allclose(recording.missing, [0.1, 0.1, 1.0, 0.0])
    assert noted(recording, "30.0 %", "always: C7")
    for labels, names in (
        (("Nick01:RSHO", "'Nick01:RELB'", '"C7"', " T10 "), LABELS),
        (clashing, clashing),
    ):
        file.write_bytes(Writer(labels=labels).content())
        assert read_recording(file, unit="mm").names == names


def test_a_misnamed_file_is_read_by_its_content(tmp_path, made, smpl):
    names = mirrored(POINTS["MVNX"])
    np.savez(tmp_path / "a.npz", joints=smpl.positions, fps=50)
    write_bvh(tmp_path / "a.bvh", SKELETONS["LAFAN1"], made)
    write_trc(tmp_path / "a.trc", made.recording(names))
    write_mot(tmp_path / "a.mot", made.time, made.joint_angles, SAUL)
    write_mvnx(tmp_path / "a.mvnx", made.recording(names))
    for file in list(tmp_path.iterdir()):
        other = file.rename(tmp_path / f"{file.suffix[1:]}.txt")
        assert len(read_recording(other)) == len(made.time), other


def test_shipped_recordings():
    for name, frames, rate in (("ladder", 1128, 30), ("freeform", 367, 40), ("both-arms", 367, 40)):
        recording = read_recording(name)
        assert (len(recording), recording.rate) == (frames, pytest.approx(rate, rel=1e-4))
    with pytest.raises(UnknownNameError, match="'ladder'"):
        shipped_recording("leader")
