from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from maniport import arms, spd
from maniport.arms import load_arm
from maniport.arms.human import middle_of
from maniport.mocap import Recording, fit_arm, fit_arms, read_recording, synthetic_recording
from maniport.mocap.roles import other_side

DATA = Path(__file__).parent / "data"
SIDES = ("left", "right")


@pytest.fixture(scope="module")
def ladder():
    return fit_arm(read_recording("ladder"))


def test_exact_data_give_the_joint_angles_back(arm, slow_motion, record):
    time, q = slow_motion(arm)
    fit = fit_arm(record(arm, time, q), arm.name)
    np.testing.assert_allclose(fit.joint_angles, q, atol=1e-6)
    assert max(np.abs(values).max() for values in fit.residuals.values()) < 1e-4
    assert fit.observable.all()
    assert not fit.unobservable
    np.testing.assert_array_equal(fit.frames, np.arange(len(q)))
    assert not fit.at_limit.any()
    assert not fit.quality_warnings


@pytest.mark.parametrize("excess", [5.0, 15.0])
def test_an_excess_over_a_limit_of_the_model_is_measured(excess, record):
    """The fit stays within the limits; an elbow beyond its limit is reported, by 15° with advice."""
    arm = arms.myoarm(upper_arm=0.31, forearm=0.26, hand=0.06)
    elbow = arm.joint_names.index("elbow_flexion")
    time = np.linspace(0.0, 2.0, 60)
    half = 30
    q = np.tile(np.radians([40.0, 40.0, -20.0, 60.0, 5.0, 2.0, 5.0]), (60, 1))
    q[:, elbow] = np.concatenate(
        [
            np.linspace(q[0, elbow], arm.upper[elbow], half),
            np.full(half, arm.upper[elbow] + np.radians(excess)),
        ]
    )
    fit = fit_arm(record(arm, time, q))
    assert np.all((fit.joint_angles >= fit.arm.lower) & (fit.joint_angles <= fit.arm.upper))
    assert fit.joint_angles[-1, elbow] == pytest.approx(arm.upper[elbow], abs=1e-6)
    assert fit.at_limit[elbow] > 0.1
    largest = np.max([fit.residuals[name] for name in fit.segment_lengths], axis=0)
    assert largest[0] < 0.1 < 0.2 * excess < largest[-1] < 25
    np.testing.assert_allclose(fit.beyond_limit[half + 5 :, elbow], excess, atol=0.2 * excess)
    reported = [text for text in fit.quality_warnings if "elbow_flexion" in text]
    assert len(reported) == 1
    assert "elbow_flexion beyond its limit of 150°" in reported[0]
    assert ("check the roles" in reported[0]) == (excess > 10.0)


def test_without_hand_and_wrist_axis_the_wrist_is_unobservable(slow_motion, record):
    arm = arms.rhuman(0.31, 0.26, 0.06)
    time, q = slow_motion(arm)
    fit = fit_arm(record(arm, time, q, axes=False, hand=False), "rhuman")
    assert tuple(fit.residuals) == ("upper arm", "forearm")
    assert tuple(fit.unobservable) == ("pro_sup", "deviation", "flexion")
    assert all("neutral" in reason for reason in fit.unobservable.values())
    np.testing.assert_array_equal(fit.joint_angles[:, 4:], 0.0)
    np.testing.assert_allclose(fit.joint_angles[:, :4], q[:, :4], atol=1e-6)


def test_a_straight_elbow_makes_the_axial_rotation_unobservable(slow_motion, record):
    arm = arms.rhuman(0.31, 0.26, 0.06)
    time, q = slow_motion(arm, n=121, seconds=4.0)
    passing = q.copy()
    passing[:, 3] = 0.4 * (time - 2.0) ** 2
    fit = fit_arm(record(arm, time, passing, axes=False, hand=False), "rhuman")
    assert np.abs(fit.joint_angles[:, 2] - passing[:, 2]).max() < np.radians(3)
    q[:, 3] = 0.0
    q[:, 1] = 1.0
    blind = fit_arm(record(arm, time, q, axes=False, hand=False), "rhuman")
    assert "shoulder_rot" in blind.unobservable
    assert np.degrees(np.abs(np.diff(blind.joint_angles, axis=0)).max()) < 5
    assert "shoulder_rot" not in fit_arm(record(arm, time, q), "rhuman").unobservable


def test_short_gaps_are_interpolated_and_long_ones_omitted(arm, slow_motion, record):
    time, q = slow_motion(arm, n=100)
    recording = record(arm, time, q)
    positions = recording.positions.copy()
    positions[10:14, recording.names.index("elbow")] = np.nan
    for name in ("wrist", "wrist_ulnar", "wrist_radial", "hand"):
        positions[50:70, recording.names.index(name)] = np.nan
    fit = fit_arm(replace(recording, positions=positions), arm.name)
    np.testing.assert_array_equal(fit.frames, np.r_[0:50, 70:100])
    np.testing.assert_allclose(fit.time, time[fit.frames])
    assert np.abs(fit.joint_angles - q[fit.frames]).max() < np.radians(0.1)
    assert any("elbow" in note and "interpolated" in note for note in fit.notes)
    assert any("20 frames omitted, 1.01–1.39 s: wrist, hand missing" in note for note in fit.notes)
    assert "20 frames in the middle" in fit.quality_warnings[-1]


def test_the_longest_gap_is_that_in_time(arm, slow_motion, record):
    """Frames that the file lost make a gap longer than those that only lack points."""
    time, q = slow_motion(arm, n=200)
    kept = np.r_[0:60, 100:200]
    recording = record(arm, time[kept], q[kept])
    positions = recording.positions.copy()
    for name in ("wrist", "wrist_ulnar", "wrist_radial", "hand"):
        positions[58:64, recording.names.index(name)] = np.nan
        positions[100:130, recording.names.index(name)] = np.nan
    fit = fit_arm(replace(recording, positions=positions), arm.name)
    (warning,) = [text for text in fit.quality_warnings if "in the middle" in text]
    assert f"from {recording.time[57]:.2f} to {recording.time[64]:.2f} s" in warning


@pytest.mark.parametrize(
    "file", sorted([*DATA.glob("*.npy"), *DATA.glob("*.bvh")]), ids=lambda file: file.name
)
def test_recordings_of_others_are_fitted(file):
    recording = (
        read_recording(file, rate=30.0).crop(0, 1.17)
        if file.suffix == ".npy"
        else read_recording(file)
    )
    for side in SIDES:
        angles = np.degrees(fit_arm(recording, side=side).joint_angles)
        assert np.all(np.isfinite(angles))
        assert np.ptp(angles, axis=0).max() > 5.0


def test_shipped_recordings_are_followed_closely(ladder):
    """Residuals [°] are small, and joints within limits; without points of the hand the wrist is unobservable."""
    freeform = fit_arm(read_recording("freeform"))
    for fit, bounds, hand, largest in (
        (ladder, (0.1, 0.1), 1.5, 7.0),
        (freeform, (0.1, 0.2), 0.2, 1.0),
    ):
        summary = fit.residual_summary()
        for segment, bound in zip(("upper arm", "forearm"), bounds, strict=True):
            assert summary[segment]["median"] < bound
            assert summary[segment]["max"] < largest
        assert summary["hand"]["median"] < hand
    assert (
        max(ladder.residual_summary()[segment]["p95"] for segment in ("upper arm", "forearm")) < 1.0
    )
    assert tuple(ladder.unobservable) == ("pro_sup", "deviation", "flexion")
    assert len(ladder) == 1128
    assert ladder.segment_lengths["upper arm"] == pytest.approx(0.2959, abs=1e-4)
    assert freeform.observable.all()
    assert not freeform.at_limit.any()
    assert not freeform.quality_warnings
    assert not any("model" in text for text in ladder.quality_warnings)


@pytest.mark.parametrize(
    ("person", "pair", "segment", "axis"),
    [
        ("myoarm", ("ROWR", "RIWR"), "forearm", "wrist_axis"),
        ("rhuman", ("RIEL", "RELB"), "upper arm", "elbow_axis"),
    ],
)
def test_exchanged_markers_are_reported(person, pair, segment, axis):
    recording = read_recording("freeform")
    exchanged = dict(zip(pair, pair[::-1], strict=True))
    wrong = replace(recording, names=tuple(exchanged.get(name, name) for name in recording.names))
    fit = fit_arm(wrong, person)
    text = fit.quality_warnings[0]
    assert f"{pair[0]} and {pair[1]} may be exchanged" in text
    assert f"'{axis}': [['{pair[1]}'], ['{pair[0]}']]" in text
    row = fit.residual_summary()[f"{segment} about its axis"]
    assert 20 < row["median"] <= row["p95"] <= row["max"] <= 180
    assert (
        abs(fit.residuals[f"{segment} about its axis"][fit.time == row["max_at_s"]][0])
        == row["max"]
    )
    repaired = fit_arm(wrong, person, markers={axis: ([pair[1]], [pair[0]])})
    assert not any("exchanged" in text for text in repaired.quality_warnings)
    assert repaired.residual_summary()[f"{segment} about its axis"]["median"] < 16


def test_noise_and_outliers_of_video_are_reduced(record, slow_motion):
    """With 10 mm of noise and 3 % of points 0.2 m off, errors of angles and ellipsoids are half of those without."""
    arm = arms.myoarm(0.3, 0.26, 0.06)
    time, q = slow_motion(arm, n=151, seconds=5.0, curved=True)
    clean = record(arm, time, q, axes=False)
    generator = np.random.default_rng(1)
    noisy = clean.positions + generator.normal(0.0, 0.01, clean.positions.shape)
    away = generator.normal(size=noisy.shape)
    away *= 0.2 / np.linalg.norm(away, axis=-1, keepdims=True)
    noisy += np.where(generator.random(noisy.shape[:2]) < 0.03, 1.0, 0.0)[..., None] * away
    video = replace(clean, positions=noisy)
    truth = fit_arm(clean, side="right")
    fits = [fit_arm(video, side="right", smooth=smooth) for smooth in ("auto", "off")]
    joints, raw_joints = (
        np.sqrt(np.mean((fit.joint_angles - truth.joint_angles)[:, :4] ** 2)) for fit in fits
    )
    wanted = truth.arm.manipulability(truth.joint_angles)
    ellipsoids, raw_ellipsoids = (
        np.mean(spd.distance(fit.arm.manipulability(fit.joint_angles), wanted)) for fit in fits
    )
    assert joints < min(0.5 * raw_joints, np.radians(2.5))
    assert ellipsoids < 0.5 * raw_ellipsoids
    assert any("noise of" in text and "smoothed" in text for text in fits[0].quality_warnings)
    assert any("outlier" in note for note in fits[0].notes)


def test_repaired_faults_leave_the_fit_as_it_is(slow_motion):
    arm = arms.myoarm(0.3, 0.26, 0.06)
    time, q = slow_motion(arm, n=301, seconds=10.0, curved=True)
    clean = synthetic_recording(arm, q, time)
    names = tuple({"wrist": "RightWrist"}.get(name, name) for name in clean.names)
    left = clean.positions[:, [clean.names.index("wrist")]] * [1.0, -1.0, 1.0]
    positions = np.concatenate([clean.positions, left], axis=1)
    positions[40:43, names.index("hand")] = 0.0
    wrist = names.index("RightWrist")
    positions[100:120, [wrist, -1]] = positions[100:120, [-1, wrist]]
    fit = fit_arm(
        Recording((*names, "LeftWrist"), positions, time),
        markers={"wrist": "RightWrist"},
        side="right",
    )
    assert (
        np.degrees(np.abs(fit.joint_angles - fit_arm(clean, side="right").joint_angles).max()) < 0.5
    )
    assert any("hand: exactly at the origin in 3 frames" in note for note in fit.notes)
    assert any("swapped in 20 frames" in text for text in fit.quality_warnings)


def test_jumps_of_a_real_recording_are_reported():
    fit = fit_arm(read_recording("ladder").crop(11, 14))
    assert "joints jump in" in fit.quality_warnings[-1]


def test_repetitions_are_found(repeated):
    fit = fit_arm(repeated)
    parts = np.array(fit.repetitions())
    np.testing.assert_allclose(parts.mean(axis=1), [1.0, 2.2, 4.0, 6.5], atol=0.05)
    assert np.all(parts[1:, 0] >= parts[:-1, 1])
    assert fit.only(fit.time <= 0.04).repetitions() == []
    assert len(fit.only((fit.time >= 4.8) & (fit.time <= 5.6)).repetitions()) < 2


@pytest.mark.parametrize(("name", "person"), [("ladder", "rhuman"), ("freeform", "myoarm")])
def test_a_mirrored_recording_gives_mirrored_angles_and_ellipsoids(name, person):
    recording = read_recording(name).crop(0, 1)
    s = np.diag([1.0, -1.0, 1.0])
    names = tuple(map(other_side, recording.names))
    flipped = recording.positions * np.array([1.0, 1.0, -1.0])
    right = fit_arm(recording, person)
    left = fit_arm(replace(recording, names=names, positions=flipped), person)
    assert (right.arm.side, left.arm.side, left.arm.name) == ("right", "left", f"{person}_left")
    q = right.joint_angles
    np.testing.assert_allclose(left.joint_angles, q, atol=1e-9)
    np.testing.assert_allclose(left.arm.ellipsoids(q), s @ right.arm.ellipsoids(q) @ s, atol=1e-9)
    np.testing.assert_allclose(
        left.arm.forward(q)[:, :3, 3], right.arm.forward(q)[:, :3, 3] @ s, atol=1e-9
    )
    for name, values in right.residuals.items():
        np.testing.assert_allclose(
            left.residuals[name], -values if "axis" in name else values, atol=1e-6
        )
    assert left.summary == right.summary.replace("right arm", "left arm")
    assert left.unobservable == right.unobservable


@pytest.mark.parametrize("person", ["myoarm", "rhuman"])
def test_both_arms_give_their_angles_and_the_relation_of_the_hands_back(person, slow_motion):
    tracks = {}
    angles = []
    paths = []
    for k, side in enumerate(SIDES):
        arm = load_arm(person, side=side)
        time, q = slow_motion(arm, n=60)
        angles.append(q[::-1] if k else q)
        single = synthetic_recording(arm, angles[k], time)
        points = dict(
            zip(
                single.names,
                np.moveaxis(single.positions, 1, 0) - [0, middle_of(arm), 0],
                strict=True,
            )
        )
        tracks |= {
            name if "trunk" in name else f"{side}_{name}": track for name, track in points.items()
        }
        paths.append(arm.forward(angles[k])[:, :3, 3] - [0, middle_of(arm), 0])
    motion = fit_arms(
        Recording(tuple(tracks), np.stack(list(tracks.values()), axis=1), time), person
    )
    assert motion.names == SIDES
    for fit, q in zip(motion.arms, angles, strict=True):
        np.testing.assert_allclose(fit.joint_angles, q, atol=1e-6)
        np.testing.assert_array_equal(fit.time, motion.time)
    # MyoArm's forearm is measured between points whose distance changes with pronation by 0.1 mm
    np.testing.assert_allclose(motion.hands[1] - motion.hands[0], paths[1] - paths[0], atol=1e-4)
    np.testing.assert_allclose(motion.bases.sum(axis=0), 0.0, atol=1e-12)


def test_the_shipped_recording_of_both_arms():
    motion = fit_arms(read_recording("both-arms"))
    assert not any("model" in text for text in motion.quality_warnings)
    # Where LOWR is hidden, the points of the hand would place it to 17 mm (90 %), which is more than is allowed.
    assert [len(motion), *map(len, motion.arms)] == [315] * 3
    np.testing.assert_array_equal(motion.arms[0].frames, motion.arms[1].frames)
    for fit in motion.arms:
        residuals = fit.residual_summary()
        assert max(residuals[name]["median"] for name in fit.segment_lengths) < 0.3
        assert fit.observable.all()
    assert 0.1 < np.median(np.linalg.norm(motion.hands[1] - motion.hands[0], axis=-1)) < 1.0
    assert sum("frames in the middle" in text for text in motion.quality_warnings) == 1
