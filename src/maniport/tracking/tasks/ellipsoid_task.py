"""A task for Pink: the manipulability ellipsoid of a frame."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pink.configuration import Configuration
from pink.exceptions import TargetNotSet
from pink.tasks import Task

from maniport.bodies import EllipsoidSpec
from maniport.bodies.manipulability import manipulability
from maniport.bodies.manipulability_jacobian import _derivatives
from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.matrix_functions import roots
from maniport.tracking.model_frame import frame_id, moving_columns
from maniport.tracking.tasks.ellipsoid_terms import fill_terms
from maniport.validation import Array, as_choice, as_finite, as_number, as_numbers, as_spd, as_symmetric

ROWS = {"translation": slice(0, 3), "rotation": slice(3, 6), "full": slice(0, 6)}
RELATIVE_FLOOR = 0.01


class ManipulabilityEllipsoidTask(Task):  # type: ignore[misc]  # Pink is untyped
    """Regulate the manipulability ellipsoid M = J W² Jᵀ of a frame.

    The error is e = vec(log(M^-½ M_wanted M^-½)) in Mandel form, whose length is the affine-invariant distance to the
    wanted ellipsoid; the Jacobian has the columns −vec(M^-½ (∂M/∂q_k) M^-½), so that J Δq = −α e moves M along the
    geodesic to the wanted one, and Jᵀe is exactly the gradient of ½ |e|² (Jaquier, Rozo, Caldwell & Calinon,
    Geometry-aware Manipulability Learning, Tracking, and Transfer, IJRR 2021, § 5). M and M_wanted include the floor.

    For models of any tree of joints whose joints between the world and the frame are revolute or prismatic; the other
    columns are zero. Position and ellipsoid of one frame are coupled, see `maniport.tracking.PositionTask`.
    To raise one scalar, Yoshikawa's index, take Pink's ManipulabilityTask.

    Parameters
    ----------
    frame : str
        Name of the frame in the Pinocchio model.
    cost : float or sequence of float
        For each unit of distance, or for each of the m = d (d + 1) / 2 entries of the error.
    gain : float
        Share of the error that is to vanish in a step, in (0, 1].
    lm_damping : float
        Levenberg-Marquardt damping: slows the joints in proportion to the squared error. The default keeps the arm
        calm where the wanted ellipsoid is out of reach, and hardly slows it where it is not.
    joint_weights : array_like, shape (nv,), optional
        Positive diagonal of W, for each tangent coordinate of the model, as in `Arm.manipulability`.
    floor : float, optional
        Added to the eigenvalues of M and M_wanted [unit of M], so that flat ellipsoids of singular configurations lie
        at a finite distance. Default: a hundredth of the wanted ellipsoid's mean eigenvalue. With 0, the task raises
        NotSPDError at singular configurations.
    part : {"translation", "rotation", "full"}
        Which motion counts, as in `Arm.manipulability`: d = 3, 3 or 6.
    weights : array_like, shape (m, m), optional
        Weighs the error as eᵀ weights e, such as the inverse of the covariance of several demonstrations: symmetric
        positive-semidefinite, in Mandel coordinates that are whitened at the wanted ellipsoid (see
        `maniport.profiles.tracking_weights`). Error and Jacobian then are expressed in these coordinates too, by
        parallel transport from M to M_wanted.

    Attributes
    ----------
    target : ndarray, shape (d, d), or None
        The wanted ellipsoid, without floor.
    """

    def __init__(
        self,
        frame: str,
        cost: float | Sequence[float] = 1.0,
        gain: float = 1.0,
        lm_damping: float = 10.0,
        joint_weights: ArrayLike | None = None,
        floor: float | None = None,
        part: str = "translation",
        weights: ArrayLike | None = None,
    ) -> None:
        super().__init__(
            cost=cost,
            gain=as_number(gain, "gain", above=0.0, maximum=1.0),
            lm_damping=as_number(lm_damping, "lm_damping", minimum=0.0),
        )
        self.frame = frame
        self.part = as_choice(part, "part", tuple(ROWS))
        self.floor = None if floor is None else as_number(floor, "floor", minimum=0.0)
        self.joint_weights = None if joint_weights is None else as_finite(joint_weights, "joint_weights")
        self.target: Array | None = None
        self._chain: _Chain | None = None
        self._wanted = self._root = np.empty((0, 0))
        self._floor = 0.0
        d = 6 if self.part == "full" else 3
        self._size = d * (d + 1) // 2
        as_numbers(1.0 if cost is None else cost, "cost", self._size, one=True, minimum=0.0)
        self.weights: Array | None = None
        self.set_weights(weights)

    def set_target(self, ellipsoid: ArrayLike) -> None:
        """Set the wanted ellipsoid.

        Parameters
        ----------
        ellipsoid : array_like, shape (d, d)
            In the axes of the world, without floor.

        Raises
        ------
        NotSPDError
            When it is asymmetric, or not positive-definite with the floor.
        """
        d = 6 if self.part == "full" else 3
        target = as_symmetric(ellipsoid, "ellipsoid", d)
        if target.ndim != 2:
            raise InvalidInputError(f"ellipsoid must be one matrix, shape ({d}, {d}); found shape {target.shape}")
        floor = RELATIVE_FLOOR * float(np.trace(target)) / d if self.floor is None else self.floor
        hint = "Give a floor: it is added to all eigenvalues"
        wanted = as_spd(target + floor * np.eye(d), "ellipsoid plus floor", hint=hint)
        self.target, self._wanted, self._floor = target, wanted, floor
        self._root = wanted if self.weights is None else roots(wanted)[0]

    def set_target_from_configuration(self, configuration: Configuration) -> None:
        """Want the ellipsoid that the frame has."""
        jacobian, weights = self._moving(configuration)
        self.set_target(manipulability(jacobian, EllipsoidSpec(part=self.part, joint_weights=weights)))

    def set_weights(self, weights: ArrayLike | None) -> None:
        """Set the weights of the error, shape (m, m), or none."""
        if weights is None:
            self.weights = None
            return
        matrix = as_finite(weights, "weights")
        if matrix.shape != (self._size, self._size):
            raise InvalidInputError(
                f"weights must have shape ({self._size}, {self._size}) for part={self.part!r}; found {matrix.shape}"
            )
        scale = float(np.abs(matrix).max())
        if np.abs(matrix - matrix.T).max() > 1e-8 * scale or np.linalg.eigvalsh(matrix)[0] < -1e-10 * scale:
            raise NotSPDError("weights must be symmetric without negative eigenvalues")
        if self.weights is None and self.target is not None:
            self._root = roots(self._wanted)[0]
        self.weights = 0.5 * (matrix + matrix.T)

    def compute_error(self, configuration: Configuration) -> Array:
        """Error e, shape (m,): the diagonal of log(M^-½ M_wanted M^-½), then √2 times its upper triangle."""
        return self._terms(configuration)[0]

    def compute_jacobian(self, configuration: Configuration) -> Array:
        """Jacobian, shape (m, nv): the columns −vec(M^-½ (∂M/∂q_k) M^-½)."""
        return self._terms(configuration)[1]

    def compute_qp_objective(self, configuration: Configuration) -> tuple[Array, Array]:
        """Pink's objective of a task, H (nv, nv) and c (nv,), with the weights of the error."""
        error, jacobian = self._terms(configuration)
        if self.cost is not None:
            scale = np.asarray(self.cost)
            error, jacobian = scale * error, (jacobian.T * scale).T
        weighted = error if self.weights is None else self.weights @ error
        hessian = jacobian.T @ (jacobian if self.weights is None else self.weights @ jacobian)
        damping = self.lm_damping * self.gain**2 * float(error @ weighted)
        return hessian + damping * configuration.tangent.eye, self.gain * (weighted @ jacobian)

    def _terms(self, configuration: Configuration) -> tuple[Array, Array]:
        if self.target is None:
            raise TargetNotSet(f"no target ellipsoid set for frame {self.frame!r}")
        columns, weights = self._moving(configuration)
        d, dof = len(self._wanted), columns.shape[1]
        rows = columns[ROWS[self.part]] if weights is None else columns[ROWS[self.part]] * weights
        changes = np.empty((1, dof, d, d))
        chain = self._chain
        assert chain is not None
        _derivatives(columns[None], rows[None], chain.coupling, chain.weighted, self.part != "rotation", changes)
        error, jacobian = np.empty(self._size), np.empty((self._size, dof))
        turned = self.weights is not None
        if not fill_terms(rows, changes[0], self._floor, self._wanted, self._root, turned, error, jacobian):
            raise NotSPDError(
                f"the ellipsoid of the frame {self.frame!r} with the floor {self._floor:g} is singular at "
                f"q = {np.array2string(configuration.q, precision=4)}. Give a larger floor"
            )
        if dof == configuration.model.nv:
            return error, jacobian
        full = np.zeros((self._size, configuration.model.nv))
        full[:, chain.columns] = jacobian
        return error, full

    def _moving(self, configuration: Configuration) -> tuple[Array, Array | None]:
        """Columns of the frame's Jacobian that belong to its chain, shape (6, dof), and the weights of these joints."""
        model = configuration.model
        if self._chain is None or self._chain.model is not model:
            self._chain = _Chain(model, self.frame, self.joint_weights)
        chain = self._chain
        jacobian = pin.getFrameJacobian(model, configuration.data, chain.frame_id, pin.LOCAL_WORLD_ALIGNED)
        return np.take(jacobian, chain.columns, axis=1), chain.weights

    def __repr__(self) -> str:
        return (
            f"ManipulabilityEllipsoidTask(frame={self.frame}, part={self.part}, cost={self.cost}, gain={self.gain}, "
            f"lm_damping={self.lm_damping}, floor={self.floor})"
        )


class _Chain:
    """What a task needs to know of a model: looked up once."""

    def __init__(self, model: Any, frame: str, joint_weights: Array | None):
        self.model = model
        self.frame_id = frame_id(model, frame)
        self.columns = moving_columns(model, frame)
        self.weights = None
        if joint_weights is not None:
            self.weights = as_numbers(joint_weights, "joint_weights", model.nv, above=0.0)[self.columns]
        self.coupling = np.eye(len(self.columns))
        self.weighted = self.coupling if self.weights is None else np.diag(self.weights)
