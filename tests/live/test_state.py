"""The live state: wishes in, pictures out, without any page."""

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import ParallelTransport
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError
from maniport.live.maps import GIVEN, Methods
from maniport.live.state import Playback, Wish

FRAME = 1.0 / 30.0
POSE = np.radians([60.0, 50.0, 0.0, 80.0, 0.0, 0.0, 0.0])


def wish(method="icp", joints=POSE, mounting=None, tip_follows=False):
    """A wish, at the identity unless told otherwise."""
    return Wish(joints, method, np.eye(3) if mounting is None else mounting, tip_follows)


def test_every_method_can_be_switched_to(make_state):
    """Each method gives its own wanted ellipsoid, and the robot keeps within its limits."""
    state = make_state()
    wanted = {}
    for name in state.methods:
        picture = state.advance(wish(name), FRAME)
        wanted[name] = picture.target_ellipsoid
        assert state.student.within_limits(picture.student_joints)
        assert np.isfinite(picture.distance)
        assert picture.position_error is None
    assert wanted["raw-copy"] == pytest.approx(state.teacher.manipulability(POSE), abs=1e-6)
    for name in ("parallel-transport", "nearest-neighbor"):
        assert np.abs(wanted[name] - wanted["raw-copy"]).max() > 0.01
    assert np.abs(wanted["parallel-transport"] - wanted["nearest-neighbor"]).max() > 0.01


def test_the_robot_comes_nearer(make_state):
    """Left alone with a wish, the robot does not move away from it, whatever posture it comes from."""
    state = make_state()
    state.advance(wish("raw-copy"), 0.0)
    distances = [state.advance(wish(joints=POSE + 0.4), FRAME).distance for _ in range(30)]
    assert distances[-1] < distances[0]
    assert distances[-1] < 0.7


def test_the_robot_is_no_faster_than_it_can(make_state):
    """Between two pictures no joint goes farther than its velocity limit allows, even after a long stop."""
    state = make_state()
    before = state.advance(wish(), FRAME).student_joints
    for seconds in (FRAME, 10.0):
        after = state.advance(wish("nearest-neighbor", joints=POSE[::-1].copy()), seconds).student_joints
        assert np.all(np.abs(after - before) <= state.student.velocity_limits * min(seconds, 0.1) + 1e-9)
        before = after


def test_the_tip_follows_where_it_is_wanted(make_state):
    """With the hand wanted too, it comes to its place within a millimetre or two."""
    state = make_state()
    for _ in range(60):
        picture = state.advance(wish(tip_follows=True), FRAME)
    assert picture.position_error < 2e-3
    assert np.linalg.norm(picture.student_skeleton[-1] - picture.target_tip) == pytest.approx(picture.position_error)


def test_dragging_the_mounting_changes_the_target_ellipsoid(make_state):
    """After a drag the methods are fitted anew, and what is wanted turns, in the robot's axes."""
    state = make_state()
    turn = Rotation.from_euler("xyz", [90, 0, 45], degrees=True).as_matrix()
    for name in state.methods:
        before = state.advance(wish(name), FRAME).target_ellipsoid
        state.advance(wish(name, mounting=turn), FRAME)
        assert state.refitting.settle()
        after = state.advance(wish(name, mounting=turn), FRAME).target_ellipsoid
        assert np.abs(after - before).max() > 1e-3
        state.advance(wish(name), FRAME)
        assert state.refitting.settle()


def test_sliders_beyond_the_limits_are_taken_for_the_limits(make_state):
    """A slider that was rounded, or a stranger's message, cannot bend an arm beyond what it can."""
    state = make_state()
    arm = state.teacher
    assert state.advance(wish(joints=arm.upper + 3.0), FRAME).teacher_joints == pytest.approx(arm.upper)
    assert state.advance(wish(joints=arm.lower - 3.0), FRAME).teacher_joints == pytest.approx(arm.lower)


@pytest.mark.parametrize("joints", [np.full(7, np.nan), np.zeros(3), None])
def test_joints_that_are_none_are_refused(make_state, joints):
    """Nan and a wrong number of joints are errors, not postures."""
    with pytest.raises(InvalidInputError, match="joints"):
        make_state().advance(wish(joints=joints), FRAME)


def test_an_unknown_method_is_refused(make_state):
    """The message lists what there is to choose from."""
    with pytest.raises(InvalidInputError, match="raw-copy"):
        make_state().advance(wish("magic"), FRAME)


def test_an_ellipsoid_without_an_image_leaves_the_last_one(make_state, arms, bank):
    """An adapter without damping cannot map the flat ellipsoid of a stretched arm; the view goes on and says why."""
    domains = [sample_domain(arm, 256, i) for i, arm in enumerate(arms)]
    methods = Methods(*domains, given=ParallelTransport().fit(*domains))
    state = make_state(methods)
    good = state.advance(wish(GIVEN), FRAME)
    flat = state.advance(wish(GIVEN, joints=np.zeros(7)), FRAME)
    assert flat.note.startswith("no image")
    assert flat.target_ellipsoid == pytest.approx(good.target_ellipsoid)
    assert state.gaps(flat.demonstrated_ellipsoid)[GIVEN] is None
    assert state.advance(wish(GIVEN), FRAME).note == ""


def test_a_table_of_samples_can_be_made(make_state):
    """What nearest neighbours ask for the robot makes somewhere; what the others ask for it may not."""
    state = make_state()
    gaps = state.gaps(state.advance(wish(), FRAME).demonstrated_ellipsoid)
    assert set(gaps) == set(state.methods)
    assert gaps.pop("nearest-neighbor") < 0.02
    assert max(gaps.values()) > 0.05


def test_leaping_finds_a_posture_at_least_as_good(make_state):
    """The posture that is searched from many starts is no worse than where the robot got by itself."""
    state = make_state()
    for _ in range(30):
        walked = state.advance(wish(joints=POSE + 0.5), FRAME).distance
    state.leap()
    assert state.advance(wish(joints=POSE + 0.5), 0.0).distance <= walked + 1e-6


def test_a_recording_plays_in_a_circle():
    """Time goes on from the end to the start, seeking stays within the ends, and joints lie on straight lines."""
    player = Playback([1.0, 2.0, 4.0], [[0.0, 1.0], [1.0, 1.0], [3.0, -1.0]])
    assert player.duration == 3.0
    player.advance(2.0)
    assert player.joints() == pytest.approx([2.0, 0.0])
    player.advance(1.5)
    assert player.position == pytest.approx(0.5)
    player.seek(99.0)
    assert player.joints() == pytest.approx([3.0, -1.0])
    player.seek(-1.0)
    assert player.position == 0.0


@pytest.mark.parametrize(("times", "path"), [([0.0], [[0.0]]), ([0.0, 0.0], [[0.0], [1.0]]), ([0.0, 1.0], [[0.0]])])
def test_a_recording_needs_times_that_increase(times, path):
    """One frame, equal times, or fewer postures than times are no motion."""
    with pytest.raises(InvalidInputError):
        Playback(times, path)


def test_pictures_a_second(make_state, capsys):
    """Says how many pictures a second the state makes, with the hand following; nothing is asserted about it."""
    state = make_state()
    started, count = time.perf_counter(), 90
    for i in range(count):
        state.advance(wish(joints=POSE + 0.3 * np.sin(i / 20), tip_follows=True), 1.0 / 60.0)
    rate = count / (time.perf_counter() - started)
    with capsys.disabled():
        print(f"\n{rate:.0f} pictures a second")
    assert count == 90
