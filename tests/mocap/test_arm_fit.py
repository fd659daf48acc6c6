import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import arms
from maniport.errors import ManiportWarning
from maniport.mocap import Recording, fit_arm, read_recording
from maniport.mocap.directions import AXES, SEGMENTS, Directions


@pytest.fixture(scope="module")
def ladder():
    """Fit of the shipped BVH."""
    return fit_arm(read_recording("ladder"))


@pytest.fixture(scope="module")
def freeform():
    """Fit of the shipped C3D, in which the elbow and the wrist slightly exceed the limits of MyoArm."""
    return fit_arm(read_recording("freeform"))


# ---- exact data ---------------------------------------------------------------------------------------------------


def test_exact_data_give_the_joint_angles_back(arm, slow_motion, record):
    """With all roles, a recording made by the arm itself gives its joint angles to 1e-6 rad and no residual."""
    time, q = slow_motion(arm)
    fit = fit_arm(record(arm, time, q), arm.name)
    np.testing.assert_allclose(fit.joint_angles, q, atol=1e-6)
    assert fit.residual.max() < 1e-4
    assert max(np.abs(twist).max() for twist in fit.twist_residual.values()) < 1e-4
    assert fit.determined.all()
    assert not fit.undetermined
    np.testing.assert_array_equal(fit.frames, np.arange(len(q)))
    assert not fit.at_limit.any()


def test_rigid_motion_of_the_recording_changes_nothing(arm, slow_motion, record):
    """Turning and moving the whole recording, differently in every frame, leaves the joint angles as they are."""
    time, q = slow_motion(arm, n=20)
    recording = record(arm, time, q)
    turns = Rotation.from_rotvec(np.outer(time + 0.3, [1.0, 2.0, -0.5])).as_matrix()
    moved = np.einsum("nij,nkj->nki", turns, recording.positions) + np.outer(time, [1.0, 0, 2.0])[:, None]
    turned = Recording(recording.names, moved, time)
    expected = fit_arm(recording, arm.name).joint_angles
    np.testing.assert_allclose(fit_arm(turned, arm.name).joint_angles, expected, atol=1e-6)


def test_limits_are_respected_when_the_data_lie_outside(arm, slow_motion, record):
    """Where the recorded arm bends further than the model may, the fit stops at the limit and shows the rest."""
    time, q = slow_motion(arm, n=40)
    q[:, 3] = np.linspace(1.0, arm.upper[3] + 0.3, len(q))
    fit = fit_arm(record(arm, time, q), arm.name)
    assert np.all(fit.joint_angles >= fit.arm.lower)
    assert np.all(fit.joint_angles <= fit.arm.upper)
    assert fit.joint_angles[-1, 3] == pytest.approx(arm.upper[3], abs=1e-6)
    assert fit.at_limit[3] > 0.1
    assert 3 < fit.residual[-1].max() < 25
    assert fit.residual[0].max() < 0.1


# ---- what the points leave open -----------------------------------------------------------------------------------


def test_without_hand_and_wrist_axis_the_wrist_is_held_and_said(slow_motion, record):
    """Shoulder, elbow and wrist alone leave pro-supination and the wrist open: neutral, flagged, with the reason."""
    arm = arms.rhuman(0.31, 0.26, 0.06)
    time, q = slow_motion(arm)
    fit = fit_arm(record(arm, time, q, axes=False, hand=False), "rhuman")
    assert fit.segments == ("upper arm", "forearm")
    assert tuple(fit.undetermined) == ("pro_sup", "deviation", "flexion")
    assert all("neutral" in reason for reason in fit.undetermined.values())
    np.testing.assert_array_equal(fit.joint_angles[:, 4:], 0.0)
    np.testing.assert_allclose(fit.joint_angles[:, :4], q[:, :4], atol=1e-6)


def test_a_straight_elbow_leaves_the_turn_of_the_upper_arm_open(slow_motion, record):
    """With a straight elbow and no elbow axis, axial rotation is flagged; with the axis it is determined."""
    arm = arms.rhuman(0.31, 0.26, 0.06)
    time, q = slow_motion(arm)
    q[:, 3] = 0.0
    q[:, 1] = 1.0
    blind = fit_arm(record(arm, time, q, axes=False, hand=False), "rhuman")
    assert "shoulder_rot" in blind.undetermined
    assert blind.largest_step[0] < 5
    assert "shoulder_rot" not in fit_arm(record(arm, time, q), "rhuman").undetermined


def test_a_frame_that_says_nothing_is_carried_over(slow_motion, record):
    """Through a moment of straight elbow the axial rotation goes on smoothly and near the truth."""
    arm = arms.rhuman(0.31, 0.26, 0.06)
    time, q = slow_motion(arm, n=121, seconds=4.0)
    q[:, 3] = 0.4 * (time - 2.0) ** 2
    fit = fit_arm(record(arm, time, q, axes=False, hand=False), "rhuman")
    assert np.abs(fit.joint_angles[:, 2] - q[:, 2]).max() < np.radians(3)


# ---- gaps ---------------------------------------------------------------------------------------------------------


def with_gap(recording, name, start, stop):
    """Take one point out of some frames."""
    positions = recording.positions.copy()
    positions[start:stop, recording.names.index(name)] = np.nan
    return Recording(recording.names, positions, recording.time, recording.up, recording.source)


def test_short_gaps_are_bridged_long_ones_left_out_and_both_said(arm, slow_motion, record):
    """A short gap keeps its frames, a long one loses them, and the notes give times and reasons."""
    time, q = slow_motion(arm, n=100)
    recording = with_gap(with_gap(record(arm, time, q), "elbow", 10, 14), "wrist", 50, 70)
    fit = fit_arm(recording, arm.name)
    np.testing.assert_array_equal(fit.frames, np.r_[0:50, 70:100])
    np.testing.assert_allclose(fit.time, time[fit.frames])
    assert np.abs(fit.joint_angles - q[fit.frames]).max() < np.radians(0.1)
    assert any("elbow" in note and "interpolated" in note for note in fit.notes)
    assert any("20 frames left out, 1.01–1.39 s: wrist missing" in note for note in fit.notes)


def test_ladder_is_followed_closely(ladder):
    """Upper arm and forearm of the skeleton are met but for moments at the limits; the wrist is flagged."""
    summary = ladder.residual_summary()
    for segment in ("upper arm", "forearm"):
        assert summary[segment]["median"] < 0.1
        assert summary[segment]["p95"] < 1.0
        assert summary[segment]["max"] < 7.0
    assert summary["hand"]["median"] < 1.5
    assert tuple(ladder.undetermined) == ("pro_sup", "deviation", "flexion")
    assert len(ladder) == 1128
    assert ladder.segment_lengths["upper arm"] == pytest.approx(0.2959, abs=1e-4)


def test_a_part_of_a_recording_is_fitted_as_in_the_whole(ladder):
    """Where the arm hangs straight, too, and its angles change the residual by next to nothing."""
    part = fit_arm(read_recording("ladder").crop(25, 30))
    rows = np.searchsorted(ladder.time, part.time - 1e-6)
    away = np.abs(ladder.joint_angles[rows] - part.joint_angles)
    assert away[15:-15].max() < 0.02


def test_freeform_is_followed_closely(freeform):
    """Real markers are met to a degree in the median; the elbow's limit and the wrist's show in the rest."""
    summary = freeform.residual_summary()
    assert summary["upper arm"]["median"] < 0.8
    assert summary["forearm"]["median"] < 1.0
    assert summary["hand"]["median"] < 5.0
    assert max(summary["upper arm"]["max"], summary["forearm"]["max"]) < 8.0
    assert freeform.determined.all()
    assert freeform.at_limit[3] > 0.3


@pytest.mark.parametrize(
    ("person", "pair", "segment", "joint"),
    [
        ("myoarm", ("ROWR", "RIWR"), "forearm", "wrist"),
        ("rhuman", ("RIEL", "RELB"), "upper arm", "elbow"),
    ],
)
def test_exchanged_markers_are_told(person, pair, segment, joint):
    """Wrist or elbow points under each other's names turn the segment by far: a warning names them, and the cure."""
    recording = read_recording("freeform")
    exchanged = {pair[0]: pair[1], pair[1]: pair[0]}
    names = tuple(exchanged.get(name, name) for name in recording.names)
    wrong = replace(recording, names=names)
    with pytest.warns(ManiportWarning, match=f"the {segment} is turned .* about its axis .*{pair[0]} and {pair[1]}.*"
                      rf"may be exchanged.*'{joint}_axis': \[\['{pair[1]}'\], \['{pair[0]}'\]\]"):  # fmt: skip
        fit = fit_arm(wrong, person)
    row = fit.residual_summary()[f"{segment} about its axis"]
    assert 30 < row["median"] <= row["p95"] <= row["max"] <= 180
    assert abs(fit.twist_residual[segment][fit.time == row["max_at_s"]][0]) == row["max"]
    cured = fit_arm(wrong, person, markers={f"{joint}_axis": ([pair[1]], [pair[0]])})
    assert not any("exchanged" in text or "differ" in text for text in cured.quality_warnings)
    assert cured.residual_summary()[f"{segment} about its axis"]["median"] < 16


@pytest.mark.parametrize("excess", [5.0, 15.0])
def test_an_excess_over_a_limit_of_the_model_is_measured(excess, record):
    """An elbow that bends further than the model's by 15° is a warning, by 5° a note; the amount is the true one."""
    arm = arms.myoarm(upper_arm=0.31, forearm=0.26, hand=0.06)
    elbow = arm.joint_names.index("elbow_flexion")
    time, half = np.linspace(0.0, 2.0, 60), 30
    q = np.tile(np.radians([40.0, 40.0, -20.0, 60.0, 5.0, 2.0, 5.0]), (60, 1))
    q[:, elbow] = np.concatenate([np.linspace(q[0, elbow], arm.upper[elbow], half),
                                  np.full(half, arm.upper[elbow] + np.radians(excess))])  # fmt: skip
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit = fit_arm(record(arm, time, q))
    np.testing.assert_allclose(fit.beyond_limit[half + 5 :, elbow], excess, atol=0.2 * excess)
    told = [str(one.message) for one in caught if "elbow_flexion" in str(one.message)]
    noted = [text for text in fit.notes if "elbow_flexion would go beyond its limit of 130°" in text]
    assert (len(told), len(noted)) == ((1, 0) if excess > 10.0 else (0, 1))
    assert any("elbow_flexion" in text for text in fit.quality_warnings) == (excess > 10.0)


# ---- derivatives --------------------------------------------------------------------------------------------------


def test_derivatives_of_the_directions_are_right(arm):
    """Analytic derivatives of all segments and axes agree with central differences."""
    names = (*SEGMENTS, *AXES)
    q = arm.sample(16, random_state=1)
    directions = Directions(arm, names, np.zeros((16, len(names), 3)))
    slopes = directions.model(q)[1]
    for joint in range(arm.dof):
        step = np.zeros(arm.dof)
        step[joint] = 1e-6
        difference = (directions.model(q + step)[0] - directions.model(q - step)[0]) / 2e-6
        np.testing.assert_allclose(slopes[..., joint], difference, atol=1e-7)
