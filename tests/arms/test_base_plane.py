"""Whether the base of an arm stands on its plane z = 0, where a floor may be."""

from itertools import pairwise

import pytest

import maniport as mp

LEG = '<joint name="leg" type="{kind}"><parent link="root"/><child link="foot"/><origin xyz="0 0 {z}"/>{rest}</joint>'
LIMIT = '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="2"/>'


def description(leg="", mount="0 0 0.4", turn="0 0 0"):
    """A robot with a torso on a waist joint, an arm of three joints and perhaps a leg."""
    links = "".join(
        f'<link name="{name}"/>' for name in ("root", "mount", "torso", "a", "b", "hand")
    )
    foot = '<link name="foot"/>' if leg else ""
    joints = (
        '<joint name="fix" type="fixed"><parent link="root"/><child link="mount"/>'
        f'<origin xyz="{mount}" rpy="{turn}"/></joint>'
    )
    for number, (parent, child) in enumerate(pairwise(["mount", "torso", "a", "b", "hand"])):
        joints += (
            f'<joint name="j{number}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0 0 0.2"/>{LIMIT}</joint>'
        )
    return f'<robot name="r">{links}{foot}{joints}{leg}</robot>'


@pytest.mark.parametrize(
    ("text", "base", "stands"),
    [
        (description(), None, True),
        (description(), "root", True),
        (description(), "mount", False),  # fixed to the root, above it
        (description(mount="0.3 0 0"), "mount", True),  # beside it, in its plane
        (description(mount="0.3 0 0", turn="1.57 0 0"), "mount", False),
        (description(), "torso", False),
        (description(), "a", False),
        (description(LEG.format(kind="fixed", z=-0.8, rest="")), None, False),
        (description(LEG.format(kind="revolute", z=-0.8, rest=LIMIT)), None, False),
        (description(LEG.format(kind="revolute", z=0.1, rest=LIMIT)), None, True),
    ],
    ids=[
        "root",
        "root-named",
        "above",
        "beside",
        "turned",
        "torso",
        "arm",
        "pedestal",
        "leg",
        "arms",
    ],
)
def test_the_base_stands_on_its_plane_at_the_root_of_the_description(tmp_path, text, base, stands):
    (tmp_path / "robot.urdf").write_text(text)
    arm = mp.load_arm(tmp_path / "robot.urdf", "hand", base=base)
    assert arm.chain.stands == stands


def test_bases_in_a_world_stand_on_its_plane():
    arms = mp.load_arms("panda", bases=[(0.0, 0.3, 0.7), (0.0, -0.3, 0.7)])
    assert [arm.chain.stands for arm in arms.arms] == [True, True]
    assert not mp.load_arm("rhuman").chain.stands
