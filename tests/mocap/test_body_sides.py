"""Left and right by the body: contradictions of names are reported, and bodies that agree are left alone."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.mocap import Recording, fit_arm, read_recording
from maniport.mocap.body_sides import body_sides
from maniport.mocap.point_names import other_side
from maniport.mocap.roles import find_roles, load_names

CASES = Path(__file__).parent / "cases"
DATA = Path(__file__).parent / "data"
ORDERS = load_names("joint_orders.yaml")["skeletons"]
LAFAN1 = ORDERS["LAFAN1"]
RIGHT_FIRST = ORDERS["LAFAN1 in an earlier order of holosoma"]
RATE = 30.0

ARMS = {  # directions of upper arm and forearm on the right side: x forward, y left, z up
    "at rest": ((0.02, -0.08, -1), (0.15, -0.05, -1)),
    "slightly bent": ((0, -0.08, -1), (0.45, 0.05, -1)),
    "T-pose": ((0, -1, 0), (0.02, -1, 0)),
    "T-pose, overstretched": ((0, -1, 0), (-0.1, -1, 0)),
    "behind the back": ((-0.45, -0.2, -0.85), (-0.15, 0.85, 0.35)),
    "low behind the back": ((-0.3, -0.25, -0.9), (-0.15, 0.8, -0.4)),
    "high behind the back": ((-0.5, -0.1, -0.85), (-0.1, 0.5, 0.85)),
    "on the hips": ((-0.2, -0.65, -0.75), (0.3, 0.75, -0.5)),
    "in the back pockets": ((-0.4, -0.3, -0.85), (-0.1, 0.45, -0.9)),
    "at handlebars": ((0.75, -0.2, -0.6), (0.8, 0.1, -0.3)),
    "at a keyboard": ((0.2, -0.1, -0.97), (0.95, 0.2, 0)),
    "crossed": ((0.3, -0.2, -0.9), (0.5, 0.85, 0.1)),
    "behind the head": ((0.2, -0.7, 0.6), (-0.2, 0.9, 0.3)),
    "hands up": ((0, -1, 0), (0.05, 0, 1)),
    "overhead": ((0.1, -0.2, 1), (-0.2, 0.4, 0.8)),
    "push-up": ((0.6, -0.6, -0.3), (0.9, 0.3, 0)),
    "carrying a tray": ((0.3, -0.5, -0.8), (0.3, -0.5, 0.8)),
}
LEGS = {  # directions of thigh, shank and foot
    "standing": ((0, 0, -1), (-0.1, 0, -1), (1, -0.2, -0.3)),
    "sitting": ((1, -0.2, -0.1), (0.05, 0, -1), (1, 0, 0)),
    "cycling": ((0.8, -0.1, -0.6), (-0.3, 0, -1), (0.9, 0, -0.5)),
    "kneeling": ((1, -0.1, -0.2), (-1, 0, -0.1), (-1, 0, -0.25)),
    "cross-legged": ((0.7, -0.7, -0.1), (0.2, 1, -0.1), (0.3, 0.8, 0.1)),
    "on tiptoe": ((0, 0, -1), (0, 0, -1), (0.3, 0, -1)),
    "not recorded": None,
}
MIRROR = np.array([1.0, -1.0, 1.0])


def body(arms, legs="standing", head=True, frames=10):
    """Record a body with both arms and legs in these directions, with noise of 3 mm."""
    parts = {
        "Hips": [0, 0, 1.0],
        "Spine": [0, 0, 1.1],
        "Spine1": [0, 0, 1.2],
        "Spine2": [0, 0, 1.3],
    }
    parts["Neck"] = [0, 0, 1.5]
    parts["Head"] = [0, 0, 1.6]
    if head:
        parts["Nose"] = [0.12, 0.02, 1.62]
    for side, sign in (("Right", 1.0), ("Left", -1.0)):
        flip = np.where(sign > 0, 1.0, MIRROR)
        at = np.array([0, -0.18, 1.45]) * flip
        parts[f"{side}Shoulder"] = np.array([0, -0.03, 1.42]) * flip
        parts[f"{side}Arm"] = at
        chain = list(zip(("ForeArm", "Hand"), ARMS[arms], (0.3, 0.26), strict=True))
        for joint, direction, length in chain:
            at = at + length * flip * np.array(direction) / np.linalg.norm(direction)
            parts[side + joint] = at
        if LEGS[legs] is None:
            continue
        at = np.array([0, -0.09, 1.0]) * flip
        parts[f"{side}UpLeg"] = at
        chain = list(zip(("Leg", "Foot", "ToeBase"), LEGS[legs], (0.42, 0.42, 0.15), strict=True))
        for joint, direction, length in chain:
            at = at + length * flip * np.array(direction) / np.linalg.norm(direction)
            parts[side + joint] = at
    positions = np.tile(np.array(list(parts.values()), dtype=float), (frames, 1, 1))
    positions += np.random.default_rng(0).normal(0.0, 0.003, positions.shape)
    return Recording(tuple(parts), positions, np.arange(frames) / RATE)


def exchanged(recording):
    """Exchange left and right in the names."""
    return replace(recording, names=tuple(map(other_side, recording.names)))


def sides_of(recording, side="right"):
    return body_sides(recording, find_roles(recording.observed, side)[1], side)


@pytest.mark.parametrize("arms", ARMS)
def test_people_who_agree_with_their_names_get_no_warning(arms):
    for legs in LEGS:
        for head in (True, False):
            recording = body(arms, legs, head)
            for side in ("right", "left"):
                assert not sides_of(recording, side).warnings(), (legs, head)
            turned = replace(
                recording, positions=recording.positions @ np.eye(3)[[1, 2, 0]] * 100.0
            )
            assert_allclose(sides_of(turned).total, sides_of(recording).total, atol=1e-9)


@pytest.mark.parametrize("legs", LEGS)
def test_every_part_of_the_body_alone_raises_no_false_alarm(legs):
    """Toes and face may not be recorded; arms at rest, or hands behind the back, do not help."""
    for arms in ("at rest", "high behind the back"):
        recording = body(arms, legs, head=False)
        left_out = [name for name in recording.names if "Toe" in name]
        kept = [name for name in recording.names if name not in left_out]
        assert not sides_of(recording.select(kept)).warnings()
        knees = sides_of(recording).cosines.get("knees", 1.0)
        assert knees > 0.5


@pytest.mark.parametrize("arms", ARMS)
def test_exchanged_names_are_reported_by_toes_knees_or_face(arms):
    for legs in LEGS:
        recording = body(arms, legs)
        one_axis = replace(recording, positions=recording.positions * [-1.0, 1.0, 1.0])
        for wrong in (exchanged(recording), one_axis):
            assert sides_of(wrong).warnings(), legs


@pytest.mark.parametrize("arms", ["slightly bent", "at a keyboard", "at handlebars", "push-up"])
def test_bent_elbows_suffice(arms):
    recording = body(arms, "not recorded", head=False)
    assert set(sides_of(recording).cosines) == {"elbows"}
    assert sides_of(recording).agree
    (warning,) = sides_of(exchanged(recording)).warnings()
    assert "elbows" in warning


def test_straight_arms_alone_show_no_side():
    recording = body("at rest", "not recorded", head=False)
    assert sides_of(recording).cosines == {}
    assert not sides_of(exchanged(recording)).warnings()


def test_an_arm_alone_is_compared_with_its_trunk():
    names = ("RightArm", "RightForeArm", "RightHand", "Hips", "Neck")
    recording = body("at handlebars").select(names)
    assert sides_of(recording).agree
    assert sides_of(exchanged(recording), "left").contradict


def test_markers_of_the_trunk_show_its_front():
    recording = read_recording(CASES / "markers_rajagopal.trc")
    assert sides_of(recording).cosines["pelvis"] > 0.9
    assert sides_of(exchanged(recording)).cosines["pelvis"] < -0.9


@pytest.mark.parametrize(
    "name",
    ["ladder", "freeform", "both-arms", *sorted(DATA.glob("*.bvh")), *sorted(CASES.glob("*.bvh"))],
    ids=lambda name: Path(name).stem,
)
def test_recordings_of_people_get_no_warning(name):
    options = {"scaled_1e-4": {"unit": 100.0}, "frame_time_zero": {"rate": 30.0}}
    recording = read_recording(name, **options.get(Path(name).stem, {}))
    assert sides_of(recording).agree
    assert sides_of(exchanged(recording), "left").contradict


@pytest.mark.parametrize("name", ["climb", "climb_0", "climb_1", "climb_2", "climb_4"])
def test_unnamed_recordings_of_people_keep_their_order(name):
    recording = read_recording(DATA / f"{name}.npy", rate=30.0)
    assert sides_of(recording).agree
    assert recording.quality_warnings == ()


def test_mirrored_axes_are_one_warning(run):
    file = CASES / "mirrored_axes.trc"
    code, out, err = run("info", file)
    assert code == 0, err
    assert out.count("left-handed") == 1
    fit = fit_arm(read_recording(file))
    (warning,) = fit.quality_warnings
    assert "left and right are exchanged, or one axis is mirrored" in warning
    recording = read_recording(file)
    repaired = replace(recording, positions=recording.positions * [-1, 1, 1])  # as the warning says
    assert not any("mirrored" in text for text in fit_arm(repaired).quality_warnings)
    assert not any("mirrored" in text for text in fit_arm(exchanged(recording)).quality_warnings)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_every_axis_may_be_mirrored(axis):
    sign = np.ones(3)
    sign[axis] = -1.0
    recording = read_recording(CASES / "control.bvh")
    mirrored = replace(recording, positions=recording.positions * sign)
    (warning,) = fit_arm(mirrored).quality_warnings
    assert "mirrored" in warning


@pytest.mark.parametrize("name", ["both-arms", "freeform"])
def test_a_mirrored_marker_set_with_a_front_is_one_warning(run, tmp_path, name):
    recording = read_recording(name)
    mirrored = replace(recording, positions=recording.positions * [-1, 1, 1])
    fit = fit_arm(mirrored)
    assert sum("mirrored" in warning for warning in fit.quality_warnings) == 1
    file = tmp_path / "mirrored.npz"
    mirrored.save(file)
    code, out, err = run("info", file)
    assert code == 0, err
    assert out.count("mirrored (left-handed") == 1


def test_a_mirrored_marker_set_with_a_front_is_transferred(run, tmp_path):
    recording = read_recording("freeform").crop(2.0, 2.5)
    file = tmp_path / "mirrored.npz"
    replace(recording, positions=recording.positions * [-1, 1, 1]).save(file)
    folder = tmp_path / "out"
    code, out, err = run("transfer", file, "--no-move", "-o", folder)
    assert code == 0, err
    assert (out + err).count("one axis is mirrored") == 1
    summary = json.loads((folder / "summary.json").read_text())
    assert json.dumps(summary).count("one axis is mirrored") == 1


def unnamed(tmp_path, recording, names):
    file = tmp_path / "unnamed.npz"
    np.savez(file, positions=recording.select(names).positions, fps=RATE)
    return read_recording(file)


@pytest.mark.parametrize("legs", ["standing", "sitting", "cycling", "kneeling"])
@pytest.mark.parametrize("order", [LAFAN1, RIGHT_FIRST], ids=["left first", "right first"])
def test_of_both_orders_of_22_joints_the_body_shows_one(tmp_path, order, legs):
    recording = body("at a keyboard", legs)
    again = unnamed(tmp_path, recording, order)
    assert list(again.names) == order
    assert_allclose(again.point("RightHand"), recording.point("RightHand"), atol=1e-12)
    assert again.quality_warnings == ()


def test_a_body_that_shows_no_side_has_an_assumed_order(tmp_path):
    recording = body("at rest", "on tiptoe", head=False)
    flat = recording.positions.copy()
    for name in ("RightToeBase", "LeftToeBase"):
        flat[:, recording.names.index(name), 0] = 0.0
    again = unnamed(tmp_path, replace(recording, positions=flat), LAFAN1)
    assert list(again.names) == LAFAN1
    (warning,) = again.quality_warnings
    assert "LAFAN1" in warning


SMPL = {
    "pelvis": "Hips",
    "spine1": "Spine",
    "spine2": "Spine1",
    "spine3": "Spine2",
    "neck": "Neck",
    "head": "Head",
    "hip": "UpLeg",
    "knee": "Leg",
    "ankle": "Foot",
    "foot": "ToeBase",
    "collar": "Shoulder",
    "shoulder": "Arm",
    "elbow": "ForeArm",
    "wrist": "Hand",
}


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_the_only_order_is_kept_unless_the_body_contradicts(tmp_path, is_mirrored):
    """SMPL's order exists left first only: of a mirrored array both sides are exchanged, with a warning."""
    recording = body("at a keyboard")
    own = []
    for name in ORDERS["SMPL body"]:
        side, _, joint = name.rpartition("_")
        own.append(side.title() + SMPL[joint])
    if is_mirrored:
        recording = replace(recording, positions=recording.positions * MIRROR)
    again = unnamed(tmp_path, recording, own)
    assert len(again.quality_warnings) == is_mirrored
    expected = (
        [other_side(name) for name in ORDERS["SMPL body"]] if is_mirrored else ORDERS["SMPL body"]
    )
    assert list(again.names) == expected
    assert sides_of(again).agree
