"""Where a hand path lets an arm make the wanted ellipsoids: what is found, what is kept, and what is told."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import block_diag

from maniport.bodies import EllipsoidSpec
from maniport.bodies.chain import rotation_about
from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import congruence
from maniport.spd.regularization import Regularization
from maniport.telling import facts_of
from maniport.tracking import Objective, StartBank
from maniport.tracking.placement.placement import place_path
from maniport.tracking.placement.placement_search import Journey, _cost
from maniport.tracking.search.descent import postures_along
from sizes import few_places

DAMPING = Regularization.absolute(0.003)
TIME = np.linspace(0.0, 2.0, 12)


@pytest.fixture(scope="module")
def motion(panda):
    """A motion of the Panda: its own hand path and ellipsoids."""
    start = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5])
    joints = start + 0.4 * np.sin(np.outer(TIME, [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.5]))
    return panda.forward(joints)[:, :3, 3], panda.manipulability(joints)


@pytest.fixture
def brief():
    """A search over fewer candidates, for properties that do not depend on how good the place is."""
    with few_places():
        yield


def test_own_path_in_its_place_has_floor_zero(panda, bank, motion):
    """Where the arm itself made path and ellipsoids, the floor is 0 and the hand is on the path."""
    path, profile = motion
    placed = place_path(path, profile, panda, scale=1.0, yaw=0.0, offset=path.mean(axis=0), damping=DAMPING, bank=bank)
    assert_allclose(placed.path, path, atol=1e-12)
    assert_allclose(placed.profile, profile, atol=1e-12)
    assert placed.distance.max() < 1e-3
    assert placed.reachable.all()
    assert placed.position_error.max() < 1e-5


def test_own_path_is_found_again(panda, bank, motion):
    """Shrunk, turned about the vertical and shifted with its ellipsoids, it is brought where the floor is near 0."""
    path, profile = motion
    turn = rotation_about(2, 0.7)
    moved, turned = 0.8 * (path - [1.0, 2.0, 3.0]) @ turn.T, congruence(turn, profile)
    placed = place_path(moved, turned, panda, damping=DAMPING, bank=bank)
    there = place_path(moved, turned, panda, scale=1.0, yaw=0.0, offset=(0.45, 0.0, 0.4), damping=DAMPING, bank=bank)
    assert placed.reachable.all()
    assert np.median(placed.distance) < 0.15
    assert np.median(placed.distance) < 0.5 * np.median(there.distance)
    assert_allclose(placed.path, placed.apply(moved), atol=1e-12)


def test_what_is_given_stays(panda, bank, motion, brief):
    """A given scale, yaw and height are kept, and the path is their similarity."""
    path, profile = motion
    placed = place_path(path, profile, panda, scale=0.9, yaw=0.3, offset=(None, None, 0.5), damping=DAMPING, bank=bank)
    assert placed.scale == pytest.approx(0.9, abs=1e-12)
    assert placed.yaw == pytest.approx(0.3, abs=1e-12)
    assert placed.offset[2] == 0.5
    turn = rotation_about(2, 0.3)
    assert_allclose(placed.path, 0.9 * (path - path.mean(axis=0)) @ turn.T + placed.offset, atol=1e-12)
    assert_allclose(placed.profile, congruence(turn, profile), atol=1e-12)


def test_scale_stays_within_its_range(panda, bank, motion, brief):
    """A range of scales is kept."""
    path, profile = motion
    placed = place_path(path, profile, panda, scale=(0.4, 0.5), yaw=0.0, damping=DAMPING, bank=bank)
    assert 0.4 - 1e-12 <= placed.scale <= 0.5 + 1e-12


def test_path_is_turned_as_the_ellipsoids_were(panda, bank, motion):
    """With the rotation that turned the ellipsoids the path follows and the floor is 0; without, it is not."""
    path, profile = motion
    turn = rotation_about(0, np.pi / 2)
    teacher = path @ turn  # in a frame in which the path has yet to be turned
    place = {"scale": 1.0, "yaw": 0.0, "offset": path.mean(axis=0), "damping": DAMPING, "bank": bank}
    placed = place_path(teacher, profile, panda, turn=turn, **place)
    assert_allclose(placed.path, path, atol=1e-12)
    assert placed.distance.max() < 1e-3
    assert np.median(place_path(teacher, profile, panda, **place).distance) > 0.3


def test_turning_the_teacher_changes_nothing(panda, bank, motion, brief):
    """Path and ellipsoids of a teacher who faces elsewhere, with the turn that undoes it, are placed the same."""
    path, profile = motion
    turn = rotation_about(1, 0.4) @ rotation_about(0, 1.0)
    place = {"scale": 1.0, "offset": (None, None, 0.5), "damping": DAMPING, "bank": bank}
    first = place_path(path, profile, panda, **place)
    second = place_path(path @ turn, profile, panda, turn=turn, **place)
    assert_allclose(second.path, first.path, atol=1e-2)
    assert_allclose(np.median(second.distance), np.median(first.distance), atol=0.02)


def test_far_path_is_reported(panda, bank, motion):
    """A path out of reach is no error: mask, error and facts say where and by how much."""
    path, profile = motion
    far = path.copy()
    far[5:] += [0.0, 0.0, 2.0]
    placed = place_path(far, profile, panda, scale=1.0, yaw=0.0, offset=far.mean(axis=0), damping=DAMPING, bank=bank)
    assert_array_equal(placed.reachable, np.arange(12) < 5)
    assert placed.position_error[5:].min() > 1.0
    assert "7 of 12 points of the path are out of reach" in " ".join(facts_of(placed).warnings)
    assert "7 out of reach" in repr(placed)
    assert np.all(panda.within_limits(placed.joint_positions))
    assert np.all(np.isfinite(placed.distance))


@pytest.mark.parametrize("part", ["rotation", "full"])
def test_other_parts_turn_too(panda, motion, part):
    """Rotational and full ellipsoids turn with the path; the arm's own have floor 0 in their place."""
    start = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5])
    joints = start + 0.2 * np.sin(np.outer(TIME[:6], np.ones(7)))
    path, profile = panda.forward(joints)[:, :3, 3], panda.manipulability(joints, part=part)
    bank = StartBank.build(panda, 4096, spec=EllipsoidSpec(part=part))
    turn = rotation_about(2, -0.5)
    blocks = block_diag(turn, turn) if part == "full" else turn
    placed = place_path(
        path @ turn.T, congruence(blocks, profile), panda, scale=1.0, yaw=0.5, offset=path.mean(axis=0),
        damping=DAMPING, spec=EllipsoidSpec(part=part), bank=bank,
    )  # fmt: skip
    assert_allclose(placed.profile, profile, atol=1e-12)
    assert placed.distance.max() < 1e-2


def test_slopes_of_the_cost(panda, bank, motion):
    """The derivative in scale, yaw and offset, with the joints at their best, is that of finite differences."""
    path, profile = motion
    journey = Journey(Objective.of(panda, damping=DAMPING), bank, path - path.mean(axis=0), 1.3 * profile).thinned(6)
    placement = np.array([0.1, 0.2, *(path.mean(axis=0) + 0.02)])
    q = _cost(journey, placement, None)[2]
    for _ in range(3):  # settled
        _, slopes, q = _cost(journey, placement, q)
    step = 1e-5
    numeric = [
        (_cost(journey, placement + h, q)[0] - _cost(journey, placement - h, q)[0]) / (2 * step)
        for h in step * np.eye(5)
    ]
    assert_allclose(slopes, numeric, rtol=0.02, atol=0.02)


def test_postures_follow_one_another(panda, bank, motion):
    """Along the arm's own motion, the joints found change little from point to point and make its ellipsoids."""
    path, profile = motion
    targets = Objective.of(panda, damping=DAMPING).targets(profile, path)
    q, cost = postures_along(targets, bank.starts(profile[:1], path[:1], 16))
    assert q.shape == (1, len(path), 7)
    assert np.abs(np.diff(q[0], axis=0)).max() < 0.4
    assert cost[0] < 0.05


def test_same_seed_same_place(panda, bank, motion, brief):
    """The same seed gives the same bits."""
    path, profile = motion
    first, second = (
        place_path(path, profile, panda, scale=1.0, yaw=0.0, damping=DAMPING, bank=bank, random_state=3)
        for _ in range(2)
    )
    assert_array_equal(first.offset, second.offset)
    assert_array_equal(first.distance, second.distance)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"path": np.zeros((3, 3))}, "path must have shape"),
        ({"path": np.full((12, 3), np.nan)}, "path must be finite"),
        ({"profile": np.tile(np.eye(2), (12, 1, 1))}, "profile must hold 3×3"),
        ({"turn": -np.eye(3)}, "turn must be a rotation"),
        ({"scale": 0.0}, "scale must be a number above 0"),
        ({"scale": (1.0, 0.5)}, "scale.1. must be a number above 1"),
        ({"scale": (1.0, 2.0, 3.0)}, "scale must be one number or a range"),
        ({"yaw": "left"}, "yaw must be"),
        ({"offset": (0.0, 1.0)}, "offset must be three numbers"),
        ({"damping": -1.0}, "damping must be a number"),
        ({"n_points": 0}, "n_points must be a whole number of at least 1"),
        ({"spec": EllipsoidSpec(part="rotation")}, "does not fit"),
    ],
)
def test_bad_input_is_refused(panda, bank, motion, change, message):
    """What cannot be used is named, with what was found."""
    arguments = {"path": motion[0], "profile": motion[1], "arm": panda, "bank": bank} | change
    with pytest.raises(InvalidInputError, match=message):
        place_path(**arguments)


def test_indefinite_profile_is_refused(panda, bank, motion):
    """An ellipsoid that is none is an error."""
    with pytest.raises(NotSPDError, match="profile"):
        place_path(motion[0], -motion[1], panda, bank=bank, damping=DAMPING)
