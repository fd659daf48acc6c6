"""A body and its ellipsoids: human and robot arms, their kinematics, limits and manipulability."""

from maniport.bodies.arm import Arm
from maniport.bodies.human import myoarm, rhuman
from maniport.bodies.robot import load_arm
from maniport.bodies.spec import VELOCITY, EllipsoidSpec
from maniport.bodies.surface import Surface

__all__ = ["VELOCITY", "Arm", "EllipsoidSpec", "Surface", "load_arm", "myoarm", "rhuman"]
