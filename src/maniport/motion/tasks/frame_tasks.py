"""Tasks for Pink of the position and of the orientation of a frame, and their common base with checked arguments."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pink.configuration import Configuration
from pink.exceptions import TargetNotSet
from pink.tasks import Task

from maniport.motion.arm_model import frame_id
from maniport.motion.objective import FOLLOWING_WEIGHT, POINTING, axis_weights
from maniport.util.validation import Array, as_finite, as_number, as_numbers, as_rotation, require_shape


def as_gain(value: Any, name: str = "gain") -> float:
    """Convert to the share of an error that is to vanish in a step, in (0, 1]."""
    return as_number(value, name, above=0.0, maximum=1.0)


def as_lm_damping(value: Any, name: str = "lm_damping") -> float:
    """Convert to a Levenberg-Marquardt damping, not negative."""
    return as_number(value, name, minimum=0.0)


class CheckedTask(Task):  # type: ignore[misc]  # Pink is untyped
    """A task for a frame with checked arguments, and Pink's objective with weights.

    `weights` (size, size) weighs the error as eᵀ weights e; `slowing` damps the joints whatever the error. Dampings
    are multiplied with `slowed` (nv, nv), by default the identity, such as ones for the joints of one of two arms.
    """

    told: tuple[str, ...] = ()  # Further attributes of the representation

    def __init__(
        self, frame: str, size: int, cost: float | Sequence[float] | None, gain: float, lm_damping: float
    ) -> None:
        as_numbers(1.0 if cost is None else cost, "cost", size, one=True, minimum=0.0)
        super().__init__(cost=cost, gain=as_gain(gain), lm_damping=as_lm_damping(lm_damping))
        self.frame, self.size = frame, size
        self.weights: Array | None = None
        self.slowing = 0.0
        self.slowed: Array | None = None
        self._found: tuple[Any, int] = (None, -1)

    def __repr__(self) -> str:
        told = ", ".join(
            f"{name}={getattr(self, name)}" for name in ("frame", "cost", "gain", "lm_damping", *self.told)
        )
        return f"{type(self).__name__}({told})"

    def index(self, configuration: Configuration) -> int:
        """Index of the frame in the configuration's model, which is looked up once."""
        if self._found[0] is not configuration.model:
            self._found = (configuration.model, frame_id(configuration.model, self.frame))
        return self._found[1]

    def terms(self, configuration: Configuration) -> tuple[Array, Array]:
        """Error (size,) and Jacobian (size, nv), before costs and weights."""
        raise NotImplementedError

    def compute_error(self, configuration: Configuration) -> Array:
        """Error, shape (size,)."""
        return self.terms(configuration)[0]

    def compute_jacobian(self, configuration: Configuration) -> Array:
        """Jacobian, shape (size, nv)."""
        return self.terms(configuration)[1]

    def compute_qp_objective(self, configuration: Configuration) -> tuple[Array, Array]:
        """Pink's objective of a task, H (nv, nv) and c (nv,), with the weights and without a diagonal matrix."""
        error, jacobian = self.terms(configuration)
        if self.cost is not None:
            scale = np.asarray(self.cost)
            error, jacobian = scale * error, (jacobian.T * scale).T
        weighted = error if self.weights is None else self.weights @ error
        hessian = jacobian.T @ (jacobian if self.weights is None else self.weights @ jacobian)
        damping = self.lm_damping * self.gain**2 * float(error @ weighted) + self.slowing
        slowed = configuration.tangent.eye if self.slowed is None else self.slowed
        return hessian + damping * slowed, self.gain * (weighted @ jacobian)


class PositionTask(CheckedTask):
    """Regulate the position of a frame's origin in the world: three rows.

    Pink's FrameTask with an orientation cost of zero differs away from its target: its error is the linear part of the
    logarithm of a pose, into which the remaining rotation is mixed. Here the error is the offset in the axes of the
    world. Position and ellipsoid of a frame are coupled: together with a `ManipulabilityEllipsoidTask` it makes nine
    equations, and the costs decide which is followed exactly.

    Parameters
    ----------
    frame : str
        Name of the frame in the Pinocchio model.
    cost : float or sequence of three floats
        For a metre along each axis of the world [cost/m].
    gain : float
        Share of the error that is to vanish in a step, in (0, 1].
    lm_damping : float
        Levenberg-Marquardt damping, not negative.

    Attributes
    ----------
    target : ndarray, shape (3,), or None
        Target position in the world [m].
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


class OrientationTask(CheckedTask):
    """Regulate the directions of the axes of a frame: three rows for each of x, y and z.

    Unlike in Pink's FrameTask an axis may be left open: with the costs of ``"pointing"`` the frame may turn about its z
    axis. An axis that is off by a small angle has an error of that length.

    Parameters
    ----------
    frame : str
        Name of the frame in the Pinocchio model.
    cost : sequence of three floats
        For a radian between each axis and its target [cost/rad].
    gain : float
        Share of the error that is to vanish in a step, in (0, 1].
    lm_damping : float
        Levenberg-Marquardt damping, not negative.

    Attributes
    ----------
    target : ndarray, shape (3, 3), or None
        Rotation whose columns are the target directions of the axes in the world.
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
