"""A body and its ellipsoids: human and robot arms, their kinematics, limits and manipulability."""

from maniport.bodies.arm import Arm
from maniport.bodies.human import myoarm, rhuman
from maniport.bodies.robot import load_arm

__all__ = ["Arm", "load_arm", "myoarm", "rhuman"]
