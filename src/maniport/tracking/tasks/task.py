"""What the tasks of this room share: their arguments checked in one place, and Pink's objective with weights."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pink.configuration import Configuration
from pink.tasks import Task

from maniport.tracking.arm_model import frame_id
from maniport.validation import Array, as_number, as_numbers


def as_gain(value: Any, name: str = "gain") -> float:
    """Convert to the share of an error that is to vanish in a step, in (0, 1]."""
    return as_number(value, name, above=0.0, maximum=1.0)


def as_lm_damping(value: Any, name: str = "lm_damping") -> float:
    """Convert to a Levenberg-Marquardt damping, not negative."""
    return as_number(value, name, minimum=0.0)


class CheckedTask(Task):  # type: ignore[misc]  # Pink is untyped
    """A task for a frame whose arguments are checked, which Pink leaves to the solver.

    Parameters
    ----------
    frame : str
        Name of the frame in the Pinocchio model.
    size : int
        Number of rows of the error.
    cost : float or sequence of float
        For each unit of the error, or for each of its rows; not negative.
    gain : float
        Share of the error that is to vanish in a step, in (0, 1].
    lm_damping : float
        Levenberg-Marquardt damping, as in all tasks of Pink: slows the joints in proportion to the squared error; not
        negative.

    Attributes
    ----------
    weights : ndarray, shape (size, size), or None
        Weighs the error as eᵀ weights e.
    slowing : float
        Slows the joints beside, whatever the error.
    slowed : ndarray, shape (nv, nv), or None
        What both are multiplied with; None: the identity. Of a robot with several arms, ones for those of one.
    """

    told: tuple[str, ...] = ()
    """Names of attributes that its representation tells beside the common ones."""

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
