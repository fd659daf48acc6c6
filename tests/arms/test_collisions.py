"""What an arm collides with: distances, their derivatives, and which postures are free."""

import mujoco
import numpy as np
import pytest
from drawn_arms import write_digger
from scipy.spatial import ConvexHull

from maniport.arms import as_group, load_arm, load_arms
from maniport.arms.collisions import Box, Collisions, free_configurations

CUBE = 0.2


def _link(name: str, size: float) -> str:
    return f'<link name="{name}"><visual><geometry><box size="{size} {size} {size}"/></geometry></visual></link>'


def _slide(name: str, parent: str, child: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    )


GANTRY = f"""<robot name="gantry">{_link("base", CUBE)}<link name="beam"/><link name="trolley"/>{_link("load", CUBE)}
  {_slide("x", "base", "beam", "1 0 0")}{_slide("y", "beam", "trolley", "0 1 0")}
  {_slide("z", "trolley", "load", "0 0 1")}</robot>"""
"""A cube that three slides move past another cube of the same size, so that distances are known."""


def between_cubes(offset: np.ndarray) -> np.ndarray:
    """Signed distance of two cubes whose middles are so far apart, shape (..., 3)."""
    gaps = np.abs(offset) - CUBE
    outside = np.linalg.norm(np.maximum(gaps, 0.0), axis=-1)
    return np.where(outside > 0, outside, gaps.max(axis=-1))


@pytest.fixture
def gantry(tmp_path):
    path = tmp_path / "gantry.urdf"
    path.write_text(GANTRY)
    return load_arm(path)


@pytest.fixture(scope="module", params=["panda", "crane", "pandas"])
def checked(request, crane):
    """The Panda with its hand over a table and before a box, two arms on one trunk, or two robots."""
    if request.param == "panda":
        return Collisions.of(
            load_arm("panda"), table=0.0, obstacles=[Box([0.5, 0.1, 0.3], [0.2, 0.3, 0.2], 0.4)]
        )
    pandas = {
        "frames": ("panda_link8", "panda_link8"),
        "bases": ((0, 0.25, 0), (0.1, -0.25, 0, 0.4)),
    }
    return Collisions.of(crane if request.param == "crane" else load_arms("panda", **pandas))


def test_distances_of_cubes_are_those_of_geometry(gantry):
    collisions = Collisions.of(gantry)
    assert collisions.pairs == (("base", "load"),)
    q = gantry.sample(256, 0)
    q[:64] *= 0.15
    expected = between_cubes(q)
    np.testing.assert_allclose(collisions.clearance(q), expected, atol=2e-6)
    np.testing.assert_array_equal(collisions.collides(q), expected <= 0)
    assert 40 < np.sum(expected < 0) < 128


def test_neighbors_need_a_quarter_of_the_clearance(tmp_path):
    third = _slide("z", "trolley", "load", "0 0 1")
    fixed = '<joint name="z" type="fixed"><parent link="trolley"/><child link="load"/></joint>'
    assert third in GANTRY
    (tmp_path / "near.urdf").write_text(GANTRY.replace(third, fixed))
    collisions = Collisions.of(load_arm(tmp_path / "near.urdf"))
    q = np.array([[CUBE + gap, 0.0] for gap in (0.001, 0.02, 0.03, 0.2)])
    np.testing.assert_allclose(collisions.clearance(q), [0.001, 0.02, 0.03, 0.2], atol=2e-6)
    rows, distance, slope = collisions.gradient(q, 0.1, scaled=True)
    np.testing.assert_array_equal(rows, [0, 1])
    np.testing.assert_allclose(distance, [0.004, 0.08], atol=1e-5)
    np.testing.assert_allclose(slope[:, 0], 4.0, atol=1e-4)


def test_distances_are_those_of_mujoco_and_depths_those_of_qhull(checked):
    group = as_group(checked.arm)
    solids = checked._solids
    hulls = solids.hulls
    meshes = "".join(
        f'<mesh name="m{i}" vertex="{" ".join(map(str, h.corners.ravel()))}"/>'
        for i, h in enumerate(hulls)
    )
    bodies = "".join(
        f'<body name="b{i}" mocap="true"><geom name="g{i}" type="mesh" mesh="m{i}"/></body>'
        for i in range(len(hulls))
    )
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{meshes}</asset><worldbody>{bodies}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    pairs = checked._pairs[checked._pairs[:, 1] >= 0]
    deep = 0
    for q in checked.arm.sample(16, 3):
        turns, origins = (part[0] for part in group.kinematics.link_poses(q[None]))
        for i, hull in enumerate(hulls):
            data.mocap_pos[i] = origins[hull.joint]
            mujoco.mju_mat2Quat(data.mocap_quat[i], turns[hull.joint].ravel())
        mujoco.mj_kinematics(model, data)
        ours = solids.contacts(q[None], pairs).distances
        theirs = [
            mujoco.mj_geomDistance(model, data, a, b, 10.0, np.zeros(6)) for a, b in pairs.tolist()
        ]
        ours += solids._skins[pairs].sum(axis=1)
        for distance, reference, pair in zip(ours, theirs, pairs, strict=True):
            if (
                distance < 0
            ):  # MuJoCo measures some too small; hulls leave one another through a face of this one
                corners = [
                    hulls[i].corners @ turns[hulls[i].joint].T + origins[hulls[i].joint]
                    for i in pair
                ]
                reference = (
                    ConvexHull((corners[0][:, None] - corners[1]).reshape(-1, 3))
                    .equations[:, 3]
                    .max()
                )
                deep += 1
            assert distance == pytest.approx(reference, abs=2e-6)
    assert deep > 3


def test_slopes_are_derivatives_of_the_distances(checked):
    q = checked.arm.sample(400, 4)
    step = 1e-5
    rows, distance, slope = checked.gradient(q, 0.05)
    order = np.lexsort((distance, rows))
    close, first = np.unique(rows[order], return_index=True)
    clearance = checked.clearance(q)
    np.testing.assert_array_equal(close, np.flatnonzero(clearance < 0.05))
    np.testing.assert_array_equal(distance[order][first], clearance[close])
    numeric = [
        (checked.clearance(q[close] + h) - checked.clearance(q[close] - h)) / (2 * step)
        for h in step * np.eye(checked.arm.dof)
    ]
    errors = np.abs(slope[order][first] - np.stack(numeric, axis=1)).max(axis=1)
    assert len(errors) > 30
    # where the nearest corner changes there is no derivative; faces of boxes are often parallel
    assert np.quantile(errors, 0.9 if checked.arm.name == "crane" else 0.98) < 1e-6


def test_the_fast_test_frees_no_configuration_that_collides(checked):
    q = checked.arm.sample(300, 5)
    pairs = checked._pairs
    solids = checked._solids
    exact = solids.contacts(q, pairs).distances.reshape(len(q), -1)
    for margin in (0.0, 0.03):
        near = solids.distance_bounds(q, pairs, margin) <= margin
        assert np.all(exact[~near] > margin)
        assert np.mean(near & (exact > margin + 1e-3)) < 0.01
    np.testing.assert_array_equal(checked.collides(q), (exact <= 0).any(axis=1))
    np.testing.assert_array_equal(checked.clearance(q), exact.min(axis=1))


@pytest.mark.parametrize("checked", ["crane", "pandas"], indirect=True)
def test_a_group_has_the_pairs_of_its_arms_and_those_between(checked):
    q = checked.arm.sample(256, 3)
    alone = np.min(
        [own.clearance(x) for own, x in zip(checked.of_arms, checked.arm.split(q), strict=True)],
        axis=0,
    )
    nearest = checked.nearest(q)
    assert np.all(nearest.distance <= alone + 1e-9)
    between = nearest.distance < alone - 1e-9
    assert 0.01 < between.mean() < 0.9
    sides = np.char.startswith(nearest.first, "left") != np.char.startswith(nearest.second, "left")
    assert np.all(sides[between])
    assert len(set(checked.pairs)) == len(checked.pairs)
    assert ("trunk", "right_link3") in checked.pairs or checked.arm.shared == ()


def outside(hulls, points):
    """Largest distance of points beyond the hull, enlarged by its skin, that is nearest to each."""
    beyond = []
    for hull in hulls:
        faces = ConvexHull(hull.corners).equations
        beyond.append((points @ faces[:, :3].T + faces[:, 3]).max(axis=1) - hull.skin)
    return np.min(beyond, axis=0).max()


def test_hulls_hold_all_collision_shapes():
    panda = load_arm("panda")
    hulls = Collisions.of(panda)._solids.hulls
    links = {*(f"panda_link{i}" for i in range(8)), "panda_hand"}
    assert {hull.name for hull in hulls} == links | {"panda_leftfinger", "panda_rightfinger"}
    for shape in panda.geometry.checked.shapes:
        if shape.link in links:
            assert shape.collision
            own = [hull for hull in hulls if hull.name == shape.link]
            place = panda.chain.frames[shape.link].placement
            points = shape.mesh[0] @ place[:3, :3].T + place[:3, 3]
            assert outside(own, points) < 1e-6
            assert all(len(hull.corners) <= 96 and hull.skin < 2e-3 for hull in own)


def test_the_hull_of_visual_shapes_holds_the_end_effector(tmp_path):
    tool = (
        '<link name="tool"/><joint name="t" type="fixed"><parent link="load"/><child link="tool"/>'
    )
    text = GANTRY.replace("</robot>", f'{tool}<origin xyz="0 0 -0.5"/></joint></robot>')
    for kind, reach in (("visual", -0.5), ("collision", -CUBE / 2)):
        (tmp_path / "tool.urdf").write_text(text.replace("visual", kind))
        arm = load_arm(tmp_path / "tool.urdf", frame="tool")
        (hull,) = [hull for hull in Collisions.of(arm)._solids.hulls if hull.name == "load"]
        assert hull.corners[:, 2].min() == pytest.approx(reach)


def test_pairs_are_those_that_no_joint_joins():
    flange, hand = (
        Collisions.of(load_arm("panda", frame=frame)) for frame in ("panda_link8", "panda_hand_tcp")
    )
    links = [f"panda_link{i}" for i in range(8)]
    apart = {(a, b) for i, a in enumerate(links) for b in links[i + 2 :]}
    assert {*flange.pairs, *flange.never} == apart
    assert ("panda_link5", "panda_link7") in flange.pairs
    tools = ("panda_hand", "panda_leftfinger", "panda_rightfinger")
    assert {*hand.pairs, *hand.never} == apart | {
        (link, tool) for i, tool in enumerate(tools) for link in links[: 6 if i == 0 else 7]
    }
    assert {("panda_link0", tool) for tool in tools} < set(hand.pairs)
    assert flange.always == hand.always == hand.unchecked == ()


def test_an_arm_without_surface_says_so(tmp_path):
    bare = Collisions.of(load_arm("myoarm"), table=0.0)
    q = bare.arm.sample(4, 0)
    assert not bare.checked
    assert "no shapes" in bare.reason
    assert "not checked" in repr(bare)
    assert not bare.collides(q).any()
    assert np.all(bare.clearance(q) == np.inf)
    assert len(bare.gradient(q, 1.0)[0]) == 0
    np.testing.assert_array_equal(
        free_configurations(bare.arm, 8, 0, collisions=bare), bare.arm.sample(8, 0)
    )
    path = tmp_path / "gone.urdf"
    path.write_text(
        GANTRY.replace(f'<box size="{CUBE} {CUBE} {CUBE}"/>', '<mesh filename="gone.stl"/>')
    )
    gone = Collisions.of(load_arm(path))
    assert not gone.checked
    assert "gone.stl" in gone.reason


def test_a_missing_mesh_leaves_the_rest_checked(tmp_path):
    path = write_digger(tmp_path)
    whole = Collisions.of(load_arm(path))
    (tmp_path / "boom.stl").unlink()
    collisions = Collisions.of(load_arm(path))
    assert collisions.checked
    assert collisions.unchecked == ("boom",)
    assert "boom.stl" in collisions.shapes.missing["boom"]
    assert ("base", "tooth") in collisions.pairs
    assert set(collisions.pairs) < set(whole.pairs)
    q = whole.arm.sample(64, 0)
    assert np.all(collisions.clearance(q) >= whole.clearance(q) - 1e-9)


def test_collision_shapes_are_checked_where_meshes_are_missing(tmp_path, gantry):
    solid = f'<collision><geometry><cylinder radius="0.05" length="{CUBE}"/></geometry></collision>'
    load = f'<link name="load"><visual><geometry><mesh filename="gone.stl"/></geometry></visual>{solid}</link>'
    (tmp_path / "gone.urdf").write_text(GANTRY.replace(_link("load", CUBE), load))
    collisions = Collisions.of(load_arm(tmp_path / "gone.urdf"))
    assert collisions.stand_ins == ("load",)
    assert Collisions.of(gantry).stand_ins == ()
    assert collisions.clearance([[0.5, 0.0, 0.0], [0.0, 0.0, 0.5]]) == pytest.approx(
        [0.35, 0.3], abs=1e-3
    )
