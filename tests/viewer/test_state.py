import threading
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport.arms import VELOCITY, load_arms
from maniport.arms.human import human_arm
from maniport.errors import ManiportError
from maniport.mocap import read_recording
from maniport.pipeline.config import Config
from maniport.pipeline.transfer import Transfer
from maniport.report.page.animation import surfaces_of
from maniport.transfer import METHODS
from maniport.util.process import in_background
from maniport.viewer import state as states
from maniport.viewer.state import Command, Fits, Side, ViewState, prepare
from real_robots import NEEDS_ROBOTS
from sizes import little_search

STEP = 1.0 / 30.0
POSE = np.radians([60.0, 50.0, 0.0, 80.0, 0.0, 0.0, 0.0])
METHOD = "parallel-transport"
TWO = ((0.0, 0.3, 0.0, 0.0), (0.0, -0.3, 0.0, 0.0))
BASES = np.array([[0.0, 0.02, 0.0], [0.0, -0.02, 0.0]])


def advance(state, method="icp", joints=POSE, seconds=STEP, base_rotation=None, follow_hand=False):
    base_rotation = np.eye(3) if base_rotation is None else base_rotation
    return state.frames(Command(joints, method, base_rotation, follow_hand), seconds)[0]


def test_every_method_can_be_chosen(make_state):
    state = make_state()
    targets = {}
    for name in METHODS:
        frame = advance(state, name)
        targets[name] = frame.target.ellipsoid
        assert state.robot.within_limits(frame.joints)
        assert np.isfinite(frame.distance)
        assert frame.position_error is None
        assert np.isfinite(
            advance(state, name, np.zeros(7)).distance
        )  # a straight arm has a singular ellipsoid
    assert targets["identity"] == pytest.approx(
        state.sides[0].teacher.manipulability(POSE), abs=1e-6
    )
    names = ("identity", METHOD, "nearest-neighbor")
    for one, other in zip(names, names[1:] + names[:1], strict=True):
        assert np.abs(targets[one] - targets[other]).max() > 0.01
    rotation = Rotation.from_euler("xyz", [90, 0, 45], degrees=True).as_matrix()
    advance(state, METHOD, base_rotation=rotation)
    list(state.fits.fits.values())[-1].result(60.0)
    assert (
        np.abs(
            advance(state, METHOD, base_rotation=rotation).target.ellipsoid - targets[METHOD]
        ).max()
        > 1e-3
    )


def test_the_robot_approaches_within_its_speed(make_state):
    state = make_state()
    before = advance(state, "identity", seconds=0.0).joints
    for seconds in (STEP, 10.0):
        after = advance(state, "identity", POSE + 0.4, seconds).joints
        assert np.all(
            np.abs(after - before) <= state.robot.velocity_limits * min(seconds, 0.1) + 1e-9
        )
        before = after
    distances = [advance(state, joints=POSE + 0.4).distance for _ in range(30)]
    assert distances[-1] < min(distances[0], 0.7)
    state.jump = True
    assert advance(state, joints=POSE + 0.4, seconds=0.0).distance <= distances[-1] + 1e-5


def test_the_end_effector_follows_on_request(make_state):
    state = make_state()
    state.places, places = None, state.places
    frame = advance(state, follow_hand=True)
    assert frame.target.position is None
    assert "placement" in frame.target.notes[-1]
    state.places = places
    for _ in range(60):
        frame = advance(state, follow_hand=True)
    assert frame.position_error < 2e-3
    assert np.linalg.norm(
        state.sides[0].student.forward(frame.joints)[:3, 3] - frame.target.position
    ) == pytest.approx(frame.position_error)


def test_an_error_of_a_fit_is_raised(make_state, monkeypatch):
    state = make_state()
    advance(state)
    monkeypatch.setattr(state.fits, "fit", lambda *_: 1 / 0)

    def follow_until_the_fit_ends():
        for _ in range(2):
            advance(state, base_rotation=-np.eye(3))
            list(state.fits.fits.values())[-1].exception(60.0)

    with pytest.raises(ZeroDivisionError):
        follow_until_the_fit_ends()


def test_the_view_begins_before_the_method_is_fitted(monkeypatch):
    gate = threading.Event()
    fit = Fits.fit
    monkeypatch.setattr(
        Fits, "fit", lambda *args: (args[1] == METHOD or gate.wait(60.0)) and fit(*args)
    )
    for name, size in {"TEACHER_SAMPLES": 128, "STUDENT_SAMPLES": 256}.items():
        monkeypatch.setattr(states, name, size)
    with little_search():
        state = prepare(Config().changed(person="rhuman"))
        try:
            frame = advance(state, "length-field", follow_hand=True)
            assert (
                "length-field is being fitted; the target is that of parallel-transport"
                in frame.target.notes[0]
            )
        finally:
            gate.set()
        assert state.places.result(60.0)[0].scale > 0
        list(state.fits.fits.values())[-1].result(60.0)


@pytest.fixture(scope="module")
def pandas():
    return load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])


def pair_of(robot):
    """A person's both arms lead a robot of two arms."""
    config = Config(n_teacher=128, n_student=256).changed(robot=robot, person="rhuman", side="both")
    transfer = Transfer.of(config)
    persons = [human_arm("rhuman", side) for side in ("left", "right")]
    sides = []
    for i, (person, arm, base) in enumerate(zip(persons, robot.arms, BASES, strict=True)):
        sides.append(Side(person, arm, transfer.robot.bank(i, VELOCITY), base))
    return ViewState(robot, sides, Fits(transfer, persons))


class OfArm(Fits):
    """Fits of one arm of two."""

    def __init__(self, both, i):
        self.both = both
        self.i = i

    def get(self, method, base_rotation):
        fit = self.both.get(method, base_rotation)
        fitted = replace(fit.transfer, maps=fit.transfer.maps[self.i : self.i + 1])
        return replace(fit, transfer=fitted)


def test_both_arms_move_as_each_alone(pandas):
    pair = pair_of(pandas)
    alone = []
    for i, side in enumerate(pair.sides):
        alone.append(ViewState(side.student, [side], OfArm(pair.fits, i)))
    for joints in (POSE, POSE + 0.1):
        both = pair.frames(Command(np.tile(joints, 2), METHOD, np.eye(3)), 1.0 / 60.0)
        for frame, state in zip(both, alone, strict=True):
            expected = advance(state, METHOD, joints, 1.0 / 60.0)
            np.testing.assert_array_equal(frame.target.ellipsoid, expected.target.ellipsoid)
            np.testing.assert_allclose(frame.joints, expected.joints, atol=1e-5)
    with little_search():
        fit = pair.fits.get(METHOD, np.eye(3))
        joints = [side.teacher.sample(4, 0) for side in pair.sides]
        pair.places = in_background(pair.find_places, np.arange(4.0), joints, fit)
        scales = [place.scale for place in pair.places.result()]
    left, right = pair.frames(Command(np.tile(POSE, 2), METHOD, np.eye(3), True), STEP)
    hands = [side.teacher.skeleton(POSE)[-1] + side.base for side in pair.sides]
    distance = np.linalg.norm(right.target.position - left.target.position)
    assert distance == pytest.approx(scales[0] * np.linalg.norm(hands[1] - hands[0]))
    assert scales[0] == scales[1]


@NEEDS_ROBOTS
def test_a_shared_torso_is_in_one_place():
    humanoid = load_arms("talos")
    pair = pair_of(humanoid)
    both = Command(np.tile(POSE, 2), METHOD, np.eye(3))
    first = pair.frames(both, 0.0)
    for _ in range(12):
        later = pair.frames(both, 0.1)
    humanoid.require_within_limits(humanoid.joined(*(frame.joints for frame in later)), "q")
    assert sum(frame.distance for frame in later) < sum(frame.distance for frame in first)
    (left, right), reason = surfaces_of(humanoid.arms, [frame.joints for frame in later])
    if not reason:
        assert 0 < len(right) < len(humanoid.arms[1].surfaces())
        assert min(surface.joint for surface in right) >= humanoid.common[0, 1]
        assert len(left) == len(humanoid.arms[0].surfaces())


@pytest.mark.parametrize(
    ("options", "files", "word"),
    [
        ({"side": "both"}, {}, "two arms"),
        ({"side": "left", "robot": ("panda", "panda"), "pose": TWO}, {}, "two arms"),
        ({"pose": TWO[:1]}, {}, "two robot arms"),
        (
            {"side": "both", "robot": ("panda", "panda"), "pose": TWO},
            {"recording": "ladder"},
            "both",
        ),
    ],
)
def test_options_that_make_no_pair_are_errors(options, files, word):
    with pytest.raises(ManiportError, match=word):
        prepare(Config().changed(**options), **files)


def test_options_of_the_recording_are_used(tmp_path):
    """A file in an unusual unit needs its option, which the page gets from the configuration."""
    recording = read_recording("freeform").crop(2.0, 3.0)
    file = tmp_path / "scaled.npz"
    np.savez(
        file, names=list(recording.names), positions=recording.positions * 7.0, time=recording.time
    )
    config = Config().changed(unit=1 / 7, stop=float(recording.time[10]))
    state = prepare(config, file)
    assert state.playback is not None
    assert state.playback.t[-1] <= recording.time[10] - recording.time[0] + 1e-9
    with pytest.raises(ManiportError, match="unit"):
        prepare(Config(), file)
