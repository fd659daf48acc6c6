"""A task for Pink: where a frame is, whatever its orientation."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pink.configuration import Configuration
from pink.exceptions import TargetNotSet

from maniport.tracking.objective import FOLLOWING_WEIGHT
from maniport.tracking.tasks.task import CheckedTask
from maniport.validation import Array, as_finite, require_shape


class PositionTask(CheckedTask):
    """Regulate the position of a frame's origin in the world: three rows.

    Pink's FrameTask with an orientation cost of zero differs away from its target: its error is the linear part of the
    logarithm of a pose, into which the turn that is still to go is mixed, in axes that turn with the frame. Here the
    error is the way to the target, in the axes of the world, and so is a cost for each.

    Together with a `ManipulabilityEllipsoidTask` it makes nine equations, for a 7-joint arm whose last joint moves
    neither the frame's origin nor its ellipsoid for no more than six unknowns. The ellipsoid and the position
    are coupled: in general an arm can follow the one exactly and the other nearly, and the costs decide which. With
    the default costs, a Panda's tip stayed within 0.5 mm of its path while ellipsoids were off by a distance of 2.

    Parameters
    ----------
    frame : str
        Name of the frame in the Pinocchio model.
    cost : float or sequence of three floats
        For a metre along each axis of the world [cost/m].
    gain : float
        Share of the error that is to vanish in a step, in (0, 1].
    lm_damping : float
        Levenberg-Marquardt damping, not negative, as in all tasks of Pink: slows the joints in proportion to the
        squared error.

    Attributes
    ----------
    target : ndarray, shape (3,), or None
        Target position in the world [m].

    See Also
    --------
    OrientationTask, ManipulabilityEllipsoidTask
    """

    def __init__(
        self,
        frame: str,
        cost: float | Sequence[float] = FOLLOWING_WEIGHT,
        gain: float = 1.0,
        lm_damping: float = 0.0,
    ) -> None:
        super().__init__(frame, 3, cost, gain, lm_damping)
        self.target: Array | None = None

    def set_target(self, position: ArrayLike) -> None:
        """Set the target position in the world [m], shape (3,)."""
        target = as_finite(position, "position")
        require_shape(target, "position", (3,))
        self.target = target.copy()

    def set_target_from_configuration(self, configuration: Configuration) -> None:
        """Take where the frame is for the target."""
        self.set_target(self._position(configuration))

    def terms(self, configuration: Configuration) -> tuple[Array, Array]:
        """Way from the target to the present position [m], and linear velocities of the origin, both in the world."""
        if self.target is None:
            raise TargetNotSet(f"no target position set for frame {self.frame!r}")
        model, data, index = configuration.model, configuration.data, self.index(configuration)
        jacobian = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)
        return self._position(configuration) - self.target, np.asarray(jacobian[:3])

    def _position(self, configuration: Configuration) -> Array:
        return np.asarray(configuration.data.oMf[self.index(configuration)].translation)
