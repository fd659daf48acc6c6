"""A task for Pink: where the axes of a frame point, each as much as it counts."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pink.configuration import Configuration
from pink.exceptions import TargetNotSet

from maniport.tracking.orientation import POINTING, axis_weights
from maniport.tracking.tasks.task import CheckedTask
from maniport.validation import Array, as_rotation


class OrientationTask(CheckedTask):
    """Let the axes of a frame point where those of a rotation do: three rows for each of x, y and z.

    Pink's FrameTask asks for all of a rotation. Here an axis may be left open: with the costs of ``"pointing"`` the
    frame may turn about its z axis. An axis that is off by a small angle has an error of that length.

    Parameters
    ----------
    frame : str
        Name of the frame in the Pinocchio model.
    cost : sequence of three floats
        For a radian between each axis and where it shall point [cost/rad].
    gain : float
        Share of the error that is to vanish in a step, in (0, 1].
    lm_damping : float
        Levenberg-Marquardt damping, not negative, as in all tasks of Pink.

    Attributes
    ----------
    target : ndarray, shape (3, 3), or None
        Rotation whose columns say where the axes shall point, in the world.

    See Also
    --------
    PositionTask, ManipulabilityEllipsoidTask
    """

    def __init__(
        self,
        frame: str,
        cost: Sequence[float] = axis_weights(POINTING),
        gain: float = 1.0,
        lm_damping: float = 0.0,
    ) -> None:
        super().__init__(frame, 9, np.repeat(cost, 3).tolist(), gain, lm_damping)
        self.target: Array | None = None

    def set_target(self, rotation: ArrayLike) -> None:
        """Set the rotation, shape (3, 3)."""
        self.target = as_rotation(rotation, "rotation", 3)

    def set_target_from_configuration(self, configuration: Configuration) -> None:
        """Take how the frame is turned for the target."""
        self.set_target(self._rotation(configuration))

    def terms(self, configuration: Configuration) -> tuple[Array, Array]:
        """Ways from where the axes shall point to where they do, and how they change, both in the world."""
        if self.target is None:
            raise TargetNotSet(f"no target rotation set for frame {self.frame!r}")
        model, data, index = configuration.model, configuration.data, self.index(configuration)
        turns = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[3:]
        axes = self._rotation(configuration).T
        slopes = np.cross(turns.T[None], axes[:, None])  # ω × axis, of each axis by each joint
        return (axes - self.target.T).ravel(), np.swapaxes(slopes, 1, 2).reshape(9, -1)

    def _rotation(self, configuration: Configuration) -> Array:
        return np.asarray(configuration.data.oMf[self.index(configuration)].rotation)
