"""The relative and the absolute ellipsoids of a pair: their formulas, derivatives and references."""

import pickle

import numpy as np
import pytest
from robot_packages import model_of
from scipy.spatial.transform import Rotation

import maniport as mp
from maniport.bodies.mirroring import mirrored
from maniport.bodies.readers.packages import PACKAGES
from maniport.errors import InvalidInputError, NotSPDError
from real_robots import HERE, MISSING

KINDS = ("relative", "absolute")
SPECS = [
    mp.EllipsoidSpec(), mp.EllipsoidSpec("force"), mp.EllipsoidSpec(part="rotation"),
    mp.EllipsoidSpec("force", "full"), mp.EllipsoidSpec(part="full", joint_weights="velocity-limits"),
]  # fmt: skip


@pytest.fixture(scope="module")
def pandas():
    """Two Pandas on a table."""
    return mp.load_arms("panda", ("panda_link8", "panda_hand_tcp"), bases=((0, 0.3, 0), (0.1, -0.3, 0, 0.4)))


@pytest.fixture(scope="module")
def talos():
    """A humanoid whose torso moves both arms, with two joints."""
    if not HERE:
        pytest.skip(MISSING)
    return mp.load_arms("talos")


def test_ellipsoids_of_arms_without_shared_joints_are_sums(pandas):
    """M_r = M_left + M_right and M_a = (M_left + M_right) / 4 to 1e-12; those of force are their inverses."""
    q = pandas.sample(64, 0)
    for part in ("translation", "rotation", "full"):
        together = pandas.manipulability(q, part=part).sum(axis=1)
        np.testing.assert_allclose(pandas.manipulability(q, part=part, of="relative"), together, rtol=0, atol=1e-12)
        np.testing.assert_allclose(pandas.manipulability(q, part=part, of="absolute"), together / 4, rtol=0, atol=1e-12)
    force = pandas.manipulability(q, "force", of="absolute")
    np.testing.assert_allclose(
        force @ pandas.manipulability(q, of="absolute"), np.tile(np.eye(3), (64, 1, 1)), atol=1e-9
    )


def test_what_both_hold_firmly_moves_within_the_absolute_ellipsoid(pandas):
    """(M_left⁻¹ + M_right⁻¹)⁻¹, where both tips move as one, is not longer than M_a in any direction."""
    q = pandas.sample(64, 6)
    held = np.linalg.inv(np.linalg.inv(pandas.manipulability(q)).sum(axis=1))
    assert np.linalg.eigvalsh(pandas.manipulability(q, of="absolute") - held).min() > -1e-12
    same = pandas.joined(q[:, :7], q[:, :7])
    twins = mp.load_arms("panda", bases=((0, 1, 0), (0, -1, 0)))
    np.testing.assert_allclose(
        np.linalg.inv(np.linalg.inv(twins.manipulability(same)).sum(axis=1)), twins.absolute.ellipsoids(same), rtol=1e-9
    )  # fmt: skip


def test_shared_joints_count_once(talos):
    """With the blocks of J = [T A 0; T' 0 B] of a torso and two arms, M is theirs and not the sum of both arms'."""
    q = talos.sample(32, 1)
    jacobian, count = talos.jacobian(q)[..., :3, :], len(talos.shared)
    own = [jacobian[:, i][..., np.setdiff1d(columns, range(count))] for i, columns in enumerate(talos.columns)]
    arms = sum(block @ np.swapaxes(block, -1, -2) for block in own)
    for kind, factors in (("relative", (-1.0, 1.0)), ("absolute", (0.5, 0.5))):
        torso = factors[0] * jacobian[:, 0, :, :count] + factors[1] * jacobian[:, 1, :, :count]
        expected = torso @ np.swapaxes(torso, -1, -2) + arms * factors[1] ** 2
        np.testing.assert_allclose(talos.manipulability(q, of=kind), expected, rtol=0, atol=1e-12)
    twice = talos.manipulability(q).sum(axis=1)
    assert np.linalg.norm(talos.manipulability(q, of="relative") - twice, axis=(1, 2)).min() > 0.01


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("body", ["pandas", "talos"])
def test_derivatives_of_ellipsoids_are_finite_differences(body, kind, request):
    """Central differences of M in every joint, shared ones included, for each kind and part, weighted or not."""
    arms = request.getfixturevalue(body)
    one, h = getattr(arms, kind), 1e-6
    q = 0.6 * arms.sample(3, 2) + 0.4 * np.clip(0.3, arms.lower, arms.upper)
    for spec in SPECS:
        changes = one.manipulability_jacobian(q, spec)
        for k, step in enumerate(h * np.eye(arms.dof)):
            change = (one.ellipsoids(q + step, spec) - one.ellipsoids(q - step, spec)) / (2 * h)
            np.testing.assert_allclose(changes[:, k], change, atol=1e-6 * max(1.0, np.abs(change).max()))


@pytest.mark.parametrize("body", ["pandas", "talos"])
def test_jacobians_are_derivatives_of_poses(body, request):
    """Of the way between the tips and the point half-way; the relative turn changes by ω seen from the left tip."""
    arms = request.getfixturevalue(body)
    q, h = arms.sample(4, 3), 1e-6
    left = arms.forward(q)[:, 0, :3, :3]
    for kind in KINDS:
        one = getattr(arms, kind)
        for k, step in enumerate(h * np.eye(arms.dof)):
            ahead, behind = one.forward(q + step), one.forward(q - step)
            column = one.jacobian(q)[..., k]
            np.testing.assert_allclose((ahead - behind)[:, :3, 3] / (2 * h), column[:, :3], atol=1e-8)
            if kind == "relative":
                turned = ahead[:, :3, :3] @ np.swapaxes(behind[:, :3, :3], 1, 2)
                spin = Rotation.from_matrix(turned).as_rotvec() / (2 * h)
                np.testing.assert_allclose((left @ spin[..., None])[..., 0], column[:, 3:], atol=1e-7)


def test_the_absolute_rotation_lies_half_way(pandas):
    """From the left tip to it is the same turn as from it to the right tip."""
    q = pandas.sample(16, 4).reshape(4, 4, -1)
    (left, right), middle = np.moveaxis(pandas.forward(q)[..., :3, :3], 2, 0), pandas.absolute.forward(q)[..., :3, :3]
    first = np.swapaxes(left, -1, -2) @ middle
    np.testing.assert_allclose(first, np.swapaxes(middle, -1, -2) @ right, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_all_at_once_is_the_same(pandas, kind):
    """Poses, Jacobians, ellipsoids and derivatives of one pass are those asked for one by one."""
    one, q = getattr(pandas, kind), pandas.sample(6, 5).reshape(2, 3, -1)
    alone = one.forward(q), one.jacobian(q), one.ellipsoids(q), one.manipulability_jacobian(q)
    for together, single in zip(one.posed_differentials(q), alone, strict=True):
        np.testing.assert_allclose(together, single, rtol=0, atol=1e-14)
    assert [array.shape[0] for array in one.posed_differentials(q[0, :0])] == [0] * 4
    lengths, directions = one.principal_axes(q)
    ellipsoids = (directions * lengths[..., None, :] ** 2) @ np.swapaxes(directions, -1, -2)
    np.testing.assert_allclose(ellipsoids, one.ellipsoids(q), atol=1e-12)


def test_jacobians_of_a_humanoid_are_those_of_mujoco(talos):
    """Relative and absolute Jacobians of Talos against MuJoCo's of both hands, to 1e-9."""
    mujoco = pytest.importorskip("mujoco")
    model = model_of(mujoco, PACKAGES["example-robot-data"].found()["talos_reduced"])
    data = mujoco.MjData(model)
    columns = [model.joint(name).dofadr[0] for name in talos.joint_names]
    for q in talos.sample(4, 0):
        data.qpos[:] = 0.0
        for name, value in zip(talos.joint_names, q, strict=True):
            data.joint(name).qpos = value
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        tips = []
        for arm in talos.each:
            body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, arm.frame)
            linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, linear, angular, data.xpos[body], body)
            tips.append(np.vstack([linear, angular])[:, columns])
        np.testing.assert_allclose(talos.jacobian(q), tips, atol=1e-9)
        np.testing.assert_allclose(talos.relative.jacobian(q), tips[1] - tips[0], atol=1e-9)
        np.testing.assert_allclose(talos.absolute.jacobian(q), (tips[0] + tips[1]) / 2, atol=1e-9)


def test_arms_that_are_mirror_images_exchange_what_they_do():
    """Exchanged joint angles of an arm and its mirror image give mirrored tips, ellipsoids and slopes, to 1e-12."""
    right = mp.load_arms("panda", bases=((0, 1, 0), (0.1, -0.3, 0.2, 0.4))).right
    arms, mirror = mp.Arms(mp.Arm(mirrored(right.chain)), right), np.diag([1.0, -1.0, 1.0])
    q = arms.sample(16, 0)
    swapped = arms.joined(*arms.split(q)[::-1])
    tips, exchanged = (arms.forward(posture)[..., :3, 3] for posture in (q, swapped))
    np.testing.assert_allclose(exchanged[:, ::-1], tips @ mirror, atol=1e-12)
    np.testing.assert_array_equal([points[0, 0] for points in arms.skeleton(q)], [[0.1, 0.3, 0.2], [0.1, -0.3, 0.2]])
    for kind in KINDS:
        one = getattr(arms, kind)
        np.testing.assert_allclose(one.ellipsoids(swapped), mirror @ one.ellipsoids(q) @ mirror, atol=1e-12)
        changes = np.roll(mirror @ one.manipulability_jacobian(q) @ mirror, 7, axis=1)
        np.testing.assert_allclose(one.manipulability_jacobian(swapped), changes, atol=1e-12)


def test_mirrored_postures_of_mirrored_arms_give_mirrored_ellipsoids(talos):
    """In the plane between two equal arms what left and right do is exchanged, and ellipsoids are mirrored."""
    mirror = np.diag([1.0, -1.0, 1.0])
    held = mp.load_arms("talos", lock={"torso_1_joint": 0.0, "torso_2_joint": 0.0})
    q = 0.5 * held.sample(16, 0)
    left, right = held.split(q)
    signs = _mirroring(held)
    swapped = held.joined(signs * right, signs * left)
    np.testing.assert_allclose(
        held.forward(swapped)[:, ::-1, :3, 3], held.forward(q)[..., :3, 3] @ mirror, atol=2e-4
    )  # the file's own arms differ by so much
    for kind in KINDS:
        mirrored = mirror @ held.manipulability(q, of=kind) @ mirror
        np.testing.assert_allclose(held.manipulability(swapped, of=kind), mirrored, atol=2e-3)


def _mirroring(arms):
    """Signs with which the joints of one arm do what those of the other do, mirrored."""
    zero = np.zeros(arms.left.dof)
    left, right = (arm.jacobian(zero)[3:] for arm in arms.each)
    return -np.sign(np.sum(left * (np.diag([1.0, -1.0, 1.0]) @ right), axis=0))


def test_a_pair_as_one_is_taken_where_an_arm_is(pandas):
    """Domains, free of collisions too, start banks and searches take the relative motion as they take an arm."""
    one = pandas.relative
    collisions = mp.Collisions.of(pandas)
    domain = mp.sample_domain(one, 64, 0, collisions=collisions)
    assert domain.shape == (64, 3, 3)
    bank = mp.StartBank.build(one, 512)
    targets = one.ellipsoids(one.sample(3, 7))
    found = mp.nearest_feasible(one, targets, bank=bank)
    assert np.all(found.distance < 0.05)
    np.testing.assert_allclose(one.ellipsoids(found.joint_positions), found.ellipsoids, atol=1e-12)


def test_it_is_narrowed_pickled_and_shown(pandas):
    """Closer limits are those of the pair; a copy answers alike; what it is called says of which pair."""
    one = pandas.absolute.narrowed(0.9 * pandas.lower, 0.9 * pandas.upper - 0.1)
    q = one.sample(3, 0)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(one)).jacobian(q), pandas.absolute.jacobian(q))
    assert repr(pandas.relative) == f"{pandas!r}.relative"
    assert (one.frame, one.base) == ("absolute: panda_link8, panda_hand_tcp", "world")


def test_wrong_requests_are_told(pandas):
    """Singular force ellipsoids and wrong shapes are named as those of an arm are."""
    planar = mp.Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]])
    other = mp.Arm.from_dh("other", [[0, 0, 2, 0], [0, 0, 1, 0]], joint_names=["a", "b"], base=np.eye(4))
    flat = mp.Arms(planar, other)
    with pytest.raises(NotSPDError, match="singular"):
        flat.manipulability(np.zeros(flat.dof), "force", of="relative")
    with pytest.raises(InvalidInputError, match=r"q must have shape \(..., 14\)"):
        pandas.relative.forward(np.zeros(7))
    with pytest.raises(InvalidInputError, match="joint_weights"):
        pandas.manipulability(np.zeros(14), joint_weights=np.ones(7), of="relative")
