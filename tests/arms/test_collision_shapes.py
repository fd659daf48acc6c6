"""Which shapes of a description are checked for collisions."""

from pathlib import Path

import numpy as np
import pytest
from mjcf_robots import FLOOR, ROBOTS, serial

from fuzz.mesh_examples import stl
from maniport.arms import load_arm
from maniport.arms.collisions import Collisions, hulls

CASES = Path(__file__).parent / "cases"


def test_bits_that_exclude_every_contact_are_reported(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(
        serial(["first bit", "first bit", "first bit"]).replace(
            'size=".05"/>', 'size=".05" contype="4" conaffinity="4"/>'
        )
    )
    arm = load_arm(path, frame="b3")
    collisions = Collisions.of(arm)
    assert collisions.pairs == ()
    assert {"base", "b1", "b3"} <= set(collisions.unchecked)
    assert ("b1", "b3") in collisions.excluded
    table = Collisions.of(arm, table=-0.06)
    assert ("table", "b3") in table.pairs
    assert "b3" in table.unchecked


def test_a_plane_is_no_base_and_not_drawn(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(ROBOTS["floor"])
    arm = load_arm(path, frame="b4")
    assert max(np.abs(surface.points).max() for surface in arm.surfaces()) < 1.0
    assert ("world", "b4") in Collisions.of(arm, table=-0.2).pairs
    bare = (
        serial(["several"], world=FLOOR)
        .replace("<geom ", "<site ")
        .replace('<site type="plane"', '<geom type="plane"')
    )
    path.write_text(
        bare.replace("<default><site", "<default><geom").replace(
            '"><site contype', '"><geom contype'
        )
    )
    assert not Collisions.of(load_arm(path)).checked


LINK = '<link name="{}">{}</link>'
VISUAL = '<visual><geometry><box size="0.02 0.02 0.02"/></geometry></visual>'
COLLISION = '<collision><origin xyz="0 0 {}"/><geometry>{}</geometry></collision>'
BOX = '<box size="0.2 0.2 0.2"/>'


def sliding(base, load):
    """A load that slides along x from −1 m to 1 m past a base, with a link between them."""
    links = LINK.format("base", base) + LINK.format("rail", "") + LINK.format("load", load)
    joints = ""
    for parent, child in (("base", "rail"), ("rail", "load")):
        joints += (
            f'<joint name="{child}" type="prismatic"><parent link="{parent}"/><child link="{child}"/>'
            '<axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        )
    return f'<robot name="s">{links}{joints}</robot>'


def checked(tmp_path, base, load, **options):
    path = tmp_path / "s.urdf"
    path.write_text(sliding(base, load))
    return Collisions.of(load_arm(path, **options))


def test_each_body_has_its_collision_shapes_or_else_its_visual_shapes(tmp_path):
    boxes = checked(tmp_path, VISUAL + COLLISION.format(0, BOX), VISUAL)
    assert boxes.shapes.collision == ("base",)
    assert boxes.shapes.visual == ("load",)
    assert boxes.clearance([0.5, 0.0]) == pytest.approx(0.5 - 0.11, abs=1e-6)
    assert boxes.unchecked == boxes.stand_ins == ()


SOLIDS = {
    '<sphere radius="0.1"/>': 0.1,
    '<box size="0.2 1 1"/>': 0.1,
    '<cylinder radius="0.1" length="0.4"/>': 0.1,
    '<capsule radius="0.1" length="0.4"/>': 0.1,
}


@pytest.mark.parametrize("solid", SOLIDS)
def test_solids_are_exact(tmp_path, solid):
    collisions = checked(tmp_path, COLLISION.format(0, solid), COLLISION.format(0.05, solid))
    expected = 0.6 - 2 * SOLIDS[solid]
    if "sphere" in solid:
        expected = np.hypot(0.6, 0.05) - 0.2
    assert collisions.clearance([0.6, 0.0]) == pytest.approx(expected, abs=5e-4)


def test_several_collision_shapes_are_not_joined(tmp_path):
    two = COLLISION.format(0.5, BOX) + COLLISION.format(-0.5, BOX)
    assert not checked(tmp_path, two, COLLISION.format(0, BOX)).collides([0.0, 0.0])
    assert checked(tmp_path, two, COLLISION.format(0.35, BOX)).collides([0.0, 0.0])


def test_the_drawing_has_visual_shapes(tmp_path):
    path = tmp_path / "s.urdf"
    path.write_text(sliding(VISUAL + COLLISION.format(0, BOX), COLLISION.format(0, BOX)))
    surfaces = load_arm(path).surfaces()
    assert [np.ptp(surface.points) for surface in surfaces] == pytest.approx([0.02, 0.2])


FAULTY = {
    "missing": '<mesh filename="gone.stl"/>',
    "forbidden": '<mesh filename="../../../secret.stl"/>',
    "damaged": '<mesh filename="damaged.stl"/>',
    "unknown format": '<mesh filename="part.step"/>',
    "senseless": '<box size="1 2"/>',
}


@pytest.mark.parametrize("fault", FAULTY)
def test_a_faulty_shape_leaves_the_rest_checked(tmp_path, fault):
    folder = tmp_path / "a" / "b" / "c"
    folder.mkdir(parents=True)
    (tmp_path / "secret.stl").write_bytes(stl())
    (folder / "damaged.stl").write_bytes(stl()[:100])
    (folder / "part.step").write_bytes(b"ISO-10303-21;")
    bad = COLLISION.format(0, FAULTY[fault])
    good = COLLISION.format(0, BOX)

    replaced = checked(folder, good, VISUAL + bad)
    assert replaced.shapes.visual == ("load",)
    assert list(replaced.shapes.replaced) == ["load"]
    assert replaced.clearance([0.5, 0.0]) == pytest.approx(0.5 - 0.11, abs=1e-6)

    partial = checked(folder, good, good + bad)
    assert partial.unchecked == ("load",)
    assert partial.shapes.missing["load"]
    assert partial.clearance([0.5, 0.0]) == pytest.approx(0.3, abs=1e-6)

    without = checked(folder, good + bad, bad)
    assert without.checked
    assert set(without.unchecked) == {"base", "load"}


def test_a_mesh_inside_another_is_found(tmp_path):
    """A small box within a large one touches no surface of it."""
    small = COLLISION.format(0, '<box size="0.02 0.02 0.02"/>')
    large = COLLISION.format(0, '<box size="1 1 1"/>')
    collisions = checked(tmp_path, large, small)
    assert collisions.collides([0.1, 0.0])
    assert not collisions.collides([0.9, 0.0])


@pytest.mark.parametrize("name", ["mirror", "zup_mm", "yup_m"])
def test_units_and_mirror_images_of_meshes(name):
    arm = load_arm(CASES / "mesh_units" / f"{name}.urdf")
    (surface,) = arm.surfaces()
    np.testing.assert_allclose(np.ptp(surface.points, axis=0), [0.1, 0.2, 0.1], atol=1e-6)
    if name == "mirror":
        assert surface.points[:, 1].max() == pytest.approx(0.0, abs=1e-9)


def test_meshes_of_a_package_beside_are_found():
    arm = load_arm(CASES / "sibling_mesh" / "arm_description" / "urdf" / "arm.urdf")
    assert len(arm.surfaces()) > 0
    assert Collisions.of(arm).shapes.missing == {}


def test_many_geoms_are_checked_by_fewer_hulls(tmp_path, monkeypatch):
    """A robot with more solids than are practical is still checked, and never less strictly."""
    geoms = "".join(f'<geom size=".01" pos="0 0 {0.003 * i:.3f}"/>' for i in range(30))
    path = tmp_path / "robot.xml"
    path.write_text(serial(["box", "box", "box"]).replace('<body name="weld3"/>', geoms))
    exact = Collisions.of(load_arm(path, frame="b3"))
    monkeypatch.setattr(hulls, "MOST_SOLIDS", 20)
    coarse = Collisions.of(load_arm(path, frame="b3"))
    assert len(exact._solids.hulls) == 34
    assert len(coarse._solids.hulls) < 10
    q = exact.arm.sample(100, 0)
    assert np.all(coarse.collides(q)[exact.collides(q)])
