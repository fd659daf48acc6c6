"""What the points of a recording contradict: the unit, the axis up, the side of the arm."""

from dataclasses import replace

import numpy as np
import pytest

from dialect_files import POINTS, SKELETONS, mirrored, motion
from maniport.errors import InvalidInputError, RecordingError
from maniport.mocap import Recording, read_recording
from maniport.mocap.roles import assign_roles


@pytest.fixture(scope="module")
def made():
    """A right arm moves, a left one hangs."""
    return motion()


@pytest.fixture(scope="module")
def skeleton(made):
    """The motion under the names of LAFAN1."""
    return made.recording(mirrored(SKELETONS["LAFAN1"].names))


@pytest.mark.parametrize(("name", "unit"), [("ladder", "CMU"), ("freeform", "mm")])
def test_shipped_recordings_are_not_contradicted(name, unit):
    """Who gives the right unit and axis is not doubted, whether the person hangs, reaches or bends."""
    assert read_recording(name, unit=unit, up="y").quality_warnings == ()


@pytest.mark.parametrize("unit", ["m", "mm", "inch"])
def test_a_unit_that_makes_no_person_is_refused(bvh_file, unit):
    """An upper arm of 30 m is nobody's; the message names the unit that makes it one of a person."""
    with pytest.raises(
        InvalidInputError, match=f"small.bvh: unit='{unit}' makes the upper arm .*unit='cm' makes it 0.3"
    ):
        read_recording(bvh_file(), unit=unit)


@pytest.mark.parametrize("up", ["z", "x", "-y"])
def test_an_axis_along_which_nobody_stands_is_doubted(bvh_file, up):
    """The doubt says how far off upright the trunk is, and which axis is nearer."""
    (doubt,) = read_recording(bvh_file(), up=up).quality_warnings
    assert f"up='{up}' lets the trunk (Spine to Neck) stand {180 if up == '-y' else 90}° off upright" in doubt
    assert "up='y' lets it stand 0° off" in doubt


@pytest.mark.parametrize("role", ["shoulder", "elbow", "wrist"])
def test_points_with_names_of_the_other_arm_are_refused(skeleton, role):
    """The error names the role, the point and the option that takes the other arm."""
    names = {"shoulder": "LeftArm", "elbow": "LeftForeArm", "wrist": "LeftHand"}
    with pytest.raises(RecordingError, match=f"{role} of the right arm: '{names[role]}' is a point of the left one; "
                                             "give side='left'"):  # fmt: skip
        assign_roles(skeleton, {role: names[role]})
    assert assign_roles(skeleton, {role: names[role]}, "left")


def anonymous(recording):
    """The same points under numbers, and their old names."""
    number = {name: f"p{i}" for i, name in enumerate(recording.names)}
    return replace(recording, names=tuple(number.values())), number


@pytest.mark.parametrize("wrong", ["arm", "elbow", "trunk"])
def test_points_on_the_other_side_are_refused_whatever_their_names(skeleton, wrong):
    """A left arm, a left elbow or a trunk the wrong way round show by where the points are."""
    recording, number = anonymous(skeleton)
    arm = {"shoulder": "RightArm", "elbow": "RightForeArm", "wrist": "RightHand"}
    trunk = {"trunk_up": ("Spine", "Neck"), "trunk_left": ("RightArm", "LeftArm")}
    right = {role: number[name] for role, name in arm.items()}
    right |= {role: tuple(number[name] for name in pair) for role, pair in trunk.items()}
    assert assign_roles(recording, right)
    left = {role: number[name.replace("Right", "Left")] for role, name in arm.items()}
    change = {"arm": left, "elbow": {"elbow": left["elbow"]}, "trunk": {"trunk_left": right["trunk_left"][::-1]}}
    with pytest.raises(RecordingError, match=r"of the right arm: .* to the left of"):
        assign_roles(recording, right | change[wrong])


def test_of_several_bodies_one_is_taken(tmp_path, made):
    """Never a shoulder of one and an elbow of another; a warning says whose; a point of another takes that one."""
    markers = made.recording(mirrored(POINTS["Plug-in Gait"]))
    names = tuple(f"{body}:{name}" for body in "AB" for name in markers.names)
    positions = np.concatenate([markers.positions, markers.positions + 0.1], axis=1)
    file = tmp_path / "two.npz"
    Recording(names, positions, markers.time).save(file)
    both = read_recording(file)
    assert both.quality_warnings[0].startswith(
        "the points are those of several bodies: A, B; the first that has a whole arm"
    )
    for given, body in ((None, "A"), ({"shoulder": "B:RSHO"}, "B")):
        roles = assign_roles(both, given)
        assert {name[:2] for role in ("shoulder", "elbow", "wrist") for name in roles[role]} == {f"{body}:"}
        assert roles["trunk_up"][0][0].startswith(body)
    positions[:, names.index("A:RELB")] = np.nan
    Recording(names, positions, markers.time).save(file)
    assert assign_roles(read_recording(file))["wrist"] == ("B:RWRA", "B:RWRB")


@pytest.mark.parametrize(("scale", "word"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_times_that_cannot_be_seconds_are_recognised(tmp_path, skeleton, scale, word):
    """Frames that would be 20 s apart are 20 ms apart, and a note says so."""
    file = tmp_path / "slow.npz"
    np.savez(file, names=np.array(skeleton.names), positions=skeleton.positions, time=skeleton.time * scale)
    recording = read_recording(file)
    assert any(f"times recognised as {word}" in note for note in recording.notes)
    np.testing.assert_allclose(recording.time, skeleton.time, atol=1e-12)
