import numpy as np
import pytest

from maniport.demonstrations import Recording, read_recording
from maniport.demonstrations.roles import assign_roles, role_position, trunk_rotation
from maniport.errors import InvalidInputError, RecordingError, UnknownNameError


def named(*names, frames=2):
    """Make a recording of points of these names at random places."""
    positions = np.random.default_rng(0).normal(size=(frames, len(names), 3))
    return Recording(names, positions, np.arange(frames) / 10, source="some.file")


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (
            ("RightArm", "RightForeArm", "RightHand", "Neck", "Spine", "LeftArm"),
            {"shoulder": ("RightArm",), "trunk_up": (("Spine",), ("Neck",)),
             "trunk_left": (("RightArm",), ("LeftArm",))},
        ),
        (
            ("mixamorig:RightArm", "mixamorig:RightForeArm", "mixamorig:RightHand", "mixamorig:RightHandMiddle1",
             "mixamorig:Spine", "mixamorig:Neck", "mixamorig:LeftArm"),
            {"wrist": ("mixamorig:RightHand",), "hand": ("mixamorig:RightHandMiddle1",)},
        ),
        (
            ("RSHO", "LSHO", "RELB", "RWRA", "RWRB", "RFIN", "C7", "T10", "CLAV", "STRN"),
            {"wrist": ("RWRA", "RWRB"), "wrist_axis": (("RWRB",), ("RWRA",)), "hand": ("RFIN",),
             "trunk_up": (("T10", "STRN"), ("C7", "CLAV"))},
        ),
    ],
)  # fmt: skip
def test_usual_naming_schemes_are_known(names, expected):
    """Skeletons and marker sets of the usual names need no help."""
    roles = assign_roles(named(*names))
    assert {role: roles[role] for role in expected} == expected


def test_shipped_recordings_need_no_help():
    """Both shipped recordings have all they need; the one that is never seen plays no part."""
    assert "elbow_axis" not in assign_roles(read_recording("ladder"))
    roles = assign_roles(read_recording("freeform"))
    assert roles["elbow"] == ("RELB", "RIEL")
    assert roles["trunk_front"] == (("C7", "T10"), ("STRN",))
    assert roles["wrist_axis"] == (("ROWR",), ("RIWR",))


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


def test_the_other_arm_is_named_where_only_that_is_there():
    """Who asks for an arm that is not there is told of the other one."""
    with pytest.raises(RecordingError, match="There is a left arm: side='left' takes it"):
        assign_roles(named("LeftArm", "LeftForeArm", "LeftHand", "Neck", "Spine", "RightArm"))


def test_own_markers_go_before_the_usual_names():
    """The user's choice decides, one name or several, and None drops a role."""
    recording = read_recording("freeform")
    roles = assign_roles(
        recording, {"shoulder": "RFSH", "elbow": ["RELB"], "hand": None, "elbow_axis": ("RIEL", "RELB")}
    )
    assert (roles["shoulder"], roles["elbow"]) == (("RFSH",), ("RELB",))
    assert roles["elbow_axis"] == (("RIEL",), ("RELB",))
    assert "hand" not in roles


def test_own_shoulder_line_replaces_the_front():
    """Who names trunk_left gets it, even where points at the front are there."""
    roles = assign_roles(read_recording("freeform"), {"trunk_left": (["RFSH", "RBSH"], ["LFSH", "LBSH"])})
    assert "trunk_front" not in roles


@pytest.mark.parametrize(
    ("markers", "error", "message"),
    [
        ({"sholder": "RFSH"}, UnknownNameError, "unknown role 'sholder' of a point; .*'shoulder'"),
        ({"shoulder": "RFSX"}, UnknownNameError, "unknown point 'RFSX' in 'freeform.c3d'.*'RFSH'"),
        ({"shoulder": "CLAV"}, RecordingError, "'CLAV' is missing in every frame"),
        ({"shoulder": []}, InvalidInputError, "must be one name or a list of names"),
        ({"elbow_axis": "RELB"}, InvalidInputError, "must be a pair"),
    ],
)
def test_bad_choices_are_refused(markers, error, message):
    """Roles and points that do not exist, are never seen or have the wrong shape are refused."""
    with pytest.raises(error, match=message):
        assign_roles(read_recording("freeform"), markers)


def test_a_mean_is_missing_when_one_point_is():
    """A role of two points does not jump to the other one when one drops out."""
    recording = named("a", "b")
    positions = recording.positions.copy()
    positions[0, 0] = np.nan
    broken = Recording(recording.names, positions, recording.time)
    assert np.isnan(role_position(broken, ("a", "b"))[0]).all()
    np.testing.assert_allclose(role_position(broken, ("a", "b"))[1], positions[1].mean(axis=0))


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


def test_a_trunk_in_one_line_is_refused():
    """Where up and front are parallel in every frame there is no trunk frame."""
    recording = Recording(("a", "b", "c"), np.arange(9.0).reshape(1, 3, 3), [0.0])
    with pytest.raises(RecordingError, match="no trunk frame"):
        trunk_rotation(recording, {"trunk_up": (("a",), ("b",)), "trunk_front": (("b",), ("c",))})
