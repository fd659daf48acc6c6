"""Human arm that cannot be raised above 70°."""

from dataclasses import replace

import numpy as np

from maniport.arms import PERSONS, Arm, myoarm


def stiff_shoulder(upper_arm=None, forearm=None, hand=None):
    """Return MyoArm of segment lengths [m], with another limit of elevation."""
    chain = myoarm(upper_arm, forearm, hand).chain
    highest = np.where(np.array(chain.coordinates) == "shoulder_elv", np.radians(70.0), chain.upper)
    return Arm(replace(chain, name="stiff_shoulder", upper=highest))


PERSONS["stiff_shoulder"] = stiff_shoulder
