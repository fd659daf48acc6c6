"""Live: the robot moves toward a person only after `engage`, from where it is, and within its limits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from toy import FakeClock, require_limits

import maniport as mp
from maniport.errors import InvalidInputError
from maniport.live.state import LOSS, MOVING, STATES, StateMachine

PERIOD = 0.01  # of steps [s]
SLOW = [0.0, 0.0, 0.05]  # of readings of the clock: the last one ends a step [s]


class Session:
    """A robot with a clock that is moved by hand, a person who holds still in a pose, and all states in order."""

    def __init__(self, result, points, **options):
        self.clock = FakeClock()
        self.live = mp.Live.of(result, clock=self.clock, **options)
        self.points = points
        self.states = []
        self.sent = []  # times of commands

    def step(self, points, joints=None, pause=PERIOD):
        self.clock.now += pause
        self.states.append(self.live.step(points, joints=joints))
        self.sent.append(self.clock.now)
        return self.states[-1]

    def run(self, seconds, visible=True, pose=0, **options):
        """Make steps for a time; return the last state."""
        points = self.points[pose] if visible else None
        for _ in range(round(seconds / PERIOD)):
            state = self.step(points, **options)
        return state

    def require_limits(self, limits, first=0):
        """Commands keep the limits over robot time, and that of velocity when they leave, but for 2 ms."""
        q = np.array([state.joint_positions for state in self.states[first:]])
        require_limits(limits, [state.time for state in self.states[first:]], q)
        passed = np.diff(self.sent[first:])[:, None]
        assert (np.abs(np.diff(q, axis=0)) <= limits.velocity * (passed + 2e-3 + 1e-9)).all()


@pytest.fixture(scope="module")
def poses(small_result, second):
    """Points of the person in two poses, shape (2, p, 3)."""
    points = second.select(mp.Live.of(small_result, clock=None).points).positions
    return points[[0, -1]]


@pytest.fixture
def session(small_result, poses):
    return Session(small_result, poses)


@pytest.fixture(scope="module")
def limits(small_result):
    return small_result.arm.motion.limits


def test_a_robot_waits_until_it_is_engaged(session):
    start = session.live.joint_positions
    assert session.run(0.1, visible=False).state == "holding"
    state = session.run(1.0, pose=1)
    assert state.state == "waiting"
    assert_array_equal(state.joint_positions, start)
    session.live.engage()
    assert session.run(0.02, pose=1).state == "approaching"
    assert session.run(1.0, pose=1).state == "following"
    assert np.abs(session.states[-1].joint_positions - start).max() > 0.01


@pytest.mark.parametrize("end", ["loss", "hold", "no steps"])
def test_consent_ends(session, limits, end):
    """A gap of 0.2 s does not end it; a longer one does, also one between two steps."""
    session.live.engage()
    session.run(1.0)
    session.run(0.2, visible=False)
    assert session.run(0.3).state == "following"
    if end == "loss":
        session.run(0.3, visible=False)
    elif end == "no steps":
        session.clock.now += 0.3
    else:
        session.live.hold()
    state = session.run(1.0, pose=1)
    assert state.state == "waiting"
    assert not state.joint_velocities.any()
    session.live.engage()
    session.step(session.points[1])
    assert session.states[-1].state == "approaching"
    session.run(1.0, pose=1)
    assert session.states[-1].state == "following"
    session.require_limits(limits)


def test_an_early_call_is_forgotten(session):
    """Engage waits for a person for 0.25 s, and is void while the robot follows."""
    session.live.engage()
    session.run(0.3, visible=False)
    assert session.run(0.3).state == "waiting"
    session.live.hold()
    session.live.engage()
    session.run(0.2, visible=False)
    assert session.run(0.1).state in MOVING
    session.live.engage()
    session.run(0.3, visible=False)
    assert session.run(0.1).state == "waiting"


def test_before_the_first_step_of_simulated_time_a_call_is_kept(small_result, poses):
    live = mp.Live.of(small_result, clock=None)
    live.engage()
    live.step(poses[0], 5.0)
    assert live.step(poses[0], 5.01).state in MOVING


def test_approaches_are_slow(session, limits):
    session.live.engage()
    while (state := session.step(session.points[1])).state != "following":
        assert (np.abs(state.joint_velocities) <= 0.5 * limits.velocity + 1e-9).all()
        assert len(session.states) < 300


def test_a_person_who_returns_is_followed_in_the_same_configuration(session, limits):
    """After 3 s of absence at the same place, and elsewhere, within 0.5 s after `engage`."""
    session.live.engage()
    before = session.run(2.0).joint_positions
    for pose in (0, 1, 0):
        session.run(3.0, visible=False)
        session.run(0.1, pose=pose)
        session.live.engage()
        state = session.run(0.5, pose=pose)
        assert state.state == "following"
        assert state.position_error < 0.01
    after = session.run(1.0).joint_positions
    assert_allclose(after, before, atol=0.5)  # [rad]; another branch differs by more than 1 rad
    session.require_limits(limits)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_limits_are_kept_whatever_happens(small_result, second, limits, seed):
    """Random consent, stops, losses, slow steps, pauses, and measured joints with lag and noise."""
    draw = np.random.default_rng(seed)
    points = second.select(mp.Live.of(small_result, clock=None).points).positions
    start = 0.5 * (limits.arm.lower + limits.arm.upper)
    session = Session(small_result, points, start=start, auto_engage=seed == 3)
    at = 0
    for _ in range(700):
        event = draw.choice(
            ["engage", "hold", "slow", "pause", "lose", ""], p=[0.06, 0.01, 0.02, 0.01, 0.01, 0.89]
        )
        if event == "engage":
            session.live.engage()
        elif event == "hold":
            session.live.hold()
        session.clock.delays = list(SLOW) if event == "slow" else []
        joints = None
        if session.states and draw.random() < 0.5:
            late = np.searchsorted(session.sent, session.clock.now - 0.05)
            lagging = session.states[min(late, len(session.states) - 1)].joint_positions
            joints = np.clip(lagging + draw.normal(0.0, 1e-3, 7), *own_limits(small_result))
        pause = 0.4 if event == "pause" else draw.choice([0.002, 0.01, 0.03])
        at = (at + draw.integers(0, 4)) % len(points)
        shown = points[at] if draw.random() < 0.95 else None
        for _ in range(40 if event == "lose" else 1):
            session.step(None if event == "lose" else shown, joints=joints, pause=pause)
            joints = None
    assert any(state.state in MOVING for state in session.states)
    session.require_limits(limits)


def own_limits(result):
    return result.arm.robot.lower, result.arm.robot.upper


def test_the_first_measured_joints_are_the_start(session, limits):
    start = session.live.joint_positions
    middle = 0.5 * (limits.arm.lower + limits.arm.upper)
    measured = start + 0.3 * np.sign(middle - start)
    state = session.run(0.5, pose=1, joints=measured)
    assert_array_equal(state.joint_positions, measured)
    session.live.engage()
    state = session.step(session.points[1], joints=measured)
    assert state.state == "approaching"
    assert_allclose(state.joint_positions, measured, atol=0.01)
    session.run(1.5, pose=1)
    session.require_limits(limits)


def test_an_approach_begins_where_the_robot_is(session, limits):
    """A robot that was moved by hand while it waited does not jump back."""
    session.live.engage()
    moved = session.run(1.0).joint_positions.copy()
    session.live.hold()
    session.run(1.0)
    moved[:2] += 0.08  # within the tolerance at rest
    state = session.run(0.5, joints=moved)
    assert (state.state, np.abs(state.joint_positions - moved).max() > 0.05) == ("waiting", True)
    session.live.engage()
    assert_allclose(session.step(session.points[0], joints=moved).joint_positions, moved, atol=0.01)
    first = len(session.states) - 1
    session.run(0.5)
    session.require_limits(limits, first)
    session.live.hold()
    session.run(1.0)
    moved[0] -= 0.6
    state = session.step(session.points[0], joints=moved)
    assert state.state == "waiting"
    assert_array_equal(state.joint_positions, moved)


def test_measured_joints_far_from_commands_end_consent(session, limits):
    """The robot brakes within its limits, then begins at the measured joints, and needs consent again."""
    session.live.engage()
    session.run(0.3, pose=1)
    stuck = session.states[-1].joint_positions.copy()
    middle = 0.5 * (limits.arm.lower[3] + limits.arm.upper[3])
    stuck[3] += 0.35 * np.sign(middle - stuck[3])
    state = session.step(session.points[1], joints=stuck)
    assert state.state == "displaced"
    session.live.engage()
    count = 0
    while (state := session.step(session.points[1], joints=stuck)).state == "displaced":
        count += 1
        assert count < 100
    assert state.state == "waiting"
    assert count >= 50
    assert_array_equal(state.joint_positions, stuck)
    session.live.engage()
    first = len(session.states) - 1
    session.run(1.5, pose=1)
    assert session.states[-1].state == "following"
    session.require_limits(limits, first)


@pytest.mark.parametrize(
    ("joints", "word"),
    [
        ([np.nan] * 7, "finite"),
        ([0.0] * 6, "joints"),
        ("home", "numbers"),
        (np.full(7, 9.0), "joint1"),
        ({"panda_joint1": 0.0}, "missing"),
        ({"elbow": 1.0}, "unknown joint 'elbow'"),
        ([np.inf] * 7, "finite"),
        ([0.0, 1.6, 0.0, -2.9, 0.0, 0.1, 0.0], "collide"),
    ],
)
def test_wrong_joints_are_refused_and_change_nothing(session, joints, word):
    start = session.live.joint_positions
    with pytest.raises(InvalidInputError, match=word):
        session.step(session.points[0], joints=joints)
    state = session.run(0.3, pose=1)
    assert state.state == "waiting"
    assert_array_equal(state.joint_positions, start)


def test_a_start_within_the_margin_is_accepted(small_result, poses, limits):
    """A joint that begins there moves inward only, without a jump; beyond the robot's own limit it is refused."""
    start = np.array([0.0, 0.5, 0.0, -3.05, 0.0, 3.0, 0.0])
    assert small_result.arm.robot.lower[3] < -3.05 < limits.arm.lower[3]
    for given, joints in ((start, None), (None, start)):
        options = {} if given is None else {"start": given}
        session = Session(small_result, poses, **options)
        session.live.engage()
        q = [start]
        for _ in range(200):
            state = session.step(poses[1], joints=joints)
            joints = None
            q.append(state.joint_positions)
        assert state.state in MOVING
        assert state.joint_positions[3] > limits.arm.lower[3]
        assert (np.diff(np.array(q)[:, 3])[np.array(q)[:-1, 3] < limits.arm.lower[3]] >= 0.0).all()
        velocity = np.diff(q, axis=0) / PERIOD
        assert (np.abs(velocity) <= limits.velocity + 1e-6).all()
        assert (
            np.abs(np.diff(velocity, axis=0)) / PERIOD <= limits.acceleration * (1.0 + 1e-6)
        ).all()
    start[3] = -3.08
    with pytest.raises(InvalidInputError, match="joint4"):
        mp.Live.of(small_result, start=start)


def test_drift_of_a_hidden_wrist_keeps_the_limits(session, limits):
    """15 mm in 0.3 s, then back at once."""
    wrist = session.live.points.index("RightHand")
    length = np.linalg.norm(session.points[0][wrist] - session.points[0][wrist - 1])
    session.live.engage()
    session.run(1.5)
    for axis in np.eye(3):
        for share in [*np.linspace(0.0, 1.0, 30), *[1.0] * 30, *[0.0] * 60]:
            drifted = session.points[0].copy()
            drifted[wrist] += share * 0.015 / 0.25 * length * axis
            state = session.step(drifted)
            assert state.state == "following"
    session.require_limits(limits)


def test_robot_time_advances_with_the_clock(session):
    """At rest slow steps do not matter; a motion falls behind by them, which is made up for by 5 %."""
    session.run(0.1)
    for slow in (False, True):
        begin = session.states[-1].time - session.clock.now
        for _ in range(10):
            session.clock.delays = list(SLOW) if slow else []
            session.step(session.points[0])
            session.clock.delays = []
            assert session.states[-1].time - session.sent[-1] == pytest.approx(begin - 0.05 * slow)
    session.live.engage()
    session.run(0.1, pose=1)
    for _ in range(10):
        session.clock.delays = list(SLOW)
        session.step(session.points[1])
    session.clock.delays = []
    session.live.hold()
    session.run(3.0)
    moved = np.diff([state.time for state in session.states])
    passed = np.diff(session.sent)
    assert (moved <= passed + 0.05 + 1e-9).all()
    assert_allclose(moved[-200:], passed[-200:], rtol=0.051)


def test_the_machine_has_no_other_way_to_move():
    """Whatever is called in whatever order, a robot that moves was engaged since the last loss or stop."""
    draw = np.random.default_rng(0)
    machine = StateMachine()
    now = 0.0
    consent = False
    reached = set()
    seen_at = -np.inf
    for _ in range(20_000):
        call = draw.choice(["engage", "hold", "step"], p=[0.05, 0.05, 0.9])
        if call == "engage":
            machine.engage(now)
            consent = True
        elif call == "hold":
            machine.hold()
            consent = False
        else:
            elapsed = draw.choice([0.0, 0.01, 0.1, 0.3])
            now += elapsed
            seen = draw.random() < 0.7
            seen_at = now if seen else seen_at
            displaced = draw.random() < 0.02
            machine.begin_step(now, elapsed, seen, displaced)
            if machine.state in MOVING:
                assert consent
                assert now - seen_at <= LOSS
                machine.end_step(now, draw.choice([0.001, 0.02, 0.1]), 1.0)
            elif displaced or now - seen_at > LOSS or elapsed > LOSS:
                consent = machine._asked_at > -np.inf
        reached.add(machine.state)
    assert reached == set(STATES)
