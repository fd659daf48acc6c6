"""What faulty tables, obstacles and SRDFs get, and what good ones change."""

import numpy as np
import pytest
from drawn_arms import one_link

from maniport.arms import load_arms
from maniport.arms.collisions import Box, Collisions, read_boxes
from maniport.errors import FileFormatError, InvalidInputError

PLINTH = Box((-0.1, 0, 0.05), (0.2,) * 3, name="plinth")
WRONG = [
    (
        {"table": 0.05},
        r"table: the plane at z = 0\.05 m goes through the robot's base .* at most 0\.010 m",
    ),
    ({"table": 3.0}, "lies above it: 'panda_link0' reaches from z = 0.000 to 0.140 m"),
    (
        {"obstacles": [Box((0, 0, 0), (4, 4, 4))]},
        r"'box' intersects the robot's base: 'panda_link0' is 2\.\d+ m",
    ),
    ({"obstacles": [PLINTH]}, "'plinth' intersects the robot's base"),
    ({"obstacles": [Box((0, 0, 0.35), (0.2, 0.2, 0.2))]}, "'box' touches 'panda_link1' in all"),
    (
        {"obstacles": [[1, 2, 3]]},
        r"obstacles must be a file or a sequence of Box; found \[\[1, 2, 3\]\]",
    ),
]


@pytest.mark.parametrize(("around", "message"), WRONG)
def test_what_cannot_be_around_a_robot_is_named(panda, around, message):
    with pytest.raises(InvalidInputError, match=message):
        Collisions.of(panda, **around)


def test_bases_and_tables_that_leave_no_room_are_refused(tmp_path):
    arms = load_arms("panda", bases=((0, 0.05, 0), (0, -0.05, 0)))
    with pytest.raises(
        InvalidInputError,
        match=r"^bases.*'left_panda_link0'.*'right_panda_link0'",
    ):
        Collisions.of(arms)
    with pytest.raises(InvalidInputError, match=r"^table.*'tip'"):
        Collisions.of(one_link(tmp_path, '<sphere radius="0.1"/>'), table=1.0)


def test_boxes_from_a_file_are_those_of_objects(panda, tmp_path):
    path = tmp_path / "obstacles.yaml"
    path.write_text(
        "obstacles:\n  shelf: {center: [0.5, 0.2, 0.4], size: [0.3, 0.6, 0.02]}\n"
        "  crate: {center: [0.4, -0.4, 0.1], size: [0.2, 0.3, 1e-1], yaw: 0.5}\n"
    )
    boxes = [Box([0.5, 0.2, 0.4], [0.3, 0.6, 0.02]), Box([0.4, -0.4, 0.1], [0.2, 0.3, 0.1], 0.5)]
    q = panda.sample(128, 0)
    nearest = Collisions.of(panda, obstacles=path).nearest(q)
    assert {"shelf", "crate"} < set(nearest.first)
    for obstacles in (read_boxes(path), boxes):
        np.testing.assert_array_equal(
            Collisions.of(panda, obstacles=obstacles).clearance(q), nearest.distance
        )


FAULTY_BOXES = {
    "box: {}": r"b\.yaml: unknown key 'box'; allowed are, nearest first: obstacles",
    "obstacles: [1]": "obstacles must be a mapping of names to obstacles",
    "obstacles: {a: 3}": "obstacles: a must be a mapping with the keys center, size, yaw; found int",
    "obstacles: {a: {center: [0, 0, 1]}}": "obstacles: a: a box has center, size and optional yaw; found center",
    "obstacles: {a: {centre: [0, 0, 1]}}": "obstacles: a: unknown key 'centre'; .*: center",
    "obstacles: {a: {center: [0, 1, x], size: [1, 1, 1]}}": "obstacles: a: center must be an array of numbers",
    "obstacles: {a: {center: [0, 1, 1], size: [1, -1, 1]}}": "obstacles: a: size must be 3 numbers above 0; found -1",
}


@pytest.mark.parametrize("text", FAULTY_BOXES)
def test_faulty_files_of_boxes(tmp_path, text):
    path = tmp_path / "b.yaml"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=FAULTY_BOXES[text]):
        read_boxes(path)


PAIR = '<disable_collisions link1="{}" link2="{}" reason="Never"/>'


def test_an_srdf_says_which_pairs_are_left_out(panda, tmp_path):
    path = tmp_path / "panda.srdf"
    neighbors = [PAIR.format(f"panda_link{i}", f"panda_link{i + 1}") for i in range(7)]
    path.write_text(
        f'<robot name="p">{"".join(neighbors)}{PAIR.format("panda_link5", "panda_link7")}</robot>'
    )
    collisions = Collisions.of(panda, srdf=path)
    named = {*collisions.pairs, *collisions.always, *collisions.never}
    assert len(named) == 8 * 7 // 2 - 8
    assert ("panda_link5", "panda_link7") not in named
    assert {*Collisions.of(panda).pairs} - {*collisions.pairs} == {("panda_link5", "panda_link7")}


FAULTY_SRDFS = {
    f"<robot name='x'>{PAIR.format('a', 'b')}</robot>": "does not fit 'panda': it names a, b",
    "<robot name='x'/>": "has no <disable_collisions>",
    "<robot name='x'><link name='a'/></robot>": "no SRDF.* this is a URDF",
    "<mujoco/>": "no SRDF.* its root is <mujoco>",
    "<robot><disable_collisions link1='a'/></robot>": "number 1 must name link1 and link2",
    "<robot>": "not readable as XML",
}


@pytest.mark.parametrize("text", FAULTY_SRDFS)
def test_faulty_srdfs(panda, tmp_path, text):
    path = tmp_path / "r.srdf"
    path.write_text(text)
    with pytest.raises((FileFormatError, InvalidInputError), match=FAULTY_SRDFS[text]):
        Collisions.of(panda, srdf=path)
