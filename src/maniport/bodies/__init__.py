"""A body and its ellipsoids: human and robot arms, their kinematics, limits and manipulability."""

from maniport.bodies.arm import Arm
from maniport.bodies.human import PERSONS, myoarm, rhuman
from maniport.bodies.looks import Look, Surface
from maniport.bodies.readers import READERS, load_arm
from maniport.bodies.spec import VELOCITY, EllipsoidSpec

__all__ = ["PERSONS", "READERS", "VELOCITY", "Arm", "EllipsoidSpec", "Look", "Surface", "load_arm", "myoarm", "rhuman"]
