"""Problems of an arm with given targets, for tests of costs, searches and plans."""

import numpy as np

from maniport.arms import VELOCITY
from maniport.motion.problem import ArmProblem, CostWeights
from maniport.motion.targets import TargetTrajectory, damping_of
from maniport.util.defaults import DAMPING


def arm_problem(
    arm, ellipsoids, positions=None, *, spec=VELOCITY, damping=DAMPING, weights=None, **targets
):
    """Return the problem of an arm with target ellipsoids (n, d, d); `targets` are optional ones by name."""
    target = TargetTrajectory(
        time=np.arange(float(len(ellipsoids))),
        ellipsoids=ellipsoids,
        spec=spec,
        damping=damping_of(arm, spec, damping),
        positions=positions,
        **targets,
    )
    return ArmProblem.of(arm, target, weights or CostWeights())
