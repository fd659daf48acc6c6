"""Both arms in the live view: what each follows, what they share, and what the page has of each."""

import numpy as np
import pytest

from maniport.bodies import Arms, load_arm, load_arms
from maniport.bodies.human import human_arm
from maniport.domain import sample_domain
from maniport.errors import ManiportError
from maniport.tracking import StartBank
from maniport.view.bodies import find_surfaces
from maniport.view.maps import Methods, Refitting
from maniport.view.pair import LivePair
from maniport.view.picture import Wish
from maniport.view.prepare import prepare
from maniport.view.state import LiveState
from real_robots import NEEDS_ROBOTS
from sizes import few_places

METHOD, FRAME = "parallel-transport", 1.0 / 60.0
BASES = np.array([[0.0, 0.02, 0.0], [0.0, -0.02, 0.0]])
ELBOWS = np.tile(np.radians([60.0, 50.0, 0.0, 80.0, 0.0, 0.0, 0.0]), 2)


@pytest.fixture(scope="module")
def pandas():
    """Two robots side by side."""
    return load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])


@pytest.fixture(scope="module")
def make_each():
    """States of the person's arms and a robot's, on small domains."""
    known = {}

    def make(robot):
        states = []
        for side, arm, base in zip(("left", "right"), robot.each, BASES, strict=True):
            person = human_arm("rhuman", side)
            if (robot, side) not in known:
                methods = Methods(sample_domain(person, 128, 0), sample_domain(arm, 256, 1))
                known[robot, side] = methods, StartBank.build(arm, 512, 0)
            methods, bank = known[robot, side]
            states.append(LiveState(person, arm, Refitting(methods, np.eye(3), (METHOD,)), None, bank, base=base))
        return states

    return make


def wish(joints=ELBOWS, tip_follows=False):
    """A wish of both arms."""
    return Wish(joints, METHOD, np.eye(3), tip_follows)


def test_arms_that_share_nothing_move_as_each_by_itself(make_each, pandas):
    """One programme for both gives what two would."""
    pair, alone = LivePair(pandas, *make_each(pandas)), make_each(pandas)
    for joints in (ELBOWS, ELBOWS + 0.1):
        both = pair.pictures(wish(joints), FRAME)
        for found, state, own in zip(both, alone, np.split(joints, 2), strict=True):
            expected = state.advance(wish(own), FRAME)
            np.testing.assert_array_equal(found.target_ellipsoid, expected.target_ellipsoid)
            np.testing.assert_allclose(found.student_joints, expected.student_joints, atol=1e-5)


@NEEDS_ROBOTS
def test_a_torso_that_both_hang_on_is_in_one_place(make_each):
    """Pictures agree on shared joints, which keep their limits, and the arms come nearer to their targets."""
    humanoid = load_arms("talos")
    pair = LivePair(humanoid, *make_each(humanoid))
    first = pair.pictures(wish(), 0.0)
    for _ in range(12):
        later = pair.pictures(wish(), 0.1)
    q = humanoid.joined(*(one.student_joints for one in later))
    humanoid.require_within_limits(q, "q")
    assert sum(one.distance for one in later) < sum(one.distance for one in first)


def test_both_hands_keep_their_relation(make_each, pandas):
    """Until a place is found tips are free, and it is said; then from tip to tip it is as from hand to hand, scaled."""
    pair = LivePair(pandas, *make_each(pandas))
    assert all("searched for" in one.note for one in pair.pictures(wish(tip_follows=True), FRAME))
    persons = [one.teacher for one in pair.each]
    with few_places():
        pair.find_place([arm.sample(4, 0) for arm in persons], METHOD)
    left, right = pair.pictures(wish(tip_follows=True), FRAME)
    hands = [one.teacher_skeleton[-1] + base for one, base in zip((left, right), BASES, strict=True)]
    between, scale = right.target_tip - left.target_tip, pair.each[0].place.scale
    assert np.linalg.norm(between) == pytest.approx(scale * np.linalg.norm(hands[1] - hands[0]))
    assert pair.each[1].place.scale == scale


@NEEDS_ROBOTS
def test_what_both_arms_hang_on_is_drawn_once(pandas):
    """The right arm's surfaces are its own alone; two robots have all of theirs."""
    humanoid = load_arms("talos", lock={"torso_1_joint": 0.0, "torso_2_joint": 0.0})
    (left, right), bare = find_surfaces(humanoid)
    if not bare:
        whole = humanoid.right.surfaces()
        assert 0 < len(right) < len(whole)
        assert min(one.joint for one in right) >= humanoid.trunk
        assert len(left) == len(humanoid.left.surfaces())
    (left, right), bare = find_surfaces(pandas)
    assert bare == ""
    assert len(left) == len(right) == len(pandas.left.surfaces())


def test_the_page_has_controls_and_bodies_of_both(make_each, pandas):
    """Sliders of both of the person's arms, a headline and ellipsoids for each; what a pair does is not recorded."""
    pytest.importorskip("viser")
    from maniport.view.server import LiveView

    pair = LivePair(pandas, *make_each(pandas))
    page = LiveView(pair, METHOD, np.eye(3))
    try:
        panel = page._panel
        assert len(panel._sliders) == 14
        panel._sliders[10].value = 45.0
        assert panel.read(0.0).joints[10] == pytest.approx(np.pi / 4)
        assert "left: distance" in panel._head.content
        assert "right: distance" in panel._head.content
        assert panel._ellipsoids.content.count("achieved") == 2
        assert "| right: feasibility gap |" in panel._methods.content
        left, right = page._scene.sides
        picture = pair.pictures(panel.read(0.0), 0.0)[1]
        page._scene.draw(pair.pictures(panel.read(0.0), 0.0))
        np.testing.assert_allclose(right._of_student._parts[0].position, picture.student_skeleton[-1], atol=1e-6)
        assert left._of_student._parts[0].name == "/robot/left/achieved"
        panel._record.value = True
        assert not panel.records
    finally:
        page.stop()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"side": "both", "robot": "panda"}, "tip"),
        ({"side": "both", "robot": load_arm("panda")}, "maniport.load_arms"),
        ({"side": "left", "robot": "pair"}, "the robot has two arms"),
        ({"side": "both", "robot": "pair", "adapter": "mine.npz"}, "an adapter file is one arm's"),
        ({"side": "both", "robot": "pair", "recording": "ladder"}, "both arms are asked for"),
    ],
)
def test_what_makes_no_pair_is_told_at_once(options, told, pandas):
    """Before anything is sampled."""
    robot = pandas if options["robot"] == "pair" else options["robot"]
    assert isinstance(pandas, Arms)
    with pytest.raises(ManiportError, match=told):
        prepare(**options | {"robot": robot})
