from dataclasses import replace

import numpy as np
import pytest

from dialect_files import POINTS, SKELETONS, mirrored
from maniport.errors import InvalidInputError, RecordingError, UnknownNameError
from maniport.mocap import Recording, read_recording
from maniport.mocap.roles import assign_roles, find_side, role_position, trunk_rotation

WITHOUT_HAND = ("Unreal", "MediaPipe")  # marker sets of which the point of the hand is not used
SETS = POINTS | {name: skeleton.names for name, skeleton in SKELETONS.items()}


def named(*names):
    """Make a recording of points of these names, each above the last, on its side of the body."""
    positions = np.random.default_rng(0).normal(scale=0.01, size=(2, len(names), 3))
    positions[:, :, 1] += [
        -0.2 if "Right" in name or name[0] == "R" else 0.2 * ("L" in name[0]) for name in names
    ]
    positions[:, :, 2] += 0.1 * np.arange(len(names))
    return Recording(names, positions, [0.0, 0.1], source="some.file")


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("marker_set", [name for name in SETS if name != "ISB without side"])
def test_every_marker_set_is_recognized(made, marker_set, side):
    recording = made.recording(mirrored(SETS[marker_set]))
    roles = assign_roles(recording, side=side)
    assert not {"hand_r"} & set(SETS[marker_set].values()) or ("hand" in roles) == (
        marker_set not in WITHOUT_HAND
    )
    for role in ("shoulder", "elbow", "wrist", *({"hand"} & roles.keys())):
        np.testing.assert_allclose(
            role_position(recording, roles[role]), made.parts[f"{role}_{side[0]}"], atol=1e-12
        )
    for axis, ends in {
        "elbow_axis": ("medial", "lateral"),
        "wrist_axis": ("ulnar", "radial"),
    }.items():
        for group, end in zip(roles.get(axis, ()), ends, strict=axis in roles):
            place = made.parts[f"{axis[:5]}_{end}_{side[0]}"]
            np.testing.assert_allclose(role_position(recording, group), place, atol=1e-12)
    np.testing.assert_allclose(trunk_rotation(recording, roles), made.trunk, atol=1e-9)


@pytest.mark.parametrize(
    "names",
    [
        ("RightShoulder", "RightForeArm", "RightHand"),  # a collarbone
        ("RightArm", "RightElbow", "RightHand"),
        ("Shoulder_Upper", "Elbow_Rest", "Wrist_Band"),
        ("RightShoulder", "RightElbo", "RightWrst"),  # in some marker sets a collarbone
    ],
)
def test_similar_names_are_not_used(names):
    with pytest.raises(RecordingError, match=r"'some.file'.*(shoulder|elbow)"):
        assign_roles(named(*names, "Spine", "Neck", "LeftArm", "LeftShoulder"))


def test_missing_roles_are_listed_with_the_points_of_the_recording():
    with pytest.raises(RecordingError) as caught:
        assign_roles(
            named("RightArm", "Tail", "RightFoarm", "RightHnd", "Neck", "Spine", "LeftArm")
        )
    message = str(caught.value)
    assert "elbow (usually 'RightForeArm'" in message
    assert "wrist (usually 'RightHand'" in message
    assert "shoulder (" not in message
    assert message.index("'RightFoarm'") < message.index("'Tail'")


def test_markers_of_the_user_have_priority():
    markers = {"shoulder": "RFSH", "elbow": ["RELB"], "hand": None, "elbow_axis": ("RIEL", "RELB")}
    roles = assign_roles(read_recording("freeform"), markers)
    assert (roles["shoulder"], roles["elbow"]) == (("RFSH",), ("RELB",))
    assert roles["elbow_axis"] == (("RIEL",), ("RELB",))
    assert "hand" not in roles


@pytest.mark.parametrize(
    ("markers", "error", "words"),
    [
        ({"sholder": "RFSH"}, UnknownNameError, "'shoulder'"),
        ({"shoulder": "RFSX"}, UnknownNameError, "'RFSX' in 'freeform.c3d'.*'RFSH'"),
        ({"shoulder": "CLAV"}, RecordingError, "'CLAV' is missing in every frame"),
        ({"shoulder": []}, InvalidInputError, "one name or a list"),
        ({"elbow": [["RELB"], ["RIEL"]]}, InvalidInputError, "one name or a list"),
        ({"elbow": [[["RELB"]]]}, InvalidInputError, "one name or a list"),
        ({"elbow_axis": "RELB"}, InvalidInputError, "a pair"),
    ],
)
def test_wrong_markers_are_rejected(markers, error, words):
    with pytest.raises(error, match=words):
        assign_roles(read_recording("freeform"), markers)


@pytest.mark.parametrize("anonymous", [False, True])
@pytest.mark.parametrize("wrong", ["arm", "elbow", "trunk"])
def test_points_of_the_other_side_are_rejected(made, wrong, anonymous):
    recording = made.recording(mirrored(SKELETONS["LAFAN1"].names))
    number = {name: f"p{i}" if anonymous else name for i, name in enumerate(recording.names)}
    recording = replace(recording, names=tuple(number.values()))
    arm = {"shoulder": "RightArm", "elbow": "RightForeArm", "wrist": "RightHand"}
    right = {role: number[name] for role, name in arm.items()}
    left = {role: number[name.replace("Right", "Left")] for role, name in arm.items()}
    trunk = {
        "trunk_up": (number["Spine"], number["Neck"]),
        "trunk_left": (number["RightArm"], number["LeftArm"]),
    }
    assert assign_roles(recording, right | trunk)
    change = {
        "arm": left,
        "elbow": {"elbow": left["elbow"]},
        "trunk": {"trunk_left": trunk["trunk_left"][::-1]},
    }
    by_name = (
        "is a point of the left one; give side='left'"
        if not anonymous and wrong != "trunk"
        else "to the left of"
    )
    with pytest.raises(RecordingError, match=f"right arm.*{by_name}"):
        assign_roles(recording, right | trunk | change[wrong])


def two_arms(left, noise):
    """Both arms swing forward and back beside a trunk that walks; the left one `left` times as far."""
    time = np.linspace(0.0, 4.0, 121)
    tracks = {"Hips": np.tile([0, 0, 0.9], (121, 1)), "Neck": np.tile([0, 0, 1.45], (121, 1))}
    for side, y, factor in (("Right", -0.18, 1.0), ("Left", 0.18, left)):
        angle = 0.6 * factor * np.sin(np.pi * time)
        upper, fore = (
            np.stack([np.sin(a), 0 * a, -np.cos(a)], axis=1) for a in (angle, angle + 0.5)
        )
        shoulder = np.tile([0.0, y, 1.4], (121, 1))
        elbow = shoulder + 0.3 * upper
        tracks |= {
            f"{side}Arm": shoulder,
            f"{side}ForeArm": elbow,
            f"{side}Hand": elbow + 0.26 * fore,
        }
    walk = np.stack([1.2 * time, 0.1 * time, 0 * time], axis=1)
    positions = np.stack([track + walk for track in tracks.values()], axis=1)
    return Recording(
        tuple(tracks), positions + np.random.default_rng(0).normal(0, noise, positions.shape), time
    )


@pytest.mark.parametrize("noise", [0.0, 0.002])
@pytest.mark.parametrize(
    ("left", "side"), [(2.0, "left"), (0.5, "right"), (1.05, "right"), (0.95, "right")]
)
def test_of_two_arms_the_one_that_moves_more_is_used(left, side, noise):
    """The wrist with the longer path relative to the trunk decides; up to 10 % the right arm is used."""
    chosen, reason, _ = find_side(two_arms(left, noise))
    assert chosen == side
    assert ("both arms move similarly" if 0.9 < left < 1.1 else "larger motion") in reason
