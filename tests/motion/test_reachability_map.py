"""The reachability map: joints without effect, and nodes on a path."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from arm_problems import arm_problem
from maniport.arms import VELOCITY, Arm, EllipsoidSpec, load_arm
from maniport.arms.chain import pose
from maniport.arms.restriction import standing
from maniport.motion.plan.reachability_map import IN_PLACE, ReachabilityMap
from maniport.motion.plan.roadmap import shortest_path
from sizes import SIX_ROWS

SIX = Arm.from_dh("six", SIX_ROWS, -3.1, 3.1)
SHOULDER = Arm(
    standing(SIX.chain, pose((0.1, 0.2, 0.3), (-np.pi / 2, 0.0, 0.0)))
)  # its first axis is horizontal


def targets_of(arm, count=6, spec=VELOCITY, seed=3):
    """Ellipsoids that an arm makes, with the tip where it makes them."""
    q = arm.sample(count, seed)
    return arm_problem(arm, arm.ellipsoids(q, spec), arm.forward(q)[:, :3, 3], spec=spec)


def test_joints_without_effect_stay_in_the_middle(panda):
    reachability_map = ReachabilityMap(panda, VELOCITY, 64)
    assert_array_equal(reachability_map.idle, [False] * 6 + [True])
    assert_allclose(reachability_map.q[:, 6], 0.5 * (panda.lower[6] + panda.upper[6]))
    assert (
        not ReachabilityMap(
            load_arm("panda", frame="panda_hand_tcp"), EllipsoidSpec(part="full"), 64
        )
        .idle[:6]
        .any()
    )
    assert not ReachabilityMap(SIX, VELOCITY, 64).idle[:5].any()


@pytest.mark.parametrize("name", ["panda", "crane", "shoulder"])
def test_nodes_have_their_tips_in_place(panda, crane, name):
    """Nodes are within the limits and 0.1 mm, cost what the objective says, and are no more than were wanted."""
    arm = {"panda": panda, "crane": crane, "shoulder": SHOULDER}[name]
    targets = targets_of(arm)
    nodes = ReachabilityMap(arm, VELOCITY, 10_000).nodes(targets, 40, np.random.default_rng(0))
    counts = np.diff(nodes.first)
    assert counts.min() >= 16
    assert counts.max() <= 40
    owner = np.repeat(np.arange(len(targets)), counts)
    assert arm.within_limits(nodes.q).all()
    assert_allclose(nodes.cost, targets[owner].cost(nodes.q))
    away = targets[owner].position_error(nodes.q)
    assert np.median(away) <= IN_PLACE
    in_place = np.bincount(owner[away <= IN_PLACE], minlength=len(targets))
    assert (
        (in_place == counts) | (in_place < 16)
    ).all()  # what is out of place stands in for what is missing


def test_a_first_joint_of_two_turns_goes_on_around_the_arm():
    wide = Arm.from_dh("two turns", SIX_ROWS, [-2 * np.pi, *[-3.1] * 5], [2 * np.pi, *[3.1] * 5])
    angles = np.linspace(-1.5 * np.pi, 1.5 * np.pi, 40)
    q = np.tile(SIX.sample(1, 2), (len(angles), 1))
    q[:, 0] = angles
    targets = arm_problem(wide, wide.manipulability(q), wide.forward(q)[:, :3, 3])
    nodes = ReachabilityMap(wide, VELOCITY, 10_000).nodes(targets, 60, np.random.default_rng(0))
    way = nodes.q[shortest_path(nodes, np.arange(40.0), np.full((40, 6), 1.0))]
    assert np.abs(np.diff(way[:, 0])).max() < 1.0
    assert np.ptp(way[:, 0]) > 2.0 * np.pi


@pytest.mark.parametrize("narrow", [False, True])
def test_out_of_reach_the_nearest_are_nodes(panda, narrow):
    arm = panda
    tip = np.array([[3.0, 0.0, 0.3]])
    if narrow:
        lower = panda.lower.copy()
        upper = panda.upper.copy()
        lower[0] = -0.2
        upper[0] = 0.2
        arm = panda.narrowed(lower, upper)
        tip = np.array([[-0.5, 0.0, 0.4]])
    far = arm_problem(arm, np.eye(3)[None], tip)
    nodes = ReachabilityMap(arm, VELOCITY, 3000).nodes(far, 40, np.random.default_rng(0))
    assert len(nodes.q) == 16
    assert arm.within_limits(nodes.q).all()
    assert far.position_error(nodes.q).max() < 2.5
