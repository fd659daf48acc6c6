"""Ellipsoid cost as a task for Pink.

Pink minimizes the squared errors of its tasks in a quadratic program; here the error is that between ellipsoids.
`05_follow_a_profile.py` contains the loop (extra: pink).
"""

import numpy as np
from pink.exceptions import TargetNotSet
from pink.tasks import Task

from maniport.arms import VELOCITY
from maniport.motion.controller import LM_DAMPING
from maniport.motion.problem import ArmProblem
from maniport.motion.targets import TargetTrajectory, damping_of


class EllipsoidTask(Task):
    """Regulate the manipulability ellipsoid of an arm in a Pinocchio model that has its joints.

    The error is log(A^-½ M A^-½) in Mandel form; its length is the affine-invariant distance of the arm's ellipsoid M
    to the target A, both with the damping. `cost` is that of a distance of one.
    """

    def __init__(self, arm, cost=1.0, gain=1.0, lm_damping=LM_DAMPING):
        super().__init__(cost=cost, gain=gain, lm_damping=lm_damping)
        self.arm = arm
        self.damping = damping_of(arm, VELOCITY, 0.01)
        self.problem = None

    def __repr__(self):
        return f"EllipsoidTask({self.arm!r}, cost={self.cost}, gain={self.gain}, lm_damping={self.lm_damping})"

    def set_target(self, ellipsoid):
        """Set the target ellipsoid in the base frame, shape (d, d)."""
        target = TargetTrajectory(np.zeros(1), ellipsoid[None], VELOCITY, self.damping)
        self.problem = ArmProblem.of(self.arm, target)

    def compute_error(self, configuration):
        """Return the error, shape (d (d + 1) / 2,)."""
        if self.problem is None:
            raise TargetNotSet("no target ellipsoid")
        return self.problem.ellipsoid.residual(self.at(configuration))[0]

    def compute_jacobian(self, configuration):
        """Return the derivatives of the error, shape (d (d + 1) / 2, nv)."""
        rows = self.problem.ellipsoid.jacobian(self.at(configuration))[0]
        jacobian = np.zeros((len(rows), configuration.model.nv))
        jacobian[:, self.joints(configuration, "idx_v")] = rows
        return jacobian

    def at(self, configuration):
        """Return the configuration of the arm."""
        return self.problem.at(configuration.q[self.joints(configuration, "idx_q")][None])

    def joints(self, configuration, index):
        """Return the indices of the arm's joints in q or in the velocity."""
        model = configuration.model
        return [
            getattr(model.joints[model.getJointId(name)], index) for name in self.arm.joint_names
        ]
