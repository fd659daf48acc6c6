"""Names of many programs and laboratories: the roles of their points, and what is said where they are unknown."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.errors import FileFormatError, InvalidInputError, RecordingError, UnknownNameError
from maniport.mocap import Recording, fit_arm, read_recording
from maniport.mocap.point_names import other_side, side_of
from maniport.mocap.roles import assign_roles, find_roles, role_position

CASES = Path(__file__).parent / "cases"
TRUTH = np.load(CASES / "truth_control.npz")
CONTROL = (CASES / "control.bvh").read_text(encoding="utf-8")
ROLES = {"shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand"}
SIDES = ("right", "left")
MIDDLE = ("Hips", "Spine", "Spine1", "Neck", "Head")
JOINTS = ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")


def true_position(name):
    return TRUTH["positions"][:, TRUTH["names"].tolist().index(name)]


def check_arms(recording, frames=slice(None)):
    """Compare the points of all roles of both arms with the truth, in meters."""
    for side in SIDES:
        roles = assign_roles(recording, side=side)
        for role, joint in ROLES.items():
            expected = true_position(f"{side.title()}{joint}")[: len(recording)]
            assert_allclose(role_position(recording, roles[role]), expected, atol=1e-4)
        right, left = (role_position(recording, group) for group in roles["trunk_left"])
        assert_allclose(right, true_position("RightArm")[: len(recording)], atol=1e-4)
        assert_allclose(left, true_position("LeftArm")[: len(recording)], atol=1e-4)
        low, high = (role_position(recording, group) for group in roles["trunk_up"])
        assert ((high - low)[:, 1] > 0.1).all()
    assert find_roles(recording.observed, "right")[0] == find_roles(recording.observed, "left")[0]
    assert recording.quality_warnings == ()


def renamed(tmp_path, names, control=CONTROL, frames=20):
    """Write the skeleton of the control under other names, its first frames."""
    head, _, motion = control.partition("Frame Time:")
    for joint, name in names.items():
        head = re.sub(rf"(ROOT|JOINT) {joint}\n", rf"\1 {name}\n", head)
    head = re.sub(r"Frames: \d+", f"Frames: {frames}", head)
    file = tmp_path / "renamed.bvh"
    rows = motion.splitlines()[: frames + 1]
    file.write_text(head + "Frame Time:" + "\n".join(rows) + "\n", encoding="utf-8")
    return file


def spelled(middle, joints, side_words=("Right", "Left"), pattern="{side}{joint}"):
    """Return the names of all joints of the control, by its own names."""
    names = dict(zip(MIDDLE, middle, strict=True))
    for own, word in zip(("Right", "Left"), side_words, strict=True):
        for joint, name in zip(JOINTS, joints, strict=True):
            names[own + joint] = pattern.format(side=word, joint=name)
    return names


OWN = spelled(MIDDLE, JOINTS)


def added(before="", behind="", but=()):
    """Return names with the same text before and behind all but some."""
    return {name: name if name in but else f"{before}{name}{behind}" for name in OWN}


FAMILIES = {
    "mixamorig5:": added("mixamorig5:"),
    "mixamorig1 without a colon": added("mixamorig1"),
    "Armature_": added("Armature_"),
    "Armature|mixamorig:": added("Armature|mixamorig:"),
    "Character1_ but the root": added("Character1_", but=("Hips",)),
    "any prefix": added("Bob_rig_v2_"),
    "any prefix, any suffix": added("x.", "_bone"),
    "different numbers behind": {name: f"{name}_{i:03}" for i, name in enumerate(OWN)},
    "Blender's numbers, not all equal": {
        name: f"{name}.{1 + (i % 3 > 1):03}" for i, name in enumerate(OWN)
    },
    "Genesis 9": spelled(
        ("hip", "spine1", "spine3", "neck1", "head"),
        ("shoulder", "upperarm", "forearm", "hand", "thigh", "shin", "foot"),
        ("r", "l"),
        "{side}_{joint}",
    ),
    "Character Creator": spelled(
        ("CC_Base_Hip", "CC_Base_Waist", "CC_Base_Spine01", "CC_Base_NeckTwist01", "CC_Base_Head"),
        ("Clavicle", "Upperarm", "Forearm", "Hand", "Thigh", "Calf", "Foot"),
        ("R", "L"),
        "CC_Base_{side}_{joint}",
    ),
    "MakeHuman": spelled(
        ("root", "spine05", "spine02", "neck01", "head"),
        ("clavicle", "upperarm01", "lowerarm01", "wrist", "upperleg01", "lowerleg01", "foot"),
        ("R", "L"),
        "{joint}.{side}",
    ),
    "Valve": spelled(
        tuple(
            f"ValveBiped.Bip01_{name}" for name in ("Pelvis", "Spine", "Spine2", "Neck1", "Head1")
        ),
        ("Clavicle", "UpperArm", "Forearm", "Hand", "Thigh", "Calf", "Foot"),
        ("R", "L"),
        "ValveBiped.Bip01_{side}_{joint}",
    ),
    "3ds Max Biped": spelled(
        ("Bip001", "Bip001 Spine", "Bip001 Spine1", "Bip001 Neck", "Bip001 Head"),
        ("Clavicle", "UpperArm", "Forearm", "Hand", "Thigh", "Calf", "Foot"),
        ("R", "L"),
        "Bip001 {side} {joint}",
    ),
    "Rigify, deform bones": spelled(
        ("DEF-spine", "DEF-spine.001", "DEF-spine.002", "DEF-spine.004", "DEF-spine.006"),
        ("shoulder", "upper_arm", "forearm", "hand", "thigh", "shin", "foot"),
        ("R", "L"),
        "DEF-{joint}.{side}",
    ),
    "Rigify, metarig": spelled(
        ("spine", "spine.001", "spine.002", "spine.004", "spine.006"),
        ("shoulder", "upper_arm", "forearm", "hand", "thigh", "shin", "foot"),
        ("R", "L"),
        "{joint}.{side}",
    ),
    "MikuMikuDance": spelled(
        ("センター", "上半身", "上半身2", "首", "頭"),
        ("肩", "腕", "ひじ", "手首", "足", "ひざ", "足首"),
        ("右", "左"),
    ),
    "MikuMikuDance in Blender": spelled(
        ("センター", "上半身", "上半身２", "首", "頭"),
        ("肩", "腕", "ひじ", "手首", "足", "ひざ", "足首"),
        ("R", "L"),
        "{joint}.{side}",
    ),
    "MikuMikuDance, English": spelled(
        ("center", "upper body", "upper body 2", "neck", "head"),
        ("shoulder", "arm", "elbow", "wrist", "leg", "knee", "ankle"),
        ("R", "L"),
        "{joint}_{side}",
    ),
    "VRM 1": spelled(
        ("hips", "spine", "chest", "neck", "head"),
        ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot"),
        ("right", "left"),
    ),
    "VRoid": spelled(
        tuple(f"J_Bip_C_{name}" for name in ("Hips", "Spine", "Chest", "Neck", "Head")),
        ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot"),
        ("R", "L"),
        "J_Bip_{side}_{joint}",
    ),
    "Unreal": spelled(
        ("pelvis", "spine_01", "spine_03", "neck_01", "head"),
        ("clavicle", "upperarm", "lowerarm", "hand", "thigh", "calf", "foot"),
        ("r", "l"),
        "{joint}_{side}",
    ),
    "SMPL in Unreal": spelled(
        ("f_avg_Pelvis", "f_avg_Spine1", "f_avg_Spine3", "f_avg_Neck", "f_avg_Head"),
        ("Collar", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle"),
        ("R", "L"),
        "f_avg_{side}_{joint}",
    ),
}


@pytest.mark.parametrize("file", sorted(CASES.glob("names_*.bvh")), ids=lambda file: file.stem)
def test_skeletons_of_programs_are_recognized(file):
    recording = read_recording(file)
    assert "unit recognized as cm" in recording.notes[0]
    check_arms(recording)
    fit = fit_arm(recording)
    assert fit.arm.side == "right"
    assert fit.segment_lengths["upper arm"] == pytest.approx(0.290, abs=1e-3)
    assert fit.segment_lengths["forearm"] == pytest.approx(0.260, abs=1e-3)


@pytest.mark.parametrize("family", FAMILIES)
def test_further_names_are_recognized(tmp_path, family):
    recording = read_recording(renamed(tmp_path, FAMILIES[family]))
    assert "unit recognized as cm" in recording.notes[0]
    check_arms(recording)


MARKERS = {
    "gait2392": {
        "shoulder": ["R.Acromium"],
        "elbow": ["R.Elbow"],
        "wrist": ["R.Wrist.Lat", "R.Wrist.Med"],
        "trunk_up": (["V.Sacral"], ["R.Acromium", "L.Acromium"]),
        "trunk_left": (["R.Acromium"], ["L.Acromium"]),
    },
    "rajagopal": {
        "shoulder": ["R.Shoulder"],
        "elbow": ["R.Elbow"],
        "wrist": ["R.Wrist"],
        "trunk_up": (["R.ASIS", "L.ASIS", "R.PSIS", "L.PSIS"], ["R.Shoulder", "L.Shoulder"]),
        "trunk_left": (["R.Shoulder"], ["L.Shoulder"]),
    },
    "isb_qualisys": {
        "shoulder": ["R_SAJ"],
        "elbow": ["R_HLE", "R_HME"],
        "elbow_axis": (["R_HME"], ["R_HLE"]),
        "wrist": ["R_RSP", "R_USP"],
        "wrist_axis": (["R_USP"], ["R_RSP"]),
        "trunk_up": (["TV8", "SXS"], ["CV7", "SJN"]),
        "trunk_front": (["CV7", "TV8"], ["SJN", "SXS"]),
        "trunk_left": (["R_SAJ"], ["L_SAJ"]),
    },
    "stanford_lab": {
        "shoulder": ["R_Shoulder"],
        "elbow": ["R_elbow_lat", "R_elbow_med"],
        "elbow_axis": (["R_elbow_med"], ["R_elbow_lat"]),
        "wrist": ["R_wrist_radius", "R_wrist_ulna"],
        "wrist_axis": (["R_wrist_ulna"], ["R_wrist_radius"]),
        "trunk_up": (["r.PSIS", "L.PSIS"], ["C7"]),
        "trunk_left": (["R_Shoulder"], ["L_Shoulder"]),
    },
}


@pytest.mark.parametrize("family", MARKERS)
def test_markers_of_laboratories_are_recognized(family):
    recording = read_recording(CASES / f"markers_{family}.trc")
    roles = assign_roles(recording, side="right")
    left = assign_roles(recording, side="left")
    for role, names in MARKERS[family].items():
        is_pair = isinstance(names, tuple)
        expected = tuple(map(tuple, names)) if is_pair else tuple(names)
        assert roles[role] == expected
        if not role.startswith("trunk"):
            groups = expected if is_pair else (expected,)
            mirrored = tuple(tuple(map(other_side, group)) for group in groups)
            assert left[role] == (mirrored if is_pair else mirrored[0])
    assert set(roles) - set(MARKERS[family]) <= {"wrist_axis"}
    shoulder, elbow, wrist = (
        role_position(recording, roles[role]) for role in ("shoulder", "elbow", "wrist")
    )
    assert np.median(np.linalg.norm(elbow - shoulder, axis=1)) == pytest.approx(0.31, abs=0.02)
    assert np.median(np.linalg.norm(wrist - elbow, axis=1)) == pytest.approx(0.26, abs=0.01)
    assert fit_arm(recording).arm.side == "right"


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (("SACR",), ("C7",)),
        (("S2",), ("R.Clavicle", "L.Clavicle")),
        (("RASI", "LASI"), ("Sternum",)),
        (("RASIS", "LASIS", "RPSIS", "LPSIS"), ("CLAV",)),
        (("Pelvis",), ("RSHO", "LSHO")),
        (("RThigh", "LThigh"), ("RSHO", "LSHO")),
    ],
)
def test_the_trunk_goes_from_any_pelvis_to_any_shoulders(low, high):
    arms = ("RSHO", "RELB", "RWRA", "RWRB")
    names = tuple(dict.fromkeys((*arms, *low, *high)))
    roles = find_roles(names)[1]
    assert roles["trunk_up"] == (low, high)


def test_a_prefix_of_the_side_is_no_addition():
    """Of one arm all names may begin with R; without it they would be those of a set without sides."""
    right = ("RGH", "REL", "REM", "RRS", "RUS")
    assert find_roles(right, "left")[1].keys().isdisjoint({"shoulder", "elbow", "wrist"})


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("Armature|RightHand", "Armature|LeftHand"),
        ("m_avg_R_Wrist", "m_avg_L_Wrist"),
        ("rhand", "lhand"),
        ("右ひじ", "左ひじ"),
        ("ひじ.R", "ひじ.L"),
        ("UpperArmR", "UpperArmL"),
        ("Bip01 R Hand", "Bip01 L Hand"),
        ("EndSiteA:RHand", "EndSiteA:LHand"),
        ("root", "root"),
        ("lumbar", "lumbar"),
        ("C7", "C7"),
        ("ring", "ring"),
    ],
)
def test_names_of_the_other_side(name, other):
    assert other_side(name) == other
    assert other_side(other) == name
    assert side_of(name) == ("" if name == other else "right")


UNKNOWN = spelled(
    ("b0", "b1", "b2", "b3", "b4"),
    ("Clav", "UpperSeg", "LowerSeg", "Paw", "HindA", "HindB", "HindC"),
    ("r", "l"),
)
ASSIGNED = {
    "shoulder": ["rUpperSeg"],
    "elbow": ["rLowerSeg"],
    "wrist": ["rPaw"],
    "trunk_up": [["b0"], ["b3"]],
    "trunk_left": [["rUpperSeg"], ["lUpperSeg"]],
}


def test_unknown_names_are_one_error_about_the_roles(tmp_path, run):
    file = renamed(tmp_path, UNKNOWN)
    with pytest.raises(FileFormatError) as caught:
        read_recording(file)
    text = str(caught.value)
    for role in ("shoulder", "elbow", "wrist", "trunk_up", "trunk_left"):
        assert f"{role} (" in text
    assert "unit" not in text
    assert text.index("'rUpperSeg'") < text.index("'rLowerSeg'")
    for side, own, theirs in (("right", "'r", "'l"), ("left", "'l", "'r")):
        code, _, err = run("info", file, "--side", side)
        assert code != 0
        likely = re.findall(r"here perhaps ('[^)]*)\)", err)[:3]
        assert all(first.startswith(own) and theirs not in first for first in likely)


@pytest.mark.parametrize("both", [False, True])
def test_a_complete_file_of_markers_needs_no_unit(tmp_path, run, both):
    file = renamed(tmp_path, UNKNOWN)
    left = {
        role: ["l" + name[1:] for name in names]
        for role, names in ASSIGNED.items()
        if "trunk" not in role
    }
    markers = {"right": ASSIGNED, "left": ASSIGNED | left} if both else ASSIGNED
    recording = read_recording(file, markers=markers)
    assert_allclose(recording.point("rPaw"), true_position("RightHand")[:20], atol=1e-4)
    if not both:
        (tmp_path / "markers.json").write_text(json.dumps(markers))
        code, out, err = run("info", file, "--markers", tmp_path / "markers.json")
        assert code == 0, err
        assert "complete, upper arm 0.290 m, forearm 0.260 m" in out


def test_everything_that_is_missing_is_one_message(tmp_path):
    points = np.zeros((3, 2, 3)) + np.arange(2)[:, None]
    np.savez(tmp_path / "a.npz", names=["p1", "p2"], positions=points)
    with pytest.raises(FileFormatError) as caught:
        read_recording(tmp_path / "a.npz")
    assert "rate=" in str(caught.value)
    assert "shoulder (" in str(caught.value)


def test_wrong_markers_keep_their_error(tmp_path):
    with pytest.raises(UnknownNameError, match="rPaww"):
        read_recording(renamed(tmp_path, UNKNOWN), markers=ASSIGNED | {"wrist": "rPaww"})


def test_candidates_are_anatomical(tmp_path):
    """Words of anatomy and geometry come before similar letters; no face and no other side is for a wrist."""
    face = {"LeftFoot": "risorius02.R", "RightFoot": "oris04.R", "RightLeg": "temporalis01.R"}
    names = spelled(MIDDLE, ("Shoulder", "Arm", "ForeArm", "Carpus", "UpLeg", "Leg", "Foot"))
    recording = read_recording(renamed(tmp_path, names | face))
    with pytest.raises(RecordingError) as caught:
        assign_roles(recording, side="right")
    likely = re.search(r"wrist \(.*?here perhaps (.*?)\)", str(caught.value))[1]
    assert likely.split(", ")[0] == "'RightCarpus'"
    for wrong in ("Left", "risorius", "oris", "temporalis"):
        assert wrong not in likely


def test_geometry_ranks_candidates_without_words(tmp_path):
    names = OWN | {"RightHand": "m17", "LeftHand": "m18", "Head": "m19"}
    recording = read_recording(renamed(tmp_path, names))
    with pytest.raises(RecordingError) as caught:
        assign_roles(recording, side="right")
    likely = re.search(r"wrist \(.*?here perhaps (.*?)\)", str(caught.value))[1]
    assert likely.split(", ")[0] == "'m17'"


@pytest.mark.parametrize("options", [{"unit": 100}, {"unit": 1e2}, {"height": 1.75}])
def test_a_recording_in_any_scale_is_read(options):
    recording = read_recording(CASES / "scaled_1e-4.bvh", **options)
    tolerance = 1e-3 if "unit" in options else 0.02
    for name in ("RightHand", "LeftForeArm", "Neck"):
        assert_allclose(recording.point(name), true_position(name), rtol=tolerance, atol=1.5e-3)
    fit = fit_arm(recording)
    assert fit.segment_lengths["upper arm"] == pytest.approx(0.29, rel=tolerance)


def test_the_error_about_a_scale_names_options_that_read_it(run):
    file = CASES / "scaled_1e-4.bvh"
    code, _, err = run("info", file)
    assert code != 0
    assert "--unit" in err
    assert "--height 1.75" in err
    for words in (("--unit", "100"), ("--height", "1.75")):
        code, out, err = run("info", file, *words)
        assert code == 0, err
        assert "complete, upper arm 0.29" in out


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"unit": 0.0}, "unit"),
        ({"unit": -1}, "unit"),
        ({"unit": "yard"}, "unit"),
        ({"height": 175}, "height"),
        ({"unit": "m", "height": 1.7}, "exclude"),
        ({"height": np.nan}, "height"),
        ({"unit": 1e-9}, "upper arm"),
    ],
)
def test_wrong_scales_are_rejected(options, word):
    with pytest.raises((InvalidInputError, FileFormatError), match=word):
        read_recording(CASES / "scaled_1e-4.bvh", **options)


def test_the_height_replaces_the_unit_of_a_file(tmp_path):
    control = read_recording(CASES / "control.bvh")
    Recording(control.names, control.positions * 3.0, control.time).save(tmp_path / "a.npz")
    with pytest.raises(FileFormatError, match="possible are"):
        read_recording(tmp_path / "a.npz")
    lengths = fit_arm(read_recording(tmp_path / "a.npz", height=1.70)).segment_lengths
    assert lengths["upper arm"] + lengths["forearm"] == pytest.approx(
        1.70 * 0.5506 / 1.741, rel=1e-3
    )
