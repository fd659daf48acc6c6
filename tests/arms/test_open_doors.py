"""ArmGroup from outside: a new source of robots and a new model of a person are one entry of a table each."""

from dataclasses import replace

import numpy as np
import pytest

from maniport.arms import PERSONS, READERS, Arm, load_arm, rhuman
from maniport.arms.chain import Shape
from maniport.errors import FileFormatError, UnknownNameError


def read_reach(path, frame, joints):
    """A format of our own: the lengths of a planar arm's links, one a line, each drawn as one triangle."""
    lengths = [float(line) for line in path.read_text().split()]
    chain = Arm.from_dh(path.stem, [[0, 0, length, 0] for length in lengths], -3, 3).chain
    corners = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]])
    shapes = lambda links: [Shape(link, (corners, np.array([[0, 1, 2]], dtype=np.int32))) for link in links]  # noqa: E731
    return replace(chain, shapes=shapes)


def test_a_robot_format_from_outside_is_one_entry(tmp_path, monkeypatch):
    """`load_arm` takes it with frame, joints and surfaces, and names its suffix where a file has none of them."""
    monkeypatch.setitem(READERS, ".reach", read_reach)
    (tmp_path / "three.reach").write_text("0.3\n0.2\n0.1\n")
    arm = load_arm(tmp_path / "three.reach")
    assert arm.dof == 3
    assert [surface.joint for surface in arm.surfaces()] == [0, 1, 2, 3]
    assert load_arm(str(tmp_path / "three.reach"), frame="link2", joints=["joint2"]).joint_names == ("joint2",)
    with pytest.raises(FileFormatError, match=r"there is no such file; there are 'three\.reach'"):
        load_arm(tmp_path / "tree.reach")
    with pytest.raises(UnknownNameError, match=r"must end in \.urdf, \.xml, \.mjcf.*, \.reach"):
        load_arm("nobody")


def test_a_person_from_outside_is_one_entry(monkeypatch):
    """`load_arm` takes the model by its name, and an unknown name lists it."""
    monkeypatch.setitem(PERSONS, "giant", lambda *lengths, **named: rhuman(0.5, 0.45, 0.09))
    assert load_arm("giant").skeleton(np.zeros(7)).shape == load_arm("rhuman").skeleton(np.zeros(7)).shape
    with pytest.raises(UnknownNameError, match="'giant'"):
        load_arm("gigant")
