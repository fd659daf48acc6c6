"""A body and its ellipsoids: human and robot arms, their kinematics, limits and manipulability."""

from maniport.arms.arm import Arm
from maniport.arms.arms import Arms
from maniport.arms.human import PERSONS, myoarm, rhuman
from maniport.arms.looks import Look, Surface
from maniport.arms.manipulability import VELOCITY, EllipsoidSpec
from maniport.arms.readers import READERS, load_arm
from maniport.arms.readers.pairs import load_arms

__all__ = [
    "PERSONS", "READERS", "VELOCITY", "Arm", "Arms", "EllipsoidSpec", "Look", "Surface", "load_arm", "load_arms",
    "myoarm", "rhuman",
]  # fmt: skip
