import numpy as np
import pytest

from dialect_files import POINTS, SKELETONS, mirrored, motion
from maniport.errors import InvalidInputError, RecordingError, UnknownNameError
from maniport.mocap import Recording, read_recording
from maniport.mocap.roles import assign_roles, role_position, trunk_rotation


def named(*names, frames=2):
    """Make a recording of points of these names, each above the last, on its side of the body."""
    positions = np.random.default_rng(0).normal(scale=0.01, size=(frames, len(names), 3))
    positions[:, :, 0] += [0.1 * (name in ("CLAV", "STRN")) for name in names]
    positions[:, :, 1] += [-0.2 if "Right" in name or name[0] == "R" else 0.2 * ("L" in name[0]) for name in names]
    positions[:, :, 2] += 0.1 * np.arange(len(names))
    return Recording(names, positions, np.arange(frames) / 10, source="some.file")


FAMILIES = POINTS | {name: skeleton.names for name, skeleton in SKELETONS.items()}


@pytest.fixture(scope="module")
def made():
    """A right arm moves, a left one hangs, and the trunk turns."""
    return motion()


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("family", [name for name in FAMILIES if name != "ISB without side"])
def test_every_family_of_names_is_known(made, family, side):
    """Under the names of every family the joints of either arm are found, not their neighbours, and the trunk."""
    recording = made.recording(mirrored(FAMILIES[family]))
    roles = assign_roles(recording, side=side)
    for role in ("shoulder", "elbow", "wrist"):
        place = made.parts[f"{role}_{side[0]}"]
        np.testing.assert_allclose(role_position(recording, roles[role]), place, atol=1e-12)
    for axis, ends in {"elbow_axis": ("medial", "lateral"), "wrist_axis": ("ulnar", "radial")}.items():
        if axis in roles:
            for group, end in zip(roles[axis], ends, strict=True):
                place = made.parts[f"{axis[:5]}_{end}_{side[0]}"]
                np.testing.assert_allclose(role_position(recording, group), place, atol=1e-12)
    np.testing.assert_allclose(trunk_rotation(recording, roles), made.trunk, atol=1e-9)


@pytest.mark.parametrize(
    "names",
    [
        ("RightShoulder", "RightForeArm", "RightHand"),  # a collar bone
        ("RightArm", "RightElbow", "RightHand"),
        ("Shoulder_Upper", "Elbow_Rest", "Wrist_Band"),
        ("RightShoulder", "RightElbo", "RightWrst"),  # of some families the collar bone
    ],
)
def test_names_that_are_only_alike_are_not_taken(names):
    """An arm is not put together from the names of different families, nor from parts of names."""
    with pytest.raises(RecordingError, match=r"missing in 'some.file': shoulder|elbow \("):
        assign_roles(named(*names, "Spine", "Neck", "LeftArm", "LeftShoulder"))


def test_missing_roles_are_named_with_the_points_there_are():
    """The error names every missing role, the usual points for it and the points there are, nearest first."""
    with pytest.raises(RecordingError) as caught:
        assign_roles(named("RightArm", "Tail", "RightFoarm", "RightHnd", "Neck", "Spine", "LeftArm"))
    message = str(caught.value)
    assert "some.file" in message
    assert "elbow (usually 'RightForeArm'" in message
    assert "wrist (usually 'RightHand'" in message
    assert "shoulder (" not in message
    assert message.index("'RightFoarm'") < message.index("'Tail'")


def test_own_markers_go_before_the_usual_names():
    """The user's choice decides, one name or several, and None drops a role."""
    recording = read_recording("freeform")
    roles = assign_roles(
        recording, {"shoulder": "RFSH", "elbow": ["RELB"], "hand": None, "elbow_axis": ("RIEL", "RELB")}
    )
    assert (roles["shoulder"], roles["elbow"]) == (("RFSH",), ("RELB",))
    assert roles["elbow_axis"] == (("RIEL",), ("RELB",))
    assert "hand" not in roles


@pytest.mark.parametrize(
    ("markers", "error", "message"),
    [
        ({"sholder": "RFSH"}, UnknownNameError, "unknown role 'sholder' of a point; .*'shoulder'"),
        ({"shoulder": "RFSX"}, UnknownNameError, "unknown point 'RFSX' in 'freeform.c3d'.*'RFSH'"),
        ({"shoulder": "CLAV"}, RecordingError, "'CLAV' is missing in every frame"),
        ({"shoulder": []}, InvalidInputError, "must be one name or a list of names"),
        ({"elbow": [["RELB"], ["RIEL"]]}, InvalidInputError, "must be one name or a list of names"),
        ({"elbow": [[["RELB"]]]}, InvalidInputError, "must be one name or a list of names"),
        ({"elbow_axis": "RELB"}, InvalidInputError, "must be a pair"),
    ],
)
def test_bad_choices_are_refused(markers, error, message):
    """Roles and points that do not exist, are never seen or have the wrong shape are refused."""
    with pytest.raises(error, match=message):
        assign_roles(read_recording("freeform"), markers)


@pytest.mark.parametrize("second", ["trunk_front", "trunk_left"])
def test_trunk_frame_is_a_rotation_with_its_axes_where_they_belong(second):
    """Columns are orthonormal and right-handed; z follows the spine, x the front, y the left side."""
    points = {"low": [0, 0, 0], "high": [0, 0.1, 1], "back": [-1, 0, 0], "front": [1, 0, 0.3], "right": [0, -1, 0],
              "left": [0.2, 1, 0]}  # fmt: skip
    recording = Recording(tuple(points), np.array([list(points.values())], dtype=float), [0.0])
    pair = {"trunk_front": (("back",), ("front",)), "trunk_left": (("right",), ("left",))}[second]
    rotation = trunk_rotation(recording, {"trunk_up": (("low",), ("high",)), second: pair})[0]
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)
    assert np.all(np.diag(rotation) > 0.9)
