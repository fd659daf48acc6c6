"""Laws of forward kinematics and Jacobians, on every kind of arm."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from maniport.bodies import load_arm
from maniport.bodies.arm import Arm
from maniport.bodies.human import myoarm, rhuman

STEP = 1e-6


@pytest.fixture(
    params=["panda", "myoarm", "rhuman", "urdf", "mjcf", "hinge_urdf", "hinge_mjcf", "planar", "restricted"]
)
def arm(request: pytest.FixtureRequest) -> Arm:
    """One arm of each kind."""
    if request.param.endswith("urdf") or request.param.endswith("mjcf"):
        tip = "tip" if request.param.startswith("hinge") else None
        return load_arm(request.getfixturevalue(request.param), frame=tip)
    if request.param == "planar":
        return request.getfixturevalue("planar")
    if request.param == "restricted":
        return load_arm("myoarm", frame="wrist", joints=["shoulder_elv", "elbow_flexion"])
    return load_arm(request.param)


def differences(function, q: np.ndarray) -> np.ndarray:
    """Central differences of a function of q, the derivative's direction last."""
    steps = STEP * np.eye(q.shape[-1])
    return np.stack([(function(q + s) - function(q - s)) / (2 * STEP) for s in steps], axis=-1)


def test_linear_jacobian_is_the_derivative_of_position(arm):
    """The upper rows of the Jacobian are the derivative of the tip's position."""
    q = arm.sample(8, random_state=0)
    numeric = differences(lambda x: arm.forward(x)[..., :3, 3], q)
    np.testing.assert_allclose(arm.jacobian(q)[:, :3], numeric, atol=1e-8)


def test_angular_jacobian_is_the_derivative_of_orientation(arm):
    """The lower rows are the angular velocity: [ω]× = Ṙ Rᵀ in the axes of the base."""
    q = arm.sample(8, random_state=1)
    change = differences(lambda x: arm.forward(x)[..., :3, :3], q)
    spin = np.einsum("nijk,nlj->nilk", change, arm.forward(q)[:, :3, :3])
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    np.testing.assert_allclose(arm.jacobian(q)[:, 3:], omega, atol=1e-8)


def test_point_jacobians_are_derivatives_of_point_positions(arm):
    """The Jacobians of all named points are the derivatives of their positions."""
    q = arm.sample(4, random_state=2)
    numeric = differences(lambda x: arm.point_positions(x, arm.frames), q)
    np.testing.assert_allclose(arm.point_jacobians(q, arm.frames), numeric, atol=1e-8)


def test_point_of_the_tip_is_the_tip(arm):
    """Positions and Jacobians of the tip as a point agree with `forward` and `jacobian`."""
    q = arm.sample(4, random_state=3)
    np.testing.assert_allclose(arm.point_positions(q, [arm.frame])[:, 0], arm.forward(q)[:, :3, 3], atol=1e-14)
    np.testing.assert_allclose(arm.point_jacobians(q, [arm.frame])[:, 0], arm.jacobian(q)[:, :3], atol=1e-14)


def test_forward_gives_rigid_poses(arm):
    """Every pose has an orthonormal right-handed rotation and the last row 0 0 0 1."""
    poses = arm.forward(arm.sample(16, random_state=4))
    rotations = poses[:, :3, :3]
    np.testing.assert_allclose(
        rotations @ rotations.swapaxes(-1, -2), np.broadcast_to(np.eye(3), (16, 3, 3)), atol=1e-13
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0, atol=1e-13)
    np.testing.assert_array_equal(poses[:, 3], np.tile([0.0, 0, 0, 1], (16, 1)))


def test_batches_equal_their_rows(arm):
    """A batch of any shape holds what its configurations give one by one."""
    q = arm.sample(6, random_state=5)
    for method in (arm.forward, arm.jacobian, arm.manipulability, arm.skeleton):
        rows = np.stack([method(x) for x in q])
        np.testing.assert_allclose(method(q), rows, rtol=0, atol=1e-14)
        np.testing.assert_array_equal(method(q.reshape(2, 3, -1)), method(q).reshape(2, 3, *rows.shape[1:]))


def test_shapes_of_single_and_empty_input(arm):
    """One configuration has no leading axis, and no configuration gives empty arrays."""
    q = arm.sample(1, random_state=6)[0]
    assert arm.forward(q).shape == (4, 4)
    assert arm.jacobian(q).shape == (6, arm.dof)
    assert arm.point_positions(q, arm.frames[:2]).shape == (2, 3)
    assert arm.point_jacobians(q, arm.frames[:2]).shape == (2, 3, arm.dof)
    assert arm.jacobian(np.empty((0, arm.dof))).shape == (0, 6, arm.dof)
    assert arm.forward(np.empty((2, 0, arm.dof))).shape == (2, 0, 4, 4)


def test_skeleton_runs_from_base_to_tip_with_rigid_segments(arm):
    """The polyline starts at the base's origin and ends at the tip."""
    q = arm.sample(5, random_state=7)
    points = arm.skeleton(q)
    assert points.shape[0] == 5
    assert points.shape[1] >= 2
    np.testing.assert_array_equal(points[:, 0], np.zeros((5, 3)))
    np.testing.assert_allclose(points[:, -1], arm.forward(q)[:, :3, 3], atol=1e-14)


def test_skeleton_of_the_human_arm_passes_the_named_points():
    """The drawn arm has corners at the shoulder, the elbow and the wrist."""
    for arm in (myoarm(), rhuman()):
        q = arm.sample(1, random_state=0)[0]
        for point in arm.point_positions(q, ["shoulder", "elbow", "wrist", "hand"]):
            assert np.abs(arm.skeleton(q) - point).max(axis=1).min() < 1e-12


def test_axis_direction_is_the_angular_column_of_an_uncoupled_joint():
    """The axis of a joint that moves alone is its column of the angular Jacobian."""
    arm = load_arm("panda")
    q = arm.sample(3, random_state=0)
    for j, name in enumerate(arm.joint_names):
        np.testing.assert_allclose(arm.axis_direction(q, name), arm.jacobian(q)[:, 3:, j], atol=1e-14)


def test_axis_direction_of_a_slide_is_its_linear_column(urdf):
    """A slide moves the tip along its axis."""
    arm = load_arm(urdf)
    q = arm.sample(3, random_state=0)
    np.testing.assert_allclose(arm.axis_direction(q, "travel"), arm.jacobian(q)[:, :3, 2], atol=1e-14)


def test_arm_survives_pickling(arm):
    """A copy from another process computes the same bits."""
    copy = pickle.loads(pickle.dumps(arm))
    q = arm.sample(3, random_state=8)
    np.testing.assert_array_equal(copy.jacobian(q), arm.jacobian(q))
    assert repr(copy) == repr(arm)


def test_threads_may_share_an_arm(arm):
    """Several threads at work on one arm get what one thread gets."""
    batches = [arm.sample(300, random_state=seed) for seed in range(4)]
    with ThreadPoolExecutor(4) as pool:
        shared = list(pool.map(lambda q: arm.point_jacobians(q, arm.frames), batches))
    for q, jacobians in zip(batches, shared, strict=True):
        np.testing.assert_array_equal(jacobians, arm.point_jacobians(q, arm.frames))


def test_planar_arm_is_the_textbook_one(planar):
    """Two links of one metre reach (cos q1 + cos q12, sin q1 + sin q12, 0)."""
    q = planar.sample(20, random_state=0)
    a, b = q[:, 0], q.sum(axis=1)
    expected = np.stack([np.cos(a) + np.cos(b), np.sin(a) + np.sin(b), np.zeros(20)], axis=1)
    np.testing.assert_allclose(planar.forward(q)[:, :3, 3], expected, atol=1e-15)


def test_base_moves_the_whole_arm():
    """A base rotation or pose multiplies every pose from the left."""
    rows, rotation = [[0.1, 0.2, 1, 0.3], [0, 0.1, 1, -0.4]], [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, [1, 2, 3]
    plain, turned, moved = (Arm.from_dh("a", rows, base=base) for base in (None, rotation, pose))
    q = plain.sample(5, random_state=0)
    np.testing.assert_allclose(turned.forward(q)[:, :3, 3], plain.forward(q)[:, :3, 3] @ np.transpose(rotation))
    np.testing.assert_allclose(moved.forward(q), pose @ plain.forward(q), atol=1e-15)


def test_modified_dh_table_gives_the_panda():
    """Craig's table of the Panda, as its maker publishes it, gives the embedded arm."""
    half = np.pi / 2
    rows = [
        [0, 0.333, 0, 0], [0, 0, 0, -half], [0, 0.316, 0, half], [0, 0, 0.0825, half],
        [0, 0.384, -0.0825, -half], [0, 0, 0, half], [0, 0, 0.088, half],
    ]  # fmt: skip
    panda = load_arm("panda", frame="panda_link7")
    table = Arm.from_dh("table", rows, panda.lower, panda.upper, convention="modified")
    q = panda.sample(10, random_state=0)
    np.testing.assert_allclose(table.forward(q), panda.forward(q), atol=1e-14)


def test_prismatic_row_extends_d():
    """The coordinate of a prismatic row adds to its d."""
    arm = Arm.from_dh("slide", [[0.4, 0.2, 0.1, 0.3]], 0.0, 1.0, kinds=["prismatic"])
    longer = Arm.from_dh("slide", [[0.4, 0.7, 0.1, 0.3]], 0.0, 1.0, kinds=["prismatic"])
    np.testing.assert_allclose(arm.forward([0.5]), longer.forward([0.0]), atol=1e-15)


def test_locked_joints_stay_at_zero_or_the_limit_next_to_it():
    """An arm with locked joints is the whole arm with those joints at their resting place."""
    panda = load_arm("panda")
    arm = load_arm("panda", joints=["panda_joint7", "panda_joint2"])
    assert arm.joint_names == ("panda_joint2", "panda_joint7")
    q = arm.sample(5, random_state=0)
    whole = np.zeros((5, 7))
    whole[:, [1, 6]] = q
    whole[:, 3] = -0.0698
    np.testing.assert_allclose(arm.forward(q), panda.forward(whole), atol=1e-14)
    np.testing.assert_allclose(arm.jacobian(q), panda.jacobian(whole)[:, :, [1, 6]], atol=1e-14)
