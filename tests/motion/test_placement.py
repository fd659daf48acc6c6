"""Where a hand path lets an arm make the wanted ellipsoids: what is found, what is kept, and what is told."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import block_diag

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.chain import pose, rotation_about
from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.motion import SeedBank
from maniport.motion.placement.placement import place_path
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.report import report_of
from maniport.spd.kernels import congruence
from maniport.spd.regularization import Regularization

DAMPING = Regularization.absolute(0.003)
TIME = np.linspace(0.0, 2.0, 12)


@pytest.fixture(scope="module")
def motion(panda):
    """A motion of the Panda: its own hand path and ellipsoids."""
    start = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5])
    joints = start + 0.4 * np.sin(np.outer(TIME, [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.5]))
    return panda.forward(joints)[:, :3, 3], panda.manipulability(joints)


def moved(arm, way):
    """The arm with its base elsewhere, told in the same frame."""
    shift, chain = pose(way), arm.chain
    first = replace(chain.joints[0], placement=shift @ chain.joints[0].placement)
    frames = {
        name: replace(one, placement=shift @ one.placement) if one.joint == 0 else one
        for name, one in chain.frames.items()
    }
    return Arm(replace(chain, joints=(first, *chain.joints[1:]), frames=frames))


@pytest.fixture(scope="module")
def known(panda, bank):
    """What all searches for a place have in common; little effort and a small reachability_map serve."""
    return {
        "damping": DAMPING,
        "bank": bank,
        "reachability_map": ReachabilityMap(panda, VELOCITY, 20_000),
        "planning_effort": "quick",
    }


def test_own_paths_of_two_arms_in_one_place_have_floor_zero(panda, known, motion):
    """Where two arms themselves made the paths of both hands, a turn and a shift of both together are undone for both.

    One place is right for both: the paths keep their relation.
    """
    aside = moved(panda, [0.1, 0.6, 0.0])
    reachability_maps, banks = (
        (known["reachability_map"], ReachabilityMap(aside, VELOCITY, 20_000)),
        (known["bank"], SeedBank.build(aside, 4096)),
    )
    both = {"damping": DAMPING, "reachability_map": reachability_maps, "bank": banks, "planning_effort": "quick"}
    path, profile = motion
    tips, turn = (path, path[::-1] + np.array([0.1, 0.6, 0.0])), rotation_about(2, 0.7)
    middle = np.concatenate(tips).mean(axis=0)
    world, turned = (
        [(tip - middle) @ turn for tip in tips],
        [congruence(turn.T, one) for one in (profile, profile[::-1])],
    )
    found = place_path(world, turned, (panda, aside), scale=1.0, yaw=0.7, offset=middle, **both)
    for placed, tip in zip(found, tips, strict=True):
        assert_allclose(placed.path, tip, atol=1e-12)
        assert placed.distance.max() < 1e-3
    first, second = place_path(world, turned, (panda, aside), **both, workspace=[(0.2, 0.8)] * 3)
    assert (first.scale, first.yaw, *first.offset) == (second.scale, second.yaw, *second.offset)
    assert_allclose(first.path - second.path, first.scale * (world[0] - world[1]) @ first.rotation.T, atol=1e-12)
    assert min(first.path.min(), second.path.min()) >= 0.2 - 1e-8


def test_paths_of_several_arms_must_be_as_many(panda, known, motion):
    """Paths, profiles and points fewer than there are arms are told, by name."""
    path, profile = motion
    both = {"reachability_map": (known["reachability_map"],) * 2, "bank": (known["bank"],) * 2}
    with pytest.raises(InvalidInputError, match="profile"):
        place_path((path, path), (profile,), (panda, panda))
    with pytest.raises(InvalidInputError, match=r"paths\[1\] must have shape"):
        place_path((path, path[:-1]), (profile, profile), (panda, panda), **both)
    with pytest.raises(InvalidInputError, match=r"profiles\[1\] must have shape"):
        place_path((path, path), (profile, profile[:-1]), (panda, panda), **both)


def test_own_path_is_found_again(panda, known, motion):
    """A scaled, rotated and shifted path of the arm returns to where the pointwise optimum is near 0."""
    path, profile = motion
    turn = rotation_about(2, 0.7)
    moved, turned = 0.8 * (path - [1.0, 2.0, 3.0]) @ turn.T, congruence(turn, profile)
    placed = place_path(moved, turned, panda, **known)
    fixed = place_path(moved, turned, panda, scale=1.0, yaw=0.0, offset=(0.45, 0.0, 0.4), **known)
    assert placed.reachable.all()
    assert np.median(placed.distance) < 0.15
    assert np.median(placed.distance) < 0.5 * np.median(fixed.distance)
    assert_allclose(placed.path, placed.apply(moved), atol=1e-12)


def test_fixed_values_are_kept(panda, known, motion):
    """A fixed scale, yaw and height are kept, and the placed path is similar to the given one."""
    path, profile = motion
    placed = place_path(path, profile, panda, scale=0.9, yaw=0.3, offset=(None, None, 0.5), **known)
    assert placed.scale == pytest.approx(0.9, abs=1e-12)
    assert placed.yaw == pytest.approx(0.3, abs=1e-12)
    assert placed.offset[2] == 0.5
    turn = rotation_about(2, 0.3)
    assert_allclose(placed.path, 0.9 * (path - path.mean(axis=0)) @ turn.T + placed.offset, atol=1e-12)
    assert_allclose(placed.profile, congruence(turn, profile), atol=1e-12)


def test_far_path_is_reported(panda, known, motion):
    """A path out of reach is no error: mask, error and facts say where and by how much."""
    path, profile = motion
    far = path.copy()
    far[5:] += [0.0, 0.0, 2.0]
    placed = place_path(far, profile, panda, scale=1.0, yaw=0.0, offset=far.mean(axis=0), **known)
    assert_array_equal(placed.reachable, np.arange(12) < 5)
    assert placed.position_error[5:].min() > 1.0
    assert "7 of 12" in " ".join(report_of(placed).warnings)
    assert "7 out of reach" in repr(placed)
    assert np.all(panda.within_limits(placed.joint_positions))
    assert np.all(np.isfinite(placed.distance))


@pytest.mark.parametrize("part", ["rotation", "full"])
def test_other_parts_turn_too(panda, motion, part):
    """Rotational and full ellipsoids turn with the path; the arm's own have floor 0 in their place."""
    start = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5])
    joints = start + 0.2 * np.sin(np.outer(TIME[:6], np.ones(7)))
    path, profile = panda.forward(joints)[:, :3, 3], panda.manipulability(joints, part=part)
    bank = SeedBank.build(panda, 4096, spec=EllipsoidSpec(part=part))
    reachability_map = ReachabilityMap(panda, EllipsoidSpec(part=part), 4096)
    turn = rotation_about(2, -0.5)
    blocks = block_diag(turn, turn) if part == "full" else turn
    placed = place_path(
        path @ turn.T, congruence(blocks, profile), panda, scale=1.0, yaw=0.5, offset=path.mean(axis=0),
        damping=DAMPING, spec=EllipsoidSpec(part=part), reachability_map=reachability_map, bank=bank,
    )  # fmt: skip
    assert_allclose(placed.profile, profile, atol=1e-12)
    assert placed.distance.max() < 1e-2


def test_leaning_base_sees_the_path_turned_the_other_way(panda, known, motion):
    """With the base mounted as found, path and ellipsoids are the given ones in the world, but for yaw and scale."""
    path, profile = motion
    placed = place_path(path, profile, panda, tilt=0.6, scale=0.8, yaw=0.2, **known)
    assert placed.tilt == 0.6
    assert_allclose(placed.mount @ [0, 0, 1], _leaning(0.6, placed.heading), atol=1e-12)
    world = (placed.path - placed.offset) @ placed.mount.T
    yaw = rotation_about(2, 0.2)
    assert_allclose(world, 0.8 * (path - path.mean(axis=0)) @ yaw.T, atol=1e-12)
    assert_allclose(congruence(placed.mount, placed.profile), congruence(yaw, profile), atol=1e-12)
    assert_allclose(placed.apply(path), placed.path, atol=1e-12)
    assert_allclose(placed.turned(profile), placed.profile, atol=1e-12)
    assert "tilted by 34.4°" in repr(placed)


def _leaning(tilt, heading):
    return [np.sin(tilt) * np.cos(heading), np.sin(tilt) * np.sin(heading), np.cos(tilt)]


def test_points_between_those_that_count_are_in_reach(panda, known, motion):
    """A point beyond the arm's reach, next to those by which the place is judged, moves the path to where it is in."""
    path, profile = motion
    whole = np.vstack([path, path[-1] + [0.6, 0.0, 0.0]])
    common = known | {"reachability_map": ReachabilityMap(panda, VELOCITY, 10_000, collisions=True), "yaw": 0.0}
    tips = [place_path(path, profile, panda, whole=every, **common).apply(whole[-1]) for every in (path, whole)]
    unmoved, moved = np.linalg.norm(common["reachability_map"].offsets(np.stack(tips)), axis=1)
    assert moved < 0.02 < 0.05 < unmoved


def test_path_stays_in_its_workspace(panda, known, motion):
    """Every point lies within the bounds, which shrink the path where it is too large; open sides bind nothing."""
    path, profile = motion
    low, high = np.array([0.3, -0.1, -np.inf]), np.array([0.45, 0.2, 0.5])
    bounds = ((0.3, 0.45), (-0.1, 0.2), (None, 0.5))
    placed = place_path(path, profile, panda, workspace=bounds, scale=(0.1, 2.0), tilt="free", **known)
    assert np.all(placed.path >= low - 1e-8)
    assert np.all(placed.path <= high + 1e-8)


def test_table_keeps_the_path_above(panda, known, motion):
    """With a table in what the arm is kept apart from, no point lies below it; with a leaning base it is refused."""
    path, profile = motion
    apart = Collisions.of(panda, table=0.0)
    common = known | {"reachability_map": ReachabilityMap(panda, VELOCITY, 4096, collisions=apart)}
    placed = place_path(path, profile, panda, offset=(0.4, 0.0, None), scale=(0.8, 1.0), **common)
    assert placed.path[:, 2].min() >= -1e-8
    with pytest.raises(InvalidInputError, match="a table is level in the frame of the base"):
        place_path(path, profile, panda, tilt=0.3, **common)


def test_candidates_are_ranked(panda, known, motion):
    """The placement itself is the first candidate; `rank` takes another one, and an error names the largest rank."""
    path, profile = motion
    first = place_path(path, profile, panda, scale=0.7, **known)
    second = place_path(path, profile, panda, scale=0.7, rank=2, **known)
    for placed, candidate in ((first, first.candidates[0]), (second, second.candidates[1])):
        assert_array_equal(placed.offset, candidate.offset)
        assert placed.yaw == candidate.yaw
        assert candidate.distance.shape == (12,)
        assert_allclose(placed.apply(path), placed.path, atol=1e-12)
    assert [one.rms for one in second.candidates] == [one.rms for one in first.candidates]
    assert not np.allclose(second.path, first.path)
    for rank in (0, len(first.candidates) + 1):
        with pytest.raises(InvalidInputError, match="rank"):
            place_path(path, profile, panda, scale=0.7, rank=rank, **known)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"path": np.zeros((3, 3))}, "path must have shape"),
        ({"profile": np.tile(np.eye(2), (12, 1, 1))}, "profile must hold 3×3"),
        ({"turn": -np.eye(3)}, "turn must be a rotation"),
        ({"scale": 0.0}, "scale must be a number above 0"),
        ({"scale": (1.0, 0.5)}, "scale.1. must be a number above 1"),
        ({"yaw": "left"}, "yaw must be"),
        ({"offset": (0.0, 1.0)}, "offset must be three numbers"),
        ({"spec": EllipsoidSpec(part="rotation")}, "does not fit"),
        ({"tilt": 4.0}, "tilt must be a number in .0, 3.14"),
        ({"collisions": 3, "reachability_map": None}, "collisions must be"),
        ({"workspace": ((0.0, 1.0), (0.5, 0.5), (None, None))}, "workspace.1..1. must be a number above 0.5"),
        ({"workspace": ((3.0, 4.0), (None, None), (None, None))}, "reaches nothing in x 3.00 to 4.00"),
        ({"workspace": ((0.4, 0.41), (None, None), (None, None))}, "does not fit into it"),
    ],
)
def test_bad_input_is_refused(panda, known, motion, change, message):
    """What cannot be used is named, with what was found."""
    arguments = {"path": motion[0], "profile": motion[1], "arm": panda, **known} | change
    with pytest.raises(InvalidInputError, match=message):
        place_path(**arguments)
