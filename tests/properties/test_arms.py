import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maniport.arms import VELOCITY, Arm, EllipsoidSpec, load_arm, myoarm, rhuman
from maniport.arms.collisions import Collisions
from maniport.domain import sample_domain

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
ARMS = {
    "panda": lambda: load_arm("panda"),
    "myoarm": myoarm,
    "rhuman": lambda: rhuman(upper_arm=0.3),
    "one joint": lambda: Arm.from_dh("one joint", [[0.1, 0.2, 1, 0.3]]),
    "two links": lambda: Arm.from_dh(
        "two links", [[0, 0, 1, 0], [0, 0, 0.5, 0.3]], lower=-2.0, upper=[1.0, 2.5]
    ),
    "slide": lambda: Arm.from_dh(
        "slide", [[0, 0.1, 0.4, 1.0], [0.2, 0.3, 0, 0.5]], 0.0, 1.0, kinds=KINDS
    ),
}
KINDS = ("revolute", "prismatic")
SPECS = [
    EllipsoidSpec(kind, part)
    for kind in ("velocity", "force")
    for part in ("translation", "rotation", "full")
]
arms = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS, indirect=True)
seeds = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def arm(request):
    return request.param()


@arms
@given(seed=seeds)
def test_kinematics_are_consistent(arm, seed):
    q = arm.sample(3, seed)
    poses = arm.forward(q)
    jacobian = arm.jacobian(q)
    for method, batch in (
        (arm.forward, poses),
        (arm.jacobian, jacobian),
        (arm.ellipsoids, arm.ellipsoids(q)),
    ):
        assert_allclose(method(q[1]), batch[1], rtol=0, atol=1e-13 * np.abs(batch).max())
        assert method(q[:0]).shape == (0, *batch.shape[1:])
    turns = poses[:, :3, :3]
    assert_allclose(turns @ np.swapaxes(turns, 1, 2), [np.eye(3)] * 3, atol=1e-9)
    assert_allclose(np.linalg.det(turns), 1.0)
    assert_array_equal(poses[:, 3], [[0.0, 0.0, 0.0, 1.0]] * 3)
    assert_allclose(arm.point_positions(q, [arm.frame])[:, 0], poses[:, :3, 3], atol=1e-12)
    assert_allclose(arm.point_jacobians(q, [arm.frame])[:, 0], jacobian[:, :3], atol=1e-12)
    assert_allclose(arm.skeleton(q)[:, -1], poses[:, :3, 3], atol=1e-12)
    assert_allclose(arm.link_poses(q)[:, 0], [np.eye(4)] * 3, atol=1e-12)
    direction = arm.axis_direction(q, arm.chain.joints[-1].name)
    assert_allclose(np.linalg.norm(direction, axis=1), 1.0, rtol=1e-9)


@arms
@given(seed=seeds, spec=st.sampled_from(SPECS))
def test_ellipsoids_agree_with_the_jacobian(arm, seed, spec):
    q = arm.sample(3, seed)
    velocity = EllipsoidSpec("velocity", spec.part)
    assert spec.bounded == velocity
    assert arm.checked_spec(spec) == spec
    poses = arm.forward(q)
    jacobian = arm.jacobian(q)
    rows = jacobian[:, spec.rows]
    matrices = rows @ np.swapaxes(rows, 1, 2)
    assert_allclose(arm.ellipsoids(q, velocity), matrices, atol=1e-12)
    assert_array_equal(arm.manipulability(q, part=spec.part), arm.ellipsoids(q, velocity))
    assert_array_equal(arm.ellipsoids(q), arm.ellipsoids(q, VELOCITY))
    weights = np.arange(1.0, arm.dof + 1.0)
    weighted = arm.ellipsoids(q, EllipsoidSpec("velocity", spec.part, weights))
    assert_allclose(weighted, (rows * weights**2) @ np.swapaxes(rows, 1, 2), atol=1e-10)
    for actual, expected in zip(
        arm.posed_differentials(q, velocity), (poses, jacobian, matrices), strict=False
    ):
        assert_allclose(actual, expected, rtol=0, atol=1e-12)
    if spec.kind == "force" and arm.dof >= spec.size and np.linalg.cond(matrices).max() < 1e8:
        assert_allclose(arm.ellipsoids(q, spec) @ matrices, [np.eye(spec.size)] * 3, atol=1e-5)


@arms
@given(seed=seeds, n=st.integers(1, 40), sequence=st.sampled_from(["sobol", "uniform"]))
def test_samples_are_within_limits_and_repeat(arm, seed, n, sequence):
    q = arm.sample(n, seed, sequence)
    assert q.shape == (n, arm.dof)
    assert np.all(arm.within_limits(q))
    assert_array_equal(arm.require_within_limits(q), q)
    assert_array_equal(arm.configurations(q.tolist()), q)
    assert_array_equal(arm.sample(n + 3, seed, sequence)[:n] if sequence == "sobol" else q, q)
    for spec in (VELOCITY, EllipsoidSpec(part="rotation"), EllipsoidSpec(part="full")):
        domain = sample_domain(arm, n, seed, sequence, spec=spec)
        assert_array_equal(domain, arm.ellipsoids(arm.sample(n, seed, sequence), spec))
    inside = arm.narrowed(0.9 * arm.lower + 0.1 * arm.upper, arm.upper)
    assert_array_equal(inside.forward(q), arm.forward(q))
    same = arm.restricted(arm.frame, arm.joint_names)
    assert_allclose(same.forward(q), arm.forward(q), atol=1e-12)


def test_a_domain_without_collisions_has_as_many_ellipsoids(panda):
    collisions = Collisions.of(panda)
    q = panda.sample(256, 0)
    free = q[~collisions.collides(q)]
    domain = sample_domain(panda, 224, 0, collisions=collisions)
    assert 224 < len(free) < 256
    assert_array_equal(domain, panda.manipulability(free[:224]))
    assert_array_equal(domain, sample_domain(panda, 224, 0, collisions=True))
