"""The angle of the elbow, and the motion that keeps it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from maniport import RawCopy, sample_domain, spd
from maniport.bodies import Arm, load_arm
from maniport.errors import InvalidInputError, UnknownNameError
from maniport.evaluation import ElbowBaseline, evaluate, keep_elbow
from maniport.evaluation.elbow import angle_of, elbow_angle, elbow_frames, turned_by
from maniport.evaluation.elbow_row import with_elbow
from maniport.evaluation.rows import RAW_COPY, Row
from maniport.telling import as_markdown, as_numbers, facts_of

RNG = np.random.default_rng(0)
POINTS = RNG.standard_normal((50, 3, 3))


@pytest.fixture(scope="module")
def panda():
    """The Panda with its hand."""
    return load_arm("panda")


def test_an_elbow_that_swivels_changes_the_angle_by_as_much():
    """Turned about the line from shoulder to wrist by δ, the elbow is at an angle that is larger by δ."""
    shoulder, elbow_at, wrist = np.moveaxis(POINTS, 1, 0)
    turn = RNG.uniform(-3.0, 3.0, 50)
    along = (wrist - shoulder) / np.linalg.norm(wrist - shoulder, axis=1)[:, None]
    moved = shoulder + Rotation.from_rotvec(turn[:, None] * along).apply(elbow_at - shoulder)
    change = turned_by(angle_of(np.stack([shoulder, moved, wrist], axis=1)), angle_of(POINTS))
    assert_allclose(turned_by(change, turn), 0.0, atol=1e-9)


def test_place_and_size_do_not_matter_and_the_mirror_image_has_the_opposite_angle():
    """Moved and scaled points have the same angle; a left arm in the mirror the negative one."""
    assert_allclose(angle_of(2.5 * POINTS + [1.0, 2.0, 3.0]), angle_of(POINTS), atol=1e-9)
    assert_allclose(angle_of(POINTS * [1.0, -1.0, 1.0]), -angle_of(POINTS), atol=1e-9)


def test_a_left_arm_has_the_opposite_angle():
    """The mirrored model in the same joint positions."""
    right, left = load_arm("myoarm"), load_arm("myoarm", side="left")
    q = right.sample(20, 0)
    assert_allclose(elbow_angle(left, q), -elbow_angle(right, q), atol=1e-9)


def test_arms_are_compared_in_one_frame(panda):
    """In a frame that is turned with the arm, the angle is that of the arm before it was turned."""
    q, turn = panda.sample(20, 0), Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    points = panda.point_positions(q, elbow_frames(panda))
    assert_allclose(elbow_angle(panda, q, turn), angle_of(points @ turn), atol=1e-12)
    assert_allclose(angle_of(points), elbow_angle(panda, q), atol=1e-12)


@pytest.mark.parametrize("name", ["panda", "rhuman"])
def test_what_is_called_an_elbow_is_one(name):
    """Its distances from shoulder and wrist are the same in all postures, and the wrist's from the shoulder is not."""
    arm = load_arm(name)
    shoulder, middle, wrist = np.moveaxis(arm.point_positions(arm.sample(50, 0), elbow_frames(arm)), 1, 0)
    assert np.ptp(np.linalg.norm(middle - shoulder, axis=1)) < 1e-9
    assert np.ptp(np.linalg.norm(wrist - middle, axis=1)) < 1e-9
    assert np.ptp(np.linalg.norm(wrist - shoulder, axis=1)) > 0.1


def test_arms_without_an_elbow_are_refused(panda):
    """The message says of which arms an elbow is known; frames may be named; a straight arm has no angle."""
    planar = Arm.from_dh("planar", [[0, 0, 0.4, 0], [0, 0, 0.3, 0], [0, 0, 0.2, 0]])
    with pytest.raises(InvalidInputError, match=r"elbow angle of 'planar' with 3 joints is not defined.*'panda'"):
        elbow_angle(planar, np.zeros(3))
    with pytest.raises(InvalidInputError, match="must name those of shoulder, elbow and wrist"):
        elbow_angle(planar, np.zeros(3), frames=["link1"])
    assert np.isnan(elbow_angle(planar, np.zeros(3), frames=["link1", "link2", "link3"]))
    assert np.isfinite(elbow_angle(planar, [0.0, 0.5, 0.5], frames=["link1", "link2", "link3"]))


WAY = np.linspace([0.2, -0.5, 0.1, -2.0, 0.0, 1.8, 0.0], [0.5, -0.3, 0.3, -1.7, 0.2, 1.6, 0.1], 8)
"""Joint positions of a Panda."""


@pytest.fixture(autouse=True)
def _few_samples(monkeypatch):
    """The laws hold with few samples, too."""
    monkeypatch.setattr(keep_elbow, "SAMPLES", 3000)
    monkeypatch.setattr(keep_elbow, "STARTS", 16)


def asked_of(panda, q, turn):
    """What is asked of a Panda that shall do what it does at q."""
    points = panda.forward(q)[:, :3, 3], elbow_angle(panda, q, turn)
    return keep_elbow.ElbowKept(panda, *points, turn, elbow_frames(panda))


def test_slopes_are_those_of_differences(panda):
    """The derivatives of what is minimised agree with finite differences."""
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    asked, q = asked_of(panda, WAY, turn), panda.sample(len(WAY), 3)
    steps = 1e-6 * np.eye(7)
    slopes = [(asked.residuals(q + d) - asked.residuals(q - d)) / 2e-6 for d in steps]
    assert_allclose(asked.slopes(q), np.moveaxis(slopes, 0, -1), rtol=1e-3, atol=1e-2)


@pytest.mark.parametrize("stages", [150, 4])
def test_a_robot_keeps_what_it_did_itself(panda, monkeypatch, stages):
    """Asked for the tip path and the elbow of a motion of its own, it has both, within its limits and without leaps."""
    monkeypatch.setattr(keep_elbow, "STAGES", stages)
    path, angles, turn = panda.forward(WAY)[:, :3, 3], elbow_angle(panda, WAY), np.eye(3)
    found = keep_elbow.keep_elbow(panda, path, angles, turn, elbow_frames(panda))
    assert panda.within_limits(found).all()
    assert_allclose(panda.forward(found)[:, :3, 3], path, atol=1e-4)
    assert_allclose(turned_by(elbow_angle(panda, found), angles), 0.0, atol=2e-3)
    assert np.abs(np.diff(found, axis=0)).max() < 0.2


def test_an_angle_that_is_not_defined_is_left_alone(panda):
    """Where the person's arm is straight, the tip alone counts."""
    path, angles = panda.forward(WAY)[:, :3, 3], np.full(len(WAY), np.nan)
    found = keep_elbow.keep_elbow(panda, path, angles, np.eye(3), elbow_frames(panda))
    assert_allclose(panda.forward(found)[:, :3, 3], path, atol=1e-6)


@pytest.fixture(scope="module")
def given(panda):
    """A person's postures and an adapter, with what `evaluate` takes."""
    person = load_arm("rhuman")
    q = np.zeros((5, 7))
    q[:, 1], q[:, 3] = np.radians(90.0), np.radians(np.linspace(20.0, 110.0, 5))
    domains = sample_domain(person, 128, 0), sample_domain(panda, 256, 1)
    return person, q, (RawCopy(damping=0.01).fit(*domains), *domains, person.manipulability(q))


SMALL = {"n_domain": 0, "draws": 0, "rows": (RAW_COPY,)}


def test_the_elbow_is_a_row(panda, given):
    """Its distances are those of the motion that it has; the other rows are as they are without it."""
    person, q, known = given
    baseline = ElbowBaseline(person, q)
    found = evaluate(*known, robot=panda, elbow=baseline, name="mine", **SMALL | {"rows": (RAW_COPY, "elbow")})
    plain = evaluate(*known, robot=panda, name="mine", **SMALL)
    row, motion = found.row("elbow"), baseline.motion(panda, np.eye(3))
    assert (found.rows[1:-1], found.rows[-1], found.verdict) == (plain.rows[1:], row, plain.verdict)
    achieved = RawCopy(damping=0.01).fit(*known[1:3]).student_side(panda.manipulability(motion.joint_positions))
    assert row.to_target.mean == pytest.approx(spd.distance(known[0].student_side(known[3]), achieved).mean())
    assert row.to_demonstrated.mean == pytest.approx(spd.distance(known[0].teacher_side(known[3]), achieved).mean())
    assert row.elbow_error.largest == pytest.approx(np.degrees(motion.elbow_error).max())
    assert row.tip_error.largest == pytest.approx(1e3 * motion.tip_error.max())
    assert row.feasibility_gap is None
    facts = facts_of(found)
    assert as_numbers(facts)["evaluation"]["rows"]["elbow"]["to_target"]["mean"] == row.to_target.mean
    assert "Elbow: the robot with the person's elbow angle, its tip on a path laid shoulder" in as_markdown(facts)


def test_on_its_own_place_the_robots_shoulder_is_the_persons(panda):
    """A person with the robot's own arm asks for the way from the shoulder that it went, nine tenths as long."""
    path = ElbowBaseline(panda, WAY).motion(panda, np.eye(3)).path
    shoulder = panda.point_positions(WAY[0], elbow_frames(panda))[0]
    assert_allclose(path, shoulder + 0.9 * (panda.forward(WAY)[:, :3, 3] - shoulder), atol=1e-12)


def test_a_robot_without_an_elbow_has_a_row_that_says_so(given):
    """It has no measures; the note names the robots that have one."""
    person, q, known = given
    planar = Arm.from_dh("six", [[0.1, 0.3 * (-1) ** i, 0.2, 0.5 * np.pi] for i in range(6)])
    *_, row = with_elbow([Row("mine")], ElbowBaseline(person, q), known[0], known[3], planar)
    assert row.note.startswith("left out: the elbow angle of 'six' with 6 joints is not defined")
    assert (row.to_target, row.smoothness) == (None, None)


def test_what_does_not_fit_is_told_before_the_work(panda, given):
    """Postures for each ellipsoid, frames of the robot, a robot."""
    person, q, known = given
    with pytest.raises(InvalidInputError, match="joint_angles must be those of the profile, 5; found 4"):
        evaluate(*known, robot=panda, elbow=ElbowBaseline(person, q[1:]), **SMALL)
    with pytest.raises(UnknownNameError, match="unknown frame 'elbow'"):
        evaluate(*known, robot=panda, elbow=ElbowBaseline(person, q, frames=["elbow", "wrist", "hand"]), **SMALL)
    with pytest.raises(InvalidInputError, match="the row 'elbow' needs the person's joint angles: elbow="):
        evaluate(*known, robot=panda, **SMALL | {"rows": ("elbow",)})
    with pytest.raises(InvalidInputError, match="needs the student's arm, robot="):
        evaluate(*known, elbow=ElbowBaseline(person, q), **SMALL)
    with pytest.raises(InvalidInputError, match=r"joint_angles must have shape \(n, 7\)"):
        ElbowBaseline(person, q[:, :3])
