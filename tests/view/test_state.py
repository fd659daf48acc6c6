"""The live state: wishes in, pictures out, without any page."""

import threading
import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import ParallelTransport
from maniport.demonstrations import fit_arm, read_recording
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError
from maniport.view.maps import GIVEN, Methods, Refitting
from maniport.view.recorder import Recorder
from maniport.view.state import Playback, Wish

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


def test_a_joint_at_its_limit_is_named(make_state):
    """Only while it is there."""
    state = make_state()
    robot = state.student
    asked = wish("raw-copy")
    state.joints, state._leap = 0.5 * (robot.lower + robot.upper), False
    assert state.advance(asked, 0.0).at_limit == ()
    state.joints = state.joints.copy()
    state.joints[3] = robot.lower[3]
    assert state.advance(asked, 0.0).at_limit == (robot.joint_names[3],)


def test_the_page_is_there_before_all_methods_are(make_state, methods):
    """Until a method is fitted for the first time another one's target is shown, and a note says so."""
    gate = threading.Event()
    fit = methods.fit

    class Slow:
        names = methods.names

        def fit(self, name, mounting):
            assert name == "parallel-transport" or gate.wait(60.0)
            return fit(name, mounting)

    refitting = Refitting(Slow(), np.eye(3), first=("parallel-transport",))
    refitting.begin()
    state = make_state()
    state.refitting = refitting
    try:
        assert "icp is being fitted" in state.advance(wish(), 0.0).note
        gate.set()
        assert refitting.settle()
        assert state.advance(wish(), 0.0).note == ""
        assert set(refitting.maps) == set(methods.names)
    finally:
        gate.set()
        refitting.close()


def test_what_was_played_is_a_recording(arms, tmp_path):
    """Written when the switch is turned off, it is read again, and the person's joints come out of it."""
    teacher = arms[0]
    first, last = (
        0.5 * (teacher.lower + teacher.upper) + 0.3 * step * (teacher.upper - teacher.lower) for step in (-1, 1)
    )
    path = first + (last - first) * np.linspace(0, 1, 40)[:, None]
    recorder = Recorder(teacher, tmp_path)
    assert recorder.take(False, path[0], 0.1) == ""
    for joints in path:
        recorder.take(True, joints, 0.05)
    said = recorder.take(False, path[-1], 0.05)
    (file,) = tmp_path.iterdir()
    assert file.name in said
    fit = fit_arm(read_recording(file), "rhuman")
    assert fit.time[-1] == pytest.approx(39 * 0.05)
    assert np.abs(fit.joint_angles - path).max() < np.radians(2.0)
    assert recorder.take(False, path[0], 0.1) == ""


def test_too_short_a_play_and_a_folder_that_is_gone_are_told(arms, tmp_path):
    """Nothing is written, in words."""
    recorder = Recorder(arms[0], tmp_path / "gone")
    recorder.take(True, np.zeros(7), 0.1)
    assert "at least 10" in recorder.take(False, np.zeros(7), 0.1)
    for _ in range(20):
        recorder.take(True, np.zeros(7), 0.1)
    assert "nothing was written" in recorder.take(False, np.zeros(7), 0.1)


def test_a_place_that_is_searched_for_leaves_the_tip_free_and_says_so(make_state, place):
    """The page need not wait for it; once it is found the tip follows."""
    state = make_state()
    state.place = None
    picture = state.advance(wish(tip_follows=True), 0.0)
    assert picture.target_tip is None
    assert "searched for" in picture.note
    state.refitting.before = lambda: setattr(state, "place", place)
    state.refitting.begin()
    end = time.monotonic() + 60.0
    while state.place is None:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert state.advance(wish(tip_follows=True), 0.0).target_tip is not None
