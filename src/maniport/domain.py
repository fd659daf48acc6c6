"""The set of ellipsoids that a body can make, sampled."""

from typing import Any

import numpy as np

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec
from maniport.util.validation import Array


def sample_domain(
    arm: Arm | ArmGroup,
    n: int,
    random_state: Any = None,
    sequence: str = "sobol",
    spec: EllipsoidSpec = VELOCITY,
    collisions: Any = None,
) -> Array:
    """Sample the manipulability domain of an arm: its ellipsoids at joint samples within the limits.

    Parameters
    ----------
    arm : Arm or ArmGroup
        All arms of a group are sampled at the same configurations of all its joints.
    n : int
        Number of ellipsoids. 4096 for a teacher and 16384 for a student suffice for an arm of seven joints; powers of
        two keep a Sobol sequence balanced.
    random_state : None, int or numpy.random.Generator
        Same seed, same samples.
    sequence : {"sobol", "uniform"}
        Scrambled Sobol points fill the joint space evenly: the mean of the domain of the Panda's flange spreads 1.4,
        2.6 and 3.9 times less over draws of n = 512, 2048 and 4096 than with independent uniform ones.
    spec : EllipsoidSpec
        Which ellipsoids.
    collisions : maniport.arms.collisions.Collisions or True, optional
        Colliding configurations are left out, and the sequence is continued until n are free. True: self-collisions,
        in 3.1 % of the Panda's configurations to its flange and 7.4 % to ``panda_hand_tcp``. An arm without shapes is
        sampled without collisions.

    Returns
    -------
    ndarray, shape (n, d, d), or (n_arms, n, d, d) of a group
        Positive semidefinite; d = 3, or 6 for ``part="full"``.
    """
    if collisions is None:
        q = arm.sample(n, random_state, sequence)
    else:
        from maniport.arms.collisions import free_configurations  # here: Numba takes its time

        q = free_configurations(arm, n, random_state, sequence, collisions)
    ellipsoids: Array = arm.ellipsoids(q, spec)
    return np.moveaxis(ellipsoids, 1, 0) if isinstance(arm, ArmGroup) else ellipsoids
