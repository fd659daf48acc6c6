import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from extensions.height_cost import HeightCost
from maniport.arms import Arm, EllipsoidSpec, load_arm, load_arms
from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError, ManiportError, NotSPDError, OutputError
from maniport.motion import TargetTrajectory, controller, nearest_feasible, track
from maniport.report import report_of
from maniport.util.files import load_ellipsoids
from motion_plans import tracked_arm, tracked_motion

TIME = np.linspace(0.0, 2.0, 41)
START = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5])


@pytest.fixture(scope="module")
def motion(panda):
    """A smooth motion of the Panda, its own ellipsoids and hand path."""
    swing = np.array([0.4, 0.3, -0.3, 0.35, 0.4, -0.3, 0.2])
    joints = START + swing * np.sin(1.2 * TIME[:, None])
    return joints, panda.manipulability(joints), panda.forward(joints)[:, :3, 3]


@pytest.fixture(scope="module")
def own(panda, motion):
    joints, profile, path = motion
    return tracked_arm(panda, profile, time=TIME, path=path, start=joints[0]).arms[0]


def keeps_limits(result, arm, velocity_limits=None):
    """Whether positions and velocities stay within their limits to 1e-9 at every control step."""
    q = result.control_positions
    speeds = arm.velocity_limits if velocity_limits is None else velocity_limits
    inside = np.all((q >= arm.lower - 1e-9) & (q <= arm.upper + 1e-9))
    velocity = np.abs(np.diff(q, axis=0) / np.diff(result.control_time)[:, None])
    return inside and np.all(velocity <= speeds + 1e-9)


def test_own_ellipsoids_and_path_are_followed(panda, motion, own):
    """From the right start, d stays below 0.05 and the hand within 1 mm at 95 %, within limits, and all is followed."""
    joints, _, path = motion
    assert np.percentile(own.distance, 95) < 0.05
    assert np.percentile(own.position_error, 95) < 1e-3
    assert set(own.status) == {"followed"}
    assert keeps_limits(own, panda)
    assert not own.held.any()
    assert_array_equal(own.joint_positions[0], joints[0])
    assert_allclose(own.achieved, panda.manipulability(own.joint_positions))
    tips = panda.forward(own.joint_positions)[:, :3, 3]
    assert_allclose(own.position_error, np.linalg.norm(tips - path, axis=1))
    assert_allclose(
        own.joint_positions[:, :6], joints[:, :6], atol=0.02
    )  # the last joint changes nothing
    assert_allclose(
        own.joint_velocities[5:-5, :6], np.gradient(joints, TIME, axis=0)[5:-5, :6], atol=0.1
    )


def test_a_path_out_of_reach_is_pointed_at_calmly(panda, bank, motion):
    far = 3.0 * motion[2]
    start = nearest_feasible(panda, motion[1][:1], positions=far[:1], bank=bank).joint_positions[0]
    result = tracked_arm(panda, motion[1], time=TIME, path=far, start=start).arms[0]
    assert keeps_limits(result, panda)
    assert "position missed" in result.status
    assert "followed" not in result.status
    shoulder = np.array([0, 0, 0.333])
    reach = 0.858
    least = np.linalg.norm(far - shoulder, axis=1) - reach
    assert np.all(result.position_error[5:] < least[5:] + 0.02)
    jerk = np.diff(result.control_positions, 3, axis=0) / np.diff(result.control_time)[0] ** 3
    assert np.abs(jerk[len(jerk) // 4 :]).max() < 1000


@pytest.mark.parametrize(
    ("turn", "speed", "status"),
    [((2.0, 3.4), None, "joint limit"), ((0.0, 1.5), 0.3, "velocity limit")],
)
def test_joint_and_velocity_limits_are_named(panda, turn, speed, status):
    joints = np.repeat(START[None], len(TIME), axis=0)
    joints[:, 0] = np.linspace(*turn, len(TIME))
    path = panda.forward(joints)[:, :3, 3]
    profile = panda.manipulability(joints)
    result = tracked_arm(
        panda, profile, time=TIME, path=path, start=joints[0], velocity_limits=speed
    ).arms[0]
    assert result.status[-1] == status
    assert ("too-fast" in report_of(result).warning_keys) == (status == "velocity limit")
    assert keeps_limits(result, panda, speed)


def test_acceleration_limits_are_kept(panda):
    turn = np.stack([np.cos(TIME), np.sin(TIME), 0 * TIME], axis=1)
    needles = 0.01 * np.eye(3) + turn[:, :, None] * turn[:, None, :]
    result = tracked_arm(
        panda, needles, time=TIME, start=START, acceleration_limits=5.0, velocity_limits=1.0
    ).arms[0]
    step = np.diff(result.control_time)[0]
    assert np.abs(np.diff(result.control_positions, 2, axis=0)).max() <= 5.0 * step**2 + 1e-12
    assert keeps_limits(result, panda, 1.0)
    assert not result.held.any()


def test_failure_of_the_solver_holds_the_arm(panda, motion, monkeypatch):
    joints, profile, path = motion
    solve = controller.daqp.solve
    count = iter(range(10_000))

    def sometimes(*arguments):
        step, value, flag, info = solve(*arguments)
        return step, value, -1 if 100 <= next(count) < 110 else flag, info

    monkeypatch.setattr(controller.daqp, "solve", sometimes)
    result = tracked_arm(panda, profile, time=TIME, path=path, start=joints[0]).arms[0]
    assert_array_equal(np.flatnonzero(result.held), np.arange(101, 111))
    assert_array_equal(
        result.control_positions[101:111], np.repeat(result.control_positions[[100]], 10, axis=0)
    )
    assert {
        i
        for i, word in enumerate(result.status)
        if word == "QP failed; last safe configuration held"
    } == {21, 22}
    assert result.distance[-1] < 0.05
    assert result.position_error[-1] < 1e-3


@pytest.mark.parametrize(
    "spec",
    [
        EllipsoidSpec("force"),
        EllipsoidSpec(part="rotation"),
        EllipsoidSpec(part="full", joint_weights="joint-limits"),
    ],
)
def test_other_parts_are_followed_at_uneven_times(panda, motion, spec):
    joints = motion[0]
    uneven = np.cumsum(np.concatenate([[0.5], np.linspace(0.02, 0.08, 40)]))
    result = tracked_arm(
        panda, panda.ellipsoids(joints, spec), time=uneven, start=joints[0], rate=50, spec=spec
    ).arms[0]
    assert np.percentile(result.distance, 95) < 0.05
    assert result.spec == spec


def test_results_are_written_and_read_back(panda, own, tmp_path):
    own.save_joints_csv(tmp_path / "joints.csv")
    header = (tmp_path / "joints.csv").read_text().split("\n", 1)[0].split(",")
    assert header == [
        "time_s",
        *(f"panda_joint{i}_rad{per}" for per in ("", "/s", "/s2") for i in range(1, 8)),
    ]
    steps = (
        own.control_time,
        own.control_positions,
        own.control_velocities,
        own.control_accelerations,
    )
    rows = np.loadtxt(tmp_path / "joints.csv", delimiter=",", skiprows=1)
    assert_allclose(rows, np.column_stack(steps), atol=1e-6)
    own.save_joints(tmp_path / "joints.npz")
    with np.load(tmp_path / "joints.npz") as arrays:
        assert (tuple(arrays["joint_names"]), tuple(arrays["status"])) == (
            panda.joint_names,
            own.status,
        )
        for name in ("joint_positions", "control_positions", "control_velocities"):
            assert_array_equal(arrays[name], getattr(own, name))
    assert_allclose(load_ellipsoids(tmp_path / "joints.npz")[0], own.achieved)
    with pytest.raises(OutputError):
        own.save_joints(tmp_path / "nowhere" / "joints.npz")


class StillJoint:
    def __init__(self, dof, joint):
        self.dof = dof
        self.joint = joint

    def inequalities(self, q, dt):
        sides = np.zeros((2, self.dof))
        sides[:, self.joint] = 1.0, -1.0
        return sides, np.zeros(2)


def test_own_costs_limits_and_weights_are_used(panda, motion, own):
    joints, profile, path = motion
    options = {"time": TIME, "path": path, "start": joints[0]}
    still = tracked_arm(panda, profile, limits=[StillJoint(7, 1)], **options).arms[0]
    assert np.ptp(still.control_positions[:, 1]) < 1e-4
    assert np.ptp(still.control_positions[:, 0]) > 0.1
    assert keeps_limits(still, panda)
    raised = tracked_arm(
        panda, profile, costs=[HeightCost(panda, "panda_link4", 0.4, 50.0)], **options
    )
    with_cost, without = (
        np.abs(
            panda.point_positions(result.joint_positions[10:], ["panda_link4"])[:, 0, 2] - 0.4
        ).mean()
        for result in (raised.trajectory, own)
    )
    assert with_cost < 0.5 * without
    weights = np.repeat(np.diag([1.0, 1, 1, 0, 0, 0])[None], len(TIME), axis=0)
    assert np.all(
        np.isfinite(tracked_arm(panda, profile, weights=weights, **options).arms[0].distance)
    )


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"time": TIME[::-1]}, InvalidInputError, "time"),
        ({"time": TIME[:-1]}, InvalidInputError, "profile"),
        ({"path": np.full((41, 3), np.nan)}, InvalidInputError, "path"),
        ({"profile": -np.repeat(np.eye(3)[None], 41, axis=0)}, NotSPDError, "profile with damping"),
        ({"start": np.full(7, 9.0)}, InvalidInputError, "start.*outside the limits"),
        ({"damping": None}, InvalidInputError, "damping"),
        ({"rate": -1}, InvalidInputError, "rate"),
        ({"position_cost": -1.0}, InvalidInputError, "position_cost"),
        ({"costs": [3]}, InvalidInputError, r"costs\[0\]"),
        ({"limits": "fast"}, InvalidInputError, "limits"),
        ({"limits": [3]}, InvalidInputError, r"limits\[0\]"),
        ({"limits": [StillJoint(6, 1)]}, InvalidInputError, r"limits\[0\]"),
        ({"limits": [StillJoint("seven", 1)]}, InvalidInputError, r"limits\[0\].*TypeError"),
        ({"start": None}, InvalidInputError, "start is required"),
        ({"velocity_limits": [1.0, 2.0]}, InvalidInputError, "velocity_limits"),
        ({"acceleration_limits": 0.0}, InvalidInputError, "acceleration_limits"),
        ({"weights": np.repeat(-np.eye(6)[None], 41, axis=0)}, NotSPDError, "weights"),
    ],
)
def test_bad_input_is_refused(panda, motion, change, error, words):
    joints, profile, path = motion
    arguments = {"profile": profile, "time": TIME, "path": path, "start": joints[0], **change}
    with pytest.raises(error, match=words):
        tracked_arm(panda, arguments.pop("profile"), **arguments)


def test_arms_that_cannot_be_tracked_are_errors():
    for arm, words in (
        (Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]]), "2 joints"),
        (load_arm("myoarm"), "coupled"),
    ):
        with pytest.raises(ManiportError, match=words):
            tracked_arm(arm, np.repeat(np.eye(3)[None], 3, axis=0), time=[0, 1, 2])


@pytest.fixture(scope="module")
def pandas():
    return load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.1, -0.3, 0.0, 0.2)])


def targets(group, *joints, scale=1.0):
    """Arguments of `tracked_motion`: ellipsoids, perhaps scaled, and paths of configurations of each arm."""
    arms = list(zip(group.arms, joints, strict=True))
    return {
        "profiles": [scale * arm.manipulability(q) for arm, q in arms],
        "paths": [arm.forward(q)[:, :3, 3] for arm, q in arms],
        "time": np.linspace(0.0, 2.0, len(joints[0])),
        "reference": group.joined(*joints),
    }


def test_arms_far_from_each_other_follow_as_each_alone(pandas):
    swing = START + 0.3 * np.sin(
        np.outer(np.linspace(0.0, 2.0, 9), [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.5])
    )
    both = targets(pandas, swing, swing[::-1], scale=0.9)
    options = {"rate": 50.0, "acceleration_limits": 10.0}
    group = tracked_motion(pandas, **both, **options)
    for i, motion in enumerate(group.arms):
        reference = both["reference"][:, pandas.columns[i]]
        single = {"time": both["time"], "reference": reference}
        ellipsoids = both["profiles"][i]
        path = both["paths"][i]
        alone = tracked_arm(pandas.arms[i], ellipsoids, path, **single, **options).trajectory
        assert_allclose(motion.control_positions, alone.control_positions, atol=1e-4)
    assert_array_equal(group.arms[0].control_positions, group.trajectory.control_positions[:, :7])
    assert not group.arms[0].held.any()
    target = TargetTrajectory.checked(pandas.arms[0], both["time"], both["profiles"][0])
    with pytest.raises(InvalidInputError, match="targets"):
        track(pandas, target)


def test_arms_keep_clear_of_one_another(pandas):
    collisions = Collisions.of(pandas)
    end = np.array([0.9, 0.2, 0.3, -1.9, 0.4, 1.8, 0.5])
    share = np.linspace(0.0, 1.0, 9)[:, None]
    left = START + share * (end * [-1, 1, 1, 1, 1, 1, 1] - START)
    right = START + share * (end - START)
    for model in (None, collisions):
        motion = tracked_motion(pandas, **targets(pandas, left, right), rate=25.0, collisions=model)
        assert collisions.collides(motion.trajectory.control_positions).any() == (model is None)
    assert motion.clearance.share == 0.0
