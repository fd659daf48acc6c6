"""A body and its ellipsoids: human and robot arms, their kinematics, limits and manipulability."""

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.human import PERSONS, myoarm, rhuman
from maniport.bodies.looks import Look, Surface
from maniport.bodies.manipulability import VELOCITY, EllipsoidSpec
from maniport.bodies.readers import READERS, load_arm
from maniport.bodies.readers.pairs import load_arms

__all__ = [
    "PERSONS", "READERS", "VELOCITY", "Arm", "Arms", "EllipsoidSpec", "Look", "Surface", "load_arm", "load_arms",
    "myoarm", "rhuman",
]  # fmt: skip
