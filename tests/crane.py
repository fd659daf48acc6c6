"""Small robots: a crane with an eye next to its hook, and two arms on a trunk."""

from dataclasses import replace

import numpy as np

from maniport.arms import Arm, ArmGroup
from maniport.arms.chain import Frame, Joint, Shape, pose
from maniport.arms.meshes import solid

CRANE = """<robot name="crane"><link name="base"/><link name="post"/><link name="lift"/><link name="hook"/>
  <link name="eye"/>
  <joint name="turn" type="continuous"><parent link="base"/><child link="post"/><axis xyz="0 0 1"/></joint>
  <joint name="up" type="prismatic"><parent link="post"/><child link="lift"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.5" effort="1" velocity="0.2"/></joint>
  <joint name="nod" type="revolute"><parent link="lift"/><child link="hook"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="look" type="revolute"><parent link="post"/><child link="eye"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>
"""


def limb(side: str) -> Arm:
    """One arm of the crane: four joints and a box on each, on a trunk that turns and rises on a base."""
    sign = 1.0 if side == "left" else -1.0
    axes = np.eye(3)[[2, 2, 2, 1, 2, 1]]
    places = [(0, 0, 0.2), (0, 0, 0.3), (0.05, sign * 0.2, 0.1)]
    places += [(0, sign * 0.1, 0), (0.25, 0, 0), (0.2, 0, 0.0)]
    names = ("turn", "rise", *(f"{side}_{i}" for i in range(1, 5)))
    joints = [
        Joint(name, "prismatic" if name == "rise" else "revolute", axis, pose(place))
        for name, axis, place in zip(names, axes, places, strict=True)
    ]
    frames = {"base": Frame(0, np.eye(4)), "trunk": Frame(2, np.eye(4))}
    frames |= {f"{side}_link{i}": Frame(2 + i, np.eye(4)) for i in range(1, 5)}
    sizes = {"base": (0.3, 0.3, 0.1), "trunk": (0.15, 0.2, 0.3)}

    def shapes(links):
        return [Shape(link, solid("box", *sizes.get(link, (0.15, 0.06, 0.06)))) for link in links]

    chain = Arm.from_dh(
        "crane", np.zeros((6, 4)), [-2.0, 0, -2, -2, -2, -2], [2.0, 0.3, 2, 2, 2, 2]
    ).chain
    ends = {"frame": f"{side}_link4", "coordinates": names}
    return Arm(replace(chain, joints=tuple(joints), frames=frames, shapes=shapes, **ends))


def two_arms() -> ArmGroup:
    """Return two arms with four joints each on a trunk that turns and rises."""
    return ArmGroup(limb("left"), limb("right"), names=("left", "right"))
