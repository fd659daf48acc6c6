"""A body and its ellipsoids: human and robot arms, their kinematics, limits and manipulability."""

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup, as_group
from maniport.arms.human import PERSONS, myoarm, rhuman
from maniport.arms.loaders import READERS, load_arm, load_arms
from maniport.arms.manipulability import VELOCITY, EllipsoidSpec
from maniport.arms.meshes import Geometry, Surface

__all__ = [
    "PERSONS",
    "READERS",
    "VELOCITY",
    "Arm",
    "ArmGroup",
    "EllipsoidSpec",
    "Geometry",
    "Surface",
    "as_group",
    "load_arm",
    "load_arms",
    "myoarm",
    "rhuman",
]
