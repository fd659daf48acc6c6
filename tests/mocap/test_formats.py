"""The same motion, written in every format, gives the same points and joint angles."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dialect_files import POINTS, SKELETONS, mirrored, motion, write_bvh
from format_files import DOWN, HIPS, SAUL, amass, landmarks, write_csv, write_json, write_mot, write_mvnx, write_trc
from maniport.errors import FileFormatError
from maniport.mocap import fit_arm, read_recording
from maniport.mocap.marker_sets import load_names

TRUNK = {"trunk_low": "pelvis", "trunk_high": "neck", "trunk_right": "shoulder_r", "trunk_left": "shoulder_l"}
JOINTS = {"shoulder": "shoulder_r", "elbow": "elbow_r", "wrist": "wrist_r"}
CLIMB = Path(__file__).parent / "data" / "climb.npy"
RAJAGOPAL = ("arm_flex", "arm_add", "arm_rot", "elbow_flex", "pro_sup")

ORDERS = load_names("joint_orders.yaml")


@pytest.fixture(scope="module")
def made():
    """A right arm moves."""
    return motion()


@pytest.fixture(scope="module")
def smpl(made):
    """Positions of a body of 22 joints, in the order of SMPL, metres."""
    parts = mirrored(POINTS["SMPL-X"]) | {"left_knee": "knee_l", "right_knee": "knee_r", "left_ankle": "foot_l",
             "right_ankle": "foot_r", "left_foot": "toe_l", "right_foot": "toe_r"}  # fmt: skip
    return made.recording({name: parts[name] for name in ORDERS["skeletons"]["SMPL body"]})


def angles(recording, **more):
    """Joint angles by shoulder, elbow, wrist and trunk alone."""
    return fit_arm(recording, markers={"hand": None, "elbow_axis": None, "wrist_axis": None, **more}).joint_angles


# ---- tables of points ---------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:the model of the arm and the person differ")
def test_trc_of_the_shipped_c3d_is_the_c3d(tmp_path):
    """Points, drop-outs, times and joint angles are the same, to the micrometre that is written."""
    c3d = read_recording("freeform").crop(0, 1)
    trc = read_recording(write_trc(tmp_path / "a.trc", c3d, "mm", 0.001))
    seen = [i for i, name in enumerate(c3d.names)]
    assert_allclose(trc.positions[:, seen], c3d.positions, atol=1e-9)
    assert_allclose(trc.time, c3d.time, atol=1e-9)
    assert (trc.names, trc.up) == (c3d.names, c3d.up)
    assert any("missing" in note for note in trc.notes)
    assert_allclose(fit_arm(trc).joint_angles, fit_arm(c3d).joint_angles, atol=1e-6)


@pytest.mark.parametrize("options", [{}, {"dot": True}, {"long": True}])
def test_csv_in_both_layouts(tmp_path, made, options):
    """A row for each frame, or for each point; an empty field is missing."""
    recording = made.recording(mirrored(POINTS["MediaPipe"]))
    holes = recording.positions.copy()
    holes[3, 1] = np.nan
    recording = type(recording)(recording.names, holes, recording.time, "z")
    again = read_recording(write_csv(tmp_path / "a.csv", recording, **options))
    assert again.names == recording.names
    assert_allclose(again.positions, recording.positions, atol=1e-6)
    assert again.rate == pytest.approx(50)


def test_csv_says_what_its_columns_must_be(tmp_path):
    """A table of something else, a column that is missing, and a point that stands twice are named."""
    file = tmp_path / "a.csv"
    for text, told in (
        ("date,price\n1,2\n", "a table of points has a line of names first"),
        ("time,elbow_x,elbow_y\n0,1,2\n", "no column elbow_z"),
        ("time,elbow_x,elbow_y,elbow_z\n0,1,2\n", "cut off at line 2"),
        ("time,elbow_x,elbow_y,elbow_z\n0,1,2,a\n", "line 2: could not convert"),
        ("time,name,x,y,z\n0,a,1,2,3\n0,a,1,2,3\n", "line 3: this point stands twice"),
        ("elbow_x,elbow_y,elbow_z\n1,2,3\n", "unit of length cannot be recognised"),
    ):
        file.write_text(text)
        with pytest.raises(FileFormatError, match=told):
            read_recording(file)


def test_mvnx_holds_where_segments_begin(tmp_path, made):
    """Segments' origins are the joints; the identity frame in front is none of the motion."""
    recording = made.recording(mirrored(POINTS["MVNX"]))
    again = read_recording(write_mvnx(tmp_path / "a.mvnx", recording))
    assert_allclose(again.positions, recording.positions, atol=1e-6)
    assert (again.names, again.up, len(again)) == (recording.names, "z", len(recording))
    assert_allclose(angles(again), angles(made.recording({**JOINTS, **TRUNK})), atol=2e-4)


# ---- joint angles -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [True, False])
def test_joint_angles_of_saul_come_back(tmp_path, made, degrees):
    """What OpenSim writes with the coordinates of Saul et al. is found again, to a tenth of a degree."""
    file = write_mot(tmp_path / "a.mot", made.time, made.joint_angles, SAUL, degrees)
    fit = fit_arm(read_recording(file))
    assert fit.determined.all()
    assert_allclose(np.degrees(fit.joint_angles), np.degrees(made.joint_angles), atol=0.1)


def test_joint_angles_of_rajagopal_mean_postures_that_everybody_knows(tmp_path):
    """Flexion points forward, abduction to the side, half pronation turns the thumb forward; the left arm mirrors."""
    poses = np.radians([[0, 0, 0, 0, 90], [90, 0, 0, 0, 90], [0, -90, 0, 0, 90], [0, 0, 0, 90, 90]])
    names = [f"{name}_{side}" for side in "rl" for name in RAJAGOPAL]
    file = write_mot(tmp_path / "a.sto", np.arange(4) / 10, np.tile(poses, 2), names)
    recording = read_recording(file)
    upper = recording.point("right_elbow") - recording.point("right_shoulder")
    upper /= np.linalg.norm(upper, axis=1, keepdims=True)
    assert_allclose(upper, [[0, 0, -1], [1, 0, 0], [0, -1, 0], [0, 0, -1]], atol=0.06)
    fore = recording.point("right_hand") - recording.point("right_elbow")
    assert fore[3, 0] > 0.25 > abs(fore[3, 2])
    thumb = recording.point("right_wrist_radial") - recording.point("right_wrist_ulnar")
    assert thumb[0, 0] > 0.05
    mirror = np.array([1.0, -1.0, 1.0])
    assert_allclose(recording.point("left_hand"), recording.point("right_hand") * mirror, atol=1e-12)


def test_names_beside_an_array_and_a_rate_of_the_users(tmp_path, made):
    """An array alone needs names and a rate; each is asked for."""
    recording = made.recording(mirrored(POINTS["SMPL"]))
    file = tmp_path / "clip.npy"
    np.save(file, recording.positions[:, :9])
    with pytest.raises(FileFormatError, match=r"9 joints without names.*'clip.names.txt'"):
        read_recording(file, rate=50)
    np.save(file, recording.positions)
    (tmp_path / "clip.names.txt").write_text("\n".join(recording.names))
    with pytest.raises(FileFormatError, match="give rate="):
        read_recording(file)
    again = read_recording(file, rate=50)
    assert_allclose(again.positions, recording.positions)
    assert_allclose(again.time, recording.time)


def test_a_skeleton_is_known_by_its_number_when_its_arms_are_arms(tmp_path, smpl):
    """22 joints are SMPL's body or LAFAN1's: the lengths of the arms decide, and noise is neither."""
    np.savez(tmp_path / "a.npz", joints=smpl.positions, fps=50)
    again = read_recording(tmp_path / "a.npz")
    assert again.names == smpl.names
    assert any("SMPL body" in note for note in again.notes)
    np.savez(tmp_path / "b.npz", joints=np.random.default_rng(0).normal(size=(20, 22, 3)), fps=50)
    with pytest.raises(FileFormatError, match="22 joints without names"):
        read_recording(tmp_path / "b.npz")


def test_poses_of_smpl_give_the_same_angles_without_the_body_model(tmp_path, made):
    """Bone directions follow from the rotations; lengths are not the person's, and a note says so."""
    np.savez(tmp_path / "a.npz", **amass(made))
    again = read_recording(tmp_path / "a.npz")
    assert any("without the body model" in note for note in again.notes)
    assert again.rate == pytest.approx(50)
    assert_allclose(angles(again), angles(made.recording({**JOINTS, **TRUNK})), atol=1e-4)


def test_mediapipe_world_landmarks(tmp_path, made):
    """Metres from the hips, y down; what is not visible is missing."""
    recording = made.recording(mirrored(POINTS["MediaPipe"]))
    frames = landmarks(recording, ORDERS["by_count"][33], DOWN, HIPS)
    again = read_recording(write_json(tmp_path / "a.json", frames))
    assert (again.up, len(again.names)) == ("-y", 33)
    assert again.rate == pytest.approx(50)
    assert any("less than 0.5" in note for note in again.notes)
    shown = again.point("right_wrist") - again.point("right_elbow")
    assert_allclose(shown, (recording.point("right_wrist") - recording.point("right_elbow")) @ DOWN.T, atol=1e-12)
    flat = [{"landmarks": [{"x": 0.5 + p["x"] / 3, "y": 0.5 + p["y"] / 3, "z": p["z"]}
                           for p in frame["pose_world_landmarks"]]} for frame in frames]  # fmt: skip
    with pytest.raises(FileFormatError, match=r"places in a picture.*pose_world_landmarks"):
        read_recording(write_json(tmp_path / "b.json", flat), rate=30)


def test_openpose_folder_and_its_2d(tmp_path, made):
    """A file for each frame, in the order of their names; keypoints of the picture are refused with what to do."""
    recording = made.recording(mirrored(POINTS["OpenPose"]))
    names = ORDERS["by_count"][25]
    index = [recording.names.index(name) if name in recording.names else None for name in names]
    for i, places in enumerate(recording.positions[:5]):
        flat = [x for j in index for x in ([*places[j], 0.9] if j is not None else [0, 0, 0, 0])]
        write_json(tmp_path / f"walk_{i:012}_keypoints.json", {"version": 1.3, "people": [{"pose_keypoints_3d": flat}]})
    again = read_recording(tmp_path, rate=50, unit="m", up="z")
    assert_allclose(again.point("RWrist"), recording.point("RWrist")[:5])
    assert np.isnan(again.point("LBigToe")).all()
    two = write_json(tmp_path / "c.json", {"people": [{"pose_keypoints_2d": [1, 2, 0.5] * 25}]})
    with pytest.raises(FileFormatError, match="places in a picture, not in space"):
        read_recording(two, rate=50)


def test_keypoints_as_people_write_them(tmp_path, made):
    """Names in the frame itself, protocol buffers, a frame a line, places within: the same points."""
    recording = made.recording(mirrored(POINTS["MediaPipe"]))
    frames = [frame["pose_world_landmarks"] for frame in landmarks(recording, ORDERS["by_count"][33], DOWN, HIPS)]
    named = [dict(zip(ORDERS["by_count"][33], frame, strict=True)) for frame in frames]
    wanted = read_recording(write_json(tmp_path / "a.json", frames), rate=50)
    for i, content in enumerate((
        [{"frame": i, **frame} for i, frame in enumerate(named)],
        [{"landmark": frame} for frame in frames],
        [{"pose_world_landmarks": {"landmark": frame}} for frame in frames],
        [{"joints": {name: {"position": point} for name, point in frame.items()}} for frame in named],
    )):  # fmt: skip
        again = read_recording(write_json(tmp_path / f"{i}.json", content), rate=50, unit="m")
        assert again.names == wanted.names
        assert_allclose(again.point("right_wrist"), wanted.point("right_wrist"))
    lines = tmp_path / "a.jsonl"
    lines.write_text("\n".join(map(json.dumps, frames)))
    assert_allclose(read_recording(lines, rate=50).positions, wanted.positions)


def test_seventeen_keypoints_are_those_that_make_arms(tmp_path, made):
    """COCO and Human3.6M have as many: the one in which arms keep their lengths is taken, of the first person."""
    parts = {"pelvis": "pelvis", "spine": "spine2", "thorax": "neck", "neck": "neck2", "head": "head"}
    limbs = {"hip": "hip", "knee": "knee", "ankle": "foot", "shoulder": "shoulder", "elbow": "elbow", "wrist": "wrist"}
    parts |= {f"{side}_{part}": f"{own}_{side[0]}" for side in ("left", "right") for part, own in limbs.items()}
    parts |= {"nose": "nose", "left_eye": "eye_l", "right_eye": "eye_r", "left_ear": "ear_l", "right_ear": "ear_r"}
    for order in (ORDERS["human36m"], ORDERS["by_count"][17]):
        recording = made.recording({name: parts[name] for name in order})
        people = [[{"keypoints": (places + i).tolist(), "keypoint_scores": [0.9] * 17} for i in (0, 1)]
                  for places in recording.positions]  # fmt: skip
        file = write_json(tmp_path / "a.json", {"instance_info": [{"frame_id": 1, "instances": one} for one in people]})
        again = read_recording(file, rate=50)
        assert again.names == tuple(order)
        assert_allclose(again.positions, recording.positions)
        assert any("several people in 40 frames" in note for note in again.notes)


# ---- what a file is -----------------------------------------------------------------------------------------------


def test_a_misnamed_file_is_read_by_its_content(tmp_path, made, smpl):
    """Whatever the ending says."""
    names = mirrored(POINTS["MVNX"])
    np.savez(tmp_path / "a.npz", joints=smpl.positions, fps=50)
    write_bvh(tmp_path / "a.bvh", SKELETONS["LAFAN1"], made)
    write_trc(tmp_path / "a.trc", made.recording(names))
    write_mot(tmp_path / "a.mot", made.time, made.joint_angles, SAUL)
    write_mvnx(tmp_path / "a.mvnx", made.recording(names))
    for file in list(tmp_path.iterdir()):
        other = file.rename(tmp_path / f"{file.suffix[1:]}.txt")
        assert len(read_recording(other)) == len(made.time), other


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.fbx", b"Kaydara FBX Binary  \0", "FBX.*Blender.*Export"),
        ("a.bvh.gz", b"\x1f\x8b\x08", "gunzip"),
        ("a.pkl", b"\x80\x04\x95", "np.savez"),
        ("arm.urdf", b"<robot name='arm'/>", "--robot"),
        ("a.glb", b"glTF\2\0\0\0", "Blender"),
        ("a.xlsx", b"PK\3\4", "save it as CSV"),
        ("a.mp4", b"\0\0\0\x18ftypmp42", "MediaPipe"),
        ("a.odd", b"nothing", "'.odd' is not known; allowed are .bvh, .c3d"),
    ],
)
def test_what_is_not_read_is_told_how_to_convert(tmp_path, name, content, told):
    """One sentence that names the file, the kind and the way."""
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileFormatError, match=told) as caught:
        read_recording(tmp_path / name)
    assert name in str(caught.value)
