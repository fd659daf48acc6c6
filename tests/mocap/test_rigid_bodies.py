"""Hidden points are placed by the rigid body that they form with visible points."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import arms
from maniport.errors import RecordingError
from maniport.mocap import Recording, fit_arm, read_recording, synthetic_recording
from maniport.mocap.rigid_bodies import with_hidden_points

TRUNK = ("trunk_low", "trunk_high", "trunk_back", "trunk_front")
EXTRA = {
    "back": (-0.12, 0.1, -0.1),
    "rib": (0.09, -0.11, -0.18),
}  # on the trunk, without a role [m]


@pytest.fixture(scope="module")
def truth():
    """An arm and a trunk that moves, with two markers more, and the joint angles."""
    arm = arms.myoarm(0.31, 0.26, 0.06)
    time = np.linspace(0.0, 8.0, 321)
    middle = np.radians([40.0, 60.0, -10.0, 70.0, 5.0, -5.0, 5.0])
    phase = np.arange(arm.dof)
    q = middle + np.radians(25.0) * np.sin(1.3 * time[:, None] + phase)
    still = synthetic_recording(arm, q, time)
    neck = still.point("trunk_back") - [-0.1, 0.0, 0.0]
    points = [*np.moveaxis(still.positions, 1, 0), *(neck + place for place in EXTRA.values())]
    turns = 0.6 * np.sin(np.outer(time, [0.7, 0.5, 0.9]))
    rotation = Rotation.from_rotvec(turns).as_matrix()
    shift = 0.3 * np.sin(np.outer(time, [0.4, 0.6, 0.3]))
    moved = np.einsum("nij,knj->nki", rotation, np.stack(points)) + shift[:, None]
    return Recording((*still.names, *EXTRA), moved, time), q


@pytest.fixture(scope="module")
def trunk(truth):
    """The points of the trunk alone."""
    return truth[0].select([*TRUNK, *EXTRA])


def column(recording, name):
    return recording.names.index(name)


def hidden(recording, **gaps):
    """Hide points in slices of frames."""
    positions = recording.positions.copy()
    for name, rows in gaps.items():
        positions[rows, column(recording, name)] = np.nan
    return replace(recording, positions=positions)


def errors(recording, truth, name):
    """Distances of a point from its true position [m]; nan where it is missing."""
    return np.linalg.norm(recording.point(name) - truth.point(name), axis=-1)


def test_nothing_changes_without_hidden_points(truth):
    recording, _ = truth
    assert with_hidden_points(recording, recording) is recording
    ladder = read_recording("ladder")
    assert with_hidden_points(ladder, ladder) is ladder
    names = [name for name in recording.names if name not in EXTRA]
    with_extra = fit_arm(recording)
    without = fit_arm(recording.select(names))
    np.testing.assert_array_equal(with_extra.joint_angles, without.joint_angles)


@pytest.mark.parametrize("name", TRUNK)
def test_a_hidden_point_of_the_trunk_is_placed(truth, name):
    recording, q = truth
    part = hidden(recording, **{name: slice(100, 180)})
    filled = with_hidden_points(part, part)
    assert errors(filled, recording, name)[100:180].max() < 1e-6
    np.testing.assert_array_equal(filled.positions[180:], recording.positions[180:])
    fit = fit_arm(part)
    np.testing.assert_array_equal(fit.frames, np.arange(len(q)))
    np.testing.assert_allclose(fit.joint_angles, fit_arm(recording).joint_angles, atol=1e-6)
    assert any(note.startswith(f"{name}: hidden in 80 frames") for note in fit.notes)
    assert not fit.quality_warnings


def test_one_or_another_point_of_the_trunk_is_always_hidden(truth):
    """No frame has all points of the trunk; each shows enough of them."""
    recording, q = truth
    points = (*TRUNK, *EXTRA)
    gaps = {name: slice(54 * i, 54 * (i + 1)) for i, name in enumerate(points)}
    part = hidden(recording, **gaps)
    seen = np.isfinite(part.positions[..., 0])[:, [column(part, name) for name in points]]
    assert not seen[: 54 * 4].all(axis=1).any()
    fit = fit_arm(part)
    np.testing.assert_array_equal(fit.frames, np.arange(len(q)))
    np.testing.assert_allclose(fit.joint_angles, fit_arm(recording).joint_angles, atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_points_hidden_at_random_with_noise_and_moving_skin(truth, seed):
    """The trunk turns by less than 2° from the one of all markers; noise is averaged."""
    recording, _ = truth
    generator = np.random.default_rng(seed)
    points = (*TRUNK, *EXTRA)
    time = recording.time
    positions = recording.positions.copy()
    for name in points:
        skin = 0.004 * np.sin(
            np.outer(time, generator.uniform(0.3, 2.0, 3)) + generator.uniform(0, 6, 3)
        )
        positions[:, column(recording, name)] += skin + generator.normal(0.0, 0.001, skin.shape)
    whole = replace(recording, positions=positions)
    hide = positions.copy()
    for name in points:
        start = int(generator.integers(0, 250))
        hide[start : start + 60, column(recording, name)] = np.nan
    part = replace(recording, positions=hide)
    enough = np.isfinite(hide[:, [column(part, name) for name in points], 0]).sum(axis=1) >= 4
    filled = with_hidden_points(part, part)
    for name in TRUNK:
        gone = np.isnan(part.point(name)[:, 0])
        found = errors(filled, whole, name)[gone & enough]
        assert np.isfinite(found).mean() > 0.9
        assert np.nanmedian(found) < 0.008
        assert np.nanmax(found) < 0.02


def with_more_points(trunk, count=5):
    """Add points of the same trunk."""
    x = trunk.point("trunk_front") - trunk.point("trunk_back")
    z = trunk.point("trunk_high") - trunk.point("trunk_low")
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    z /= np.linalg.norm(z, axis=-1, keepdims=True)
    rotation = np.stack([x, np.cross(z, x), z], axis=-1)
    places = np.random.default_rng(0).uniform(-0.15, 0.15, (count, 3))
    more = trunk.point("trunk_back")[:, None] + np.einsum("nij,kj->nki", rotation, places)
    names = (*trunk.names, *(f"more{k}" for k in range(count)))
    return Recording(names, np.concatenate([trunk.positions, more], axis=1), trunk.time)


def test_noise_is_averaged(trunk):
    """The error of a placed point is less than the noise of a marker, where eight others are seen."""
    noise = 0.003
    clean = with_more_points(trunk)
    generator = np.random.default_rng(1)
    noisy = clean.positions + generator.normal(0.0, noise, clean.positions.shape)
    part = hidden(replace(clean, positions=noisy), trunk_back=slice(100, 200))
    filled = with_hidden_points(part.select(["trunk_back"]), part)
    found = (filled.point("trunk_back") - clean.point("trunk_back"))[100:200]
    assert np.sqrt(np.mean(found**2)) < noise


def test_fewer_than_three_visible_points_are_a_gap(truth):
    recording, q = truth
    rows = slice(100, 150)
    gaps = dict.fromkeys(("trunk_low", "trunk_back", "trunk_front", *EXTRA), rows)
    part = hidden(recording, **gaps)
    assert np.isnan(with_hidden_points(part, part).point("trunk_low")[rows]).all()
    fit = fit_arm(part)
    np.testing.assert_array_equal(fit.frames, np.delete(np.arange(len(q)), rows))
    assert any("50 frames omitted" in note and "trunk missing" in note for note in fit.notes)
    three = hidden(recording, **dict.fromkeys(("trunk_low", "trunk_back", "rib"), rows))
    assert len(fit_arm(three)) == len(q)


@pytest.mark.parametrize("visible", [2, 3])
def test_three_visible_points_are_enough(trunk, visible):
    rows = slice(100, 150)
    shown = ("trunk_high", "back", "rib")[:visible]
    names = [name for name in trunk.names if name not in shown]
    part = hidden(trunk, **dict.fromkeys(names, rows))
    found = errors(with_hidden_points(part, part), trunk, "trunk_low")[rows]
    if visible == 2:
        assert np.isnan(found).all()
    else:
        assert found.max() < 1e-6


def test_points_on_one_line_do_not_place_another(trunk):
    """Of the trunk, low, high and a point between them are visible: the rotation about them is not."""
    between = (trunk.point("trunk_low") + trunk.point("trunk_high")) / 2
    positions = np.concatenate([trunk.positions, between[:, None]], axis=1)
    whole = Recording((*trunk.names, "between"), positions, trunk.time)
    rows = slice(100, 150)
    part = hidden(whole, **dict.fromkeys(("trunk_back", "trunk_front", *EXTRA), rows))
    assert np.isnan(with_hidden_points(part, part).point("trunk_front")[rows]).all()


@pytest.mark.parametrize("wrong", ["ghost", "swapped"])
@pytest.mark.parametrize("last", [140, 190])
def test_wrong_points_do_not_count(trunk, wrong, last):
    """While one point is hidden, another one is elsewhere for long, or two have each other's names."""
    rows = slice(100, 200)
    whole = with_more_points(trunk)
    positions = hidden(whole, trunk_low=rows).positions.copy()
    first = column(whole, "rib")
    second = column(whole, "back")
    if wrong == "ghost":
        positions[110:last, first] += [0.1, 0.15, 0.0]
    else:
        positions[110:last, [first, second]] = positions[110:last, [second, first]]
    part = replace(whole, positions=positions)
    filled = with_hidden_points(part, part)
    assert errors(filled, whole, "trunk_low")[rows].max() < 1e-3


def test_a_wrong_point_among_three_is_a_gap(trunk):
    rows = slice(100, 200)
    positions = hidden(trunk, trunk_low=rows, trunk_back=rows, rib=rows).positions.copy()
    positions[120:140, column(trunk, "back")] += [0.1, 0.15, 0.0]
    part = replace(trunk, positions=positions)
    found = errors(with_hidden_points(part, part), trunk, "trunk_low")
    assert np.isnan(found[120:140]).all()
    assert found[100:120].max() < 1e-3


def test_wrong_points_elsewhere_do_not_change_the_shape(trunk):
    positions = hidden(trunk, trunk_low=slice(100, 150)).positions.copy()
    positions[220:245, column(trunk, "rib")] += 0.2
    positions[260:280, column(trunk, "trunk_low")] += 0.3
    part = replace(trunk, positions=positions)
    filled = with_hidden_points(part, part)
    assert errors(filled, trunk, "trunk_low")[100:150].max() < 1e-3


def test_clusters_of_forearm_and_hand_are_bodies(truth):
    """A hidden wrist point of a forearm with a cluster, and a hidden hand point, are placed to 5 mm."""
    recording, q = truth
    elbow, wrist, hand = (recording.point(name) for name in ("elbow", "wrist", "hand"))
    radial = recording.point("wrist_radial")
    along = (wrist - elbow) / np.linalg.norm(wrist - elbow, axis=-1, keepdims=True)
    across = (radial - wrist) / np.linalg.norm(radial - wrist, axis=-1, keepdims=True)
    over = np.cross(along, across)
    finger = (hand - wrist) / np.linalg.norm(hand - wrist, axis=-1, keepdims=True)
    palm = np.cross(finger, across)
    points = {
        "fa1": wrist - 0.06 * along + 0.02 * over,
        "fa2": wrist - 0.09 * along + 0.03 * across,
        "fa3": wrist - 0.04 * along - 0.03 * across + 0.02 * over,
        "h1": hand + 0.02 * palm,
        "h2": hand + 0.03 * np.cross(palm, finger),
        "h3": hand - 0.03 * finger,
    }
    whole = Recording(
        (*recording.names, *points),
        np.concatenate([recording.positions, np.stack(list(points.values()), axis=1)], axis=1),
        recording.time,
    )
    part = hidden(whole, wrist_radial=slice(60, 120), wrist=slice(60, 120), hand=slice(200, 260))
    filled = with_hidden_points(part, part)
    for name in ("wrist_radial", "wrist", "hand"):
        assert errors(filled, whole, name).max() < 5e-3
    assert len(fit_arm(part)) == len(q)


def test_a_point_of_a_joint_that_moves_is_not_placed(truth):
    """Shoulder, elbow and wrist are no rigid body, nor is a forearm whose pronation is not measured."""
    recording, q = truth
    kept = [name for name in recording.names if "wrist_" not in name and name != "hand"]
    part = hidden(recording.select(kept), wrist=slice(100, 150))
    assert np.isnan(with_hidden_points(part, part).point("wrist")[100:150]).all()
    fit = fit_arm(part)
    np.testing.assert_array_equal(fit.frames, np.delete(np.arange(len(q)), slice(100, 150)))

    twisting = ["elbow_medial", "elbow_lateral", "wrist_ulnar", "wrist_radial", "elbow"]
    part = hidden(recording, wrist_radial=slice(100, 150)).select(twisting)
    filled = with_hidden_points(part, part).point("wrist_radial")[100:150]
    wrong = np.linalg.norm(filled - recording.point("wrist_radial")[100:150], axis=-1)
    assert np.all(np.isnan(wrong) | (wrong < 0.02))


def test_a_placed_point_joins_the_measured_ones(truth):
    """A marker that slides over the skin does not jump where it is hidden and seen again."""
    recording, _ = truth
    positions = recording.positions.copy()
    slide = 0.008 * np.sin(0.5 * recording.time)[:, None] * [1.0, 0.0, 1.0]
    positions[:, column(recording, "trunk_low")] += slide
    whole = replace(recording, positions=positions)
    part = hidden(whole, trunk_low=slice(100, 150))
    found = errors(with_hidden_points(part, part), whole, "trunk_low")
    assert found[[100, 149]].max() < 0.0015
    assert found.max() < 0.005


def test_a_trunk_that_is_never_seen_stays_an_error(truth):
    recording, _ = truth
    late = dict.fromkeys(("trunk_high", "trunk_back", "trunk_front", *EXTRA), slice(0, 160))
    part = hidden(recording, trunk_low=slice(160, 321), **late)
    with pytest.raises(RecordingError, match="trunk"):
        fit_arm(part)
