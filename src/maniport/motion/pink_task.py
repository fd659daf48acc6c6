"""The ellipsoid cost as a task for Pink's inverse kinematics (extra: pink)."""

import numpy as np
from numpy.typing import ArrayLike
from pink.configuration import Configuration
from pink.exceptions import TargetNotSet
from pink.tasks import Task

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import unknown_name
from maniport.motion.controller import LM_DAMPING
from maniport.motion.objective import Damping, Objective, Targets
from maniport.util.defaults import DAMPING
from maniport.util.validation import Array


class EllipsoidTask(Task):  # type: ignore[misc]  # Pink is untyped
    """Regulate the manipulability ellipsoid of an arm.

    The error is log(A^-½ M A^-½) in Mandel form, whose length is the affine-invariant distance of the arm's ellipsoid M
    to the target A, both with the damping. The Pinocchio model of the configuration is ``robot_model(arm)``, or another
    one with joints of the same names that each have one coordinate.

    Parameters
    ----------
    arm : Arm
    spec : EllipsoidSpec
        Which ellipsoids.
    damping : float or Regularization
        As in `maniport.motion.track`.
    cost, gain, lm_damping : float
        As in Pink; the cost is that of a distance of one.
    """

    def __init__(
        self,
        arm: Arm,
        spec: EllipsoidSpec = VELOCITY,
        damping: Damping = DAMPING,
        cost: float = 1.0,
        gain: float = 1.0,
        lm_damping: float = LM_DAMPING,
    ):
        super().__init__(cost=cost, gain=gain, lm_damping=lm_damping)
        self.arm, self.objective = arm, Objective.of(arm, spec, damping, positive=True)
        self._targets: Targets | None = None

    def __repr__(self) -> str:
        return f"EllipsoidTask({self.arm!r}, cost={self.cost}, gain={self.gain}, lm_damping={self.lm_damping})"

    def set_target(self, ellipsoid: ArrayLike) -> None:
        """Set the target ellipsoid in the base frame, without damping, shape (d, d)."""
        self._targets = self.objective.targets(self.objective.checked(np.asarray(ellipsoid)[None], "ellipsoid"))

    def compute_error(self, configuration: Configuration) -> Array:
        """Return the error, shape (d (d + 1) / 2,)."""
        targets, q, _ = self._at(configuration)
        return np.asarray(targets.ellipsoid.residual(q)[0])

    def compute_jacobian(self, configuration: Configuration) -> Array:
        """Return the derivatives of the error, shape (d (d + 1) / 2, nv)."""
        targets, q, columns = self._at(configuration)
        rows = targets.ellipsoid.jacobian(q)[0]
        jacobian = np.zeros((len(rows), configuration.model.nv))
        jacobian[:, columns] = rows
        return jacobian

    def _at(self, configuration: Configuration) -> tuple[Targets, Array, list[int]]:
        """Return the targets, the joint positions (1, dof) of the arm and the columns of its joint velocities."""
        if self._targets is None:
            raise TargetNotSet(f"no target ellipsoid set for {self.arm.name!r}")
        model = configuration.model
        for name in self.arm.joint_names:
            if not model.existJointName(name):
                raise unknown_name("joint", name, list(model.names), f"in the model {model.name!r}")
        joints = [model.joints[model.getJointId(name)] for name in self.arm.joint_names]
        return (
            self._targets,
            configuration.q[[joint.idx_q for joint in joints]][None],
            [joint.idx_v for joint in joints],
        )
