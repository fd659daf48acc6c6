"""What an arm collides with: distances, their derivatives, and which postures are free."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from drawn_arms import write_digger
from scipy.spatial import ConvexHull

from maniport.arms import load_arm
from maniport.arms.collisions import Collisions, free_configurations
from maniport.motion.trajectory import Clearance
from maniport.report.robot import collision_warnings
from maniport.report.values import WARNING

CUBE = 0.2


def _link(name: str, size: float) -> str:
    return f'<link name="{name}"><visual><geometry><box size="{size} {size} {size}"/></geometry></visual></link>'


def _slide(name: str, parent: str, child: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    )


GANTRY = (
    '<robot name="gantry">'
    + _link("base", CUBE)
    + '<link name="beam"/><link name="trolley"/>'
    + _link("load", CUBE)
    + _slide("x", "base", "beam", "1 0 0")
    + _slide("y", "beam", "trolley", "0 1 0")
    + _slide("z", "trolley", "load", "0 0 1")
    + "</robot>"
)
"""A cube that three slides move past another cube of the same size, so that distances are known."""


def between_cubes(offset: np.ndarray) -> np.ndarray:
    """Signed distance of two cubes whose middles are so far apart, shape (..., 3)."""
    gaps = np.abs(offset) - CUBE
    outside = np.linalg.norm(np.maximum(gaps, 0.0), axis=-1)
    return np.where(outside > 0, outside, gaps.max(axis=-1))


@pytest.fixture
def gantry(tmp_path):
    """The arm with known distances."""
    path = tmp_path / "gantry.urdf"
    path.write_text(GANTRY)
    return load_arm(path)


@pytest.fixture(scope="module")
def panda():
    """The Panda with its hand."""
    return load_arm("panda", frame="panda_hand_tcp")


@pytest.fixture(scope="module")
def collisions(panda):
    """The Panda with its hand, over a table and before a box."""
    return Collisions.of(panda, table=0.0, obstacles=[[0.5, 0.1, 0.3, 0.2, 0.3, 0.2, 0.4]])


def test_distances_of_cubes_are_those_of_geometry(gantry):
    """Clearance is the distance of two cubes, and minus the shortest way out where they are in one another."""
    collisions = Collisions.of(gantry)
    assert collisions.pairs == (("base", "load"),)
    q = gantry.sample(256, 0)
    q[:64] *= 0.15
    expected = between_cubes(q)
    np.testing.assert_allclose(collisions.clearance(q), expected, atol=2e-6)
    np.testing.assert_array_equal(collisions.collides(q), expected <= 0)
    assert 40 < np.sum(expected < 0) < 128


def test_neighbors_need_a_quarter_of_the_clearance(tmp_path):
    """With two coordinates between, links collide within a quarter of the padding; scaled distances do so, too."""
    third = _slide("z", "trolley", "load", "0 0 1")
    fixed = '<joint name="z" type="fixed"><parent link="trolley"/><child link="load"/></joint>'
    assert third in GANTRY
    (tmp_path / "near.urdf").write_text(GANTRY.replace(third, fixed))
    collisions = Collisions.of(load_arm(tmp_path / "near.urdf"), padding=0.1)
    q = np.array([[CUBE + gap, 0.0] for gap in (0.001, 0.02, 0.03, 0.2)])
    np.testing.assert_allclose(collisions.clearance(q), [0.001, 0.02, 0.03, 0.2], atol=2e-6)
    np.testing.assert_array_equal(collisions.collides(q), [True, True, False, False])
    rows, distance, slope = collisions.gradient(q, 0.1, scaled=True)
    np.testing.assert_array_equal(rows, [0, 1])
    np.testing.assert_allclose(distance, [0.004, 0.08], atol=1e-5)
    np.testing.assert_allclose(slope[:, 0], 4.0, atol=1e-4)


def test_distances_agree_with_mujoco(panda, collisions):
    """MuJoCo measures the same distances between the same hulls, and the same depths."""
    hulls = collisions._solids.hulls
    meshes = "".join(
        f'<mesh name="m{i}" vertex="{" ".join(map(str, h.corners.ravel()))}"/>' for i, h in enumerate(hulls)
    )
    bodies = "".join(
        f'<body name="b{i}" mocap="true"><geom name="g{i}" type="mesh" mesh="m{i}"/></body>' for i in range(len(hulls))
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><asset>{meshes}</asset><worldbody>{bodies}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    pairs = collisions._pairs[collisions._pairs[:, 1] >= 0]
    within = 0
    for q in panda.sample(16, 3):
        asked = np.ones((1, len(pairs)), dtype=bool)
        ours = collisions._solids.distances(q[None], pairs, asked)[0] + collisions._solids._skins[pairs].sum(axis=1)
        for i, hull in enumerate(hulls):
            pose = panda.link_poses(q)[hull.joint]
            data.mocap_pos[i] = pose[:3, 3]
            mujoco.mju_mat2Quat(data.mocap_quat[i], pose[:3, :3].ravel())
        mujoco.mj_kinematics(model, data)
        for (a, b), distance in zip(pairs.tolist(), ours, strict=True):
            theirs = mujoco.mj_geomDistance(model, data, a, b, 10.0, np.zeros(6))
            assert theirs == pytest.approx(distance, abs=2e-6)
            within += distance < 0
    assert within > 3


def test_slopes_are_derivatives_of_the_distances(panda, collisions):
    """Central differences of each pair's distance, apart or in one another, are its slope."""
    q, step, solids, pairs = panda.sample(200, 4), 1e-5, collisions._solids, collisions._pairs
    near = solids.maybe_near(q, pairs, 0.05)
    distance, normals, points = solids.distances(q, pairs, near)
    slope = solids.slopes(q, pairs, near, normals, points)
    numeric = np.empty_like(slope)
    for k, way in enumerate(step * np.eye(panda.dof)):
        ahead, behind = (solids.distances(q + sign * way, pairs, near)[0] for sign in (1, -1))
        numeric[:, k] = (ahead - behind) / (2 * step)
    errors = np.abs(slope - numeric).max(axis=1)
    assert len(errors) > 200
    assert np.quantile(errors, 0.98) < 1e-6  # where the nearest corner changes there is no derivative
    rows, kept, slopes = collisions.gradient(q, 0.05)
    inside = distance < 0.05
    np.testing.assert_array_equal(rows, np.nonzero(near)[0][inside])
    np.testing.assert_array_equal(kept, distance[inside])
    np.testing.assert_array_equal(slopes, slope[inside])


def test_the_fast_test_frees_no_posture_that_collides(panda, collisions):
    """Whatever the compiled test takes for apart is apart by the exact distance, whatever the margin."""
    q, pairs, solids = panda.sample(500, 5), collisions._pairs, collisions._solids
    exact = solids.distances(q, pairs, np.ones((len(q), len(pairs)), dtype=bool))[0].reshape(len(q), -1)
    for margin in (0.0, 0.03):
        near = solids.maybe_near(q, pairs, margin)
        assert np.all(exact[~near] > margin)
        assert np.mean(near & (exact > margin + 1e-3)) < 0.01
    np.testing.assert_array_equal(collisions.collides(q), (exact <= 0).any(axis=1))
    np.testing.assert_array_equal(collisions.clearance(q), exact.min(axis=1))


def test_hulls_hold_all_that_is_drawn_and_the_tip(panda, collisions):
    """Every corner of a link lies within the skin of one of its hulls; the hand's reaches to the tip."""
    meshes = dict(panda.geometry.shapes)
    hulls = [hull for hull in collisions._solids.hulls if hull.name in meshes]
    assert {hull.name for hull in hulls} == set(meshes) == {*(f"panda_link{i}" for i in range(8)), "panda_hand"}
    meshes["panda_hand"] = np.array([[*panda.chain.frames["panda_hand_tcp"].placement[:3, 3]]]), None
    for link, (points, _) in meshes.items():
        outside = []
        for hull in (hull for hull in hulls if hull.name == link):
            faces = ConvexHull(hull.corners).equations
            outside.append((points @ faces[:, :3].T + faces[:, 3]).max(axis=1) - hull.skin)
            assert len(hull.corners) <= 96
            assert hull.skin < 2e-3
        assert np.min(outside, axis=0).max() < 1e-6


def test_pairs_are_those_that_no_joint_joins(panda):
    """Every pair of links but neighbors is checked or never meets, and so are the fingers where there is a hand."""
    flange, hand = Collisions.of(load_arm("panda", frame="panda_link8")), Collisions.of(panda)
    links = [f"panda_link{i}" for i in range(8)]
    apart = {(a, b) for i, a in enumerate(links) for b in links[i + 2 :]}
    assert {*flange.pairs, *flange.never} == apart
    assert ("panda_link5", "panda_link7") in flange.pairs
    tools = ("panda_hand", "panda_leftfinger", "panda_rightfinger")
    assert {*hand.pairs, *hand.never} == apart | {
        (link, tool) for i, tool in enumerate(tools) for link in links[: 6 if i == 0 else 7]
    }  # fmt: skip
    assert {("panda_link0", tool) for tool in tools} < set(hand.pairs)
    assert flange.always == hand.always == hand.unchecked == ()


def test_an_arm_without_surface_says_so(tmp_path):
    """Nothing is known to collide, which the object tells; a mesh that is missing is named."""
    bare = Collisions.of(load_arm("myoarm"), table=0.0)
    q = bare.arm.sample(4, 0)
    assert not bare.known
    assert "no shapes" in bare.why
    assert "not known" in repr(bare)
    assert not bare.collides(q).any()
    assert np.all(bare.clearance(q) == np.inf)
    assert len(bare.gradient(q, 1.0)[0]) == 0
    np.testing.assert_array_equal(free_configurations(bare.arm, 8, 0, collisions=bare), bare.arm.sample(8, 0))
    path = write_digger(tmp_path)
    (tmp_path / "boom.stl").unlink()
    assert "boom.stl" in Collisions.of(load_arm(path)).why


def test_collision_shapes_are_checked_where_meshes_are_missing(tmp_path, gantry):
    """Distances are those to the cylinder under <collision>, and a motion is told to be checked with it."""
    drawn = f'<box size="{CUBE} {CUBE} {CUBE}"/>'
    solid = f'<collision><geometry><cylinder radius="0.05" length="{CUBE}"/></geometry></collision>'
    load = _link("load", CUBE).replace(drawn, '<mesh filename="gone.stl"/>').replace("</link>", f"{solid}</link>")
    (tmp_path / "gone.urdf").write_text(GANTRY.replace(_link("load", CUBE), load))
    collisions = Collisions.of(load_arm(tmp_path / "gone.urdf"))
    assert collisions.stand_ins == ("load",)
    assert Collisions.of(gantry).stand_ins == ()
    assert collisions.clearance([[0.5, 0.0, 0.0], [0.0, 0.0, 0.5]]) == pytest.approx([0.35, 0.3], abs=1e-3)
    q = np.linspace([0.5, 0.0, 0.0], [0.4, 0.0, 0.0], 5)
    time = np.linspace(0.0, 1.0, 5)
    motion = SimpleNamespace(time=time, joint_positions=q, control_time=time, control_positions=q)
    clearance = Clearance.of(collisions, motion)
    (warned,) = collision_warnings(clearance, collisions.unchecked)
    assert warned.severity == WARNING
    assert warned.key == "missing-meshes"
    assert clearance.distance == pytest.approx(0.25, abs=1e-3)
