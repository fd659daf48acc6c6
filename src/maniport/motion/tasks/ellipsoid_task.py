"""A task for Pink: the manipulability ellipsoid of a frame."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pink.configuration import Configuration
from pink.exceptions import TargetNotSet

from maniport.arms import VELOCITY, EllipsoidSpec
from maniport.arms.manipulability import manipulability
from maniport.arms.manipulability_jacobian import _derivatives
from maniport.errors import InvalidInputError, NotSPDError
from maniport.motion.arm_model import frame_id, moving_columns
from maniport.motion.kernels import fill_terms
from maniport.motion.objective import HINT, Damping, as_damping
from maniport.motion.tasks.frame_tasks import CheckedTask
from maniport.spd.matrix_functions import roots
from maniport.util.defaults import DAMPING
from maniport.util.validation import Array, as_positive_semidefinite, as_spd, as_symmetric, require_shape


class ManipulabilityEllipsoidTask(CheckedTask):
    """Regulate the manipulability ellipsoid M = J W² Jᵀ of a frame.

    The error is e = vec(log(M^-½ A M^-½)) in Mandel form, whose length is the affine-invariant distance to the target
    ellipsoid A; the Jacobian has the columns −vec(M^-½ (∂M/∂q_k) M^-½), so that J Δq = −α e moves M along the
    geodesic to A, and Jᵀe is exactly the gradient of ``½ |e|²`` [1]_. M and A include the damping.

    Joints between the world and the frame must be revolute or prismatic; other columns are zero. Position and ellipsoid
    of a frame are coupled, see `maniport.motion.PositionTask`. To raise Yoshikawa's index, take Pink's
    ManipulabilityTask.

    Parameters
    ----------
    frame : str
        Name of the frame in the Pinocchio model.
    cost : float or sequence of float
        For each unit of distance, or for each of the m = d (d + 1) / 2 entries of the error.
    gain : float
        Share of the error that is to vanish in a step, in (0, 1].
    lm_damping : float
        Levenberg-Marquardt damping, not negative. The default keeps the arm calm where the target is out of reach.
    spec : EllipsoidSpec
        Which ellipsoids, of velocity; joint weights for each tangent coordinate of the model, shape (nv,).
    damping : float, Regularization or None
        Added to the eigenvalues of M and A. A number is the share of the target's own mean eigenvalue, since a task
        knows no arm; a Regularization adds its ε. With None the task raises NotSPDError at singular configurations.
    weights : array_like, shape (m, m), optional
        Weighs the error as eᵀ weights e: symmetric positive-semidefinite, in Mandel coordinates that are whitened at
        the target (see `maniport.learning.tracking_weights`), in which error and Jacobian then are, too.

    Attributes
    ----------
    target : ndarray, shape (d, d), or None
        The target ellipsoid, without damping.

    References
    ----------
    .. [1] Jaquier, Rozo, Caldwell and Calinon, Geometry-aware manipulability learning, tracking, and transfer, IJRR 40,
       2021, § 5.
    """

    told = ("spec", "damping")

    def __init__(
        self,
        frame: str,
        cost: float | Sequence[float] = 1.0,
        gain: float = 1.0,
        lm_damping: float = 10.0,
        spec: EllipsoidSpec = VELOCITY,
        damping: Damping = DAMPING,
        weights: ArrayLike | None = None,
    ) -> None:
        if spec.kind != "velocity":
            raise InvalidInputError(
                f"spec must be of velocity ellipsoids; found {spec!r}. Those of force, inverses, are as far apart"
            )
        super().__init__(frame, spec.size * (spec.size + 1) // 2, cost, gain, lm_damping)
        self.spec, self.damping = spec, damping
        as_damping(damping, lambda: np.eye(spec.size)[None])  # a wrong one is told at once
        self.target: Array | None = None
        self._chain: _Chain | None = None
        self._damped = self._root = np.empty((0, 0))
        self._epsilon = 0.0
        self.set_weights(weights)

    def set_target(self, ellipsoid: ArrayLike) -> None:
        """Set the target ellipsoid.

        Parameters
        ----------
        ellipsoid : array_like, shape (d, d)
            In the axes of the world, without damping.

        Raises
        ------
        NotSPDError
            When it is asymmetric, or not positive-definite with the damping.
        """
        d = self.spec.size
        target = as_symmetric(ellipsoid, "ellipsoid", d)
        if target.ndim != 2:
            raise InvalidInputError(f"ellipsoid must be one matrix, shape ({d}, {d}); found shape {target.shape}")
        epsilon = as_damping(self.damping, lambda: target[None]).epsilon
        damped = as_spd(target + epsilon * np.eye(d), "ellipsoid with damping", hint=HINT)
        self.target, self._damped, self._epsilon = target, damped, epsilon
        self._root = damped if self.weights is None else roots(damped)[0]

    def set_target_from_configuration(self, configuration: Configuration) -> None:
        """Take the ellipsoid that the frame has for the target."""
        jacobian, weights = self._moving(configuration)
        self.set_target(manipulability(jacobian, replace(self.spec, joint_weights=weights)))

    def set_weights(self, weights: ArrayLike | None) -> None:
        """Set the weights of the error, shape (m, m), or none."""
        if weights is None:
            self.weights = None
            return
        matrix = as_positive_semidefinite(weights, "weights", self.size)
        require_shape(matrix, "weights", (self.size, self.size))
        if self.weights is None and self.target is not None:
            self._root = roots(self._damped)[0]
        self.weights = matrix

    def terms(self, configuration: Configuration) -> tuple[Array, Array]:
        """Error e, shape (m,): the diagonal of log(M^-½ A M^-½), then √2 times its upper triangle; Jacobian (m, nv)."""
        if self.target is None:
            raise TargetNotSet(f"no target ellipsoid set for frame {self.frame!r}")
        columns, weights = self._moving(configuration)
        d, dof = self.spec.size, columns.shape[1]
        rows = columns[self.spec.rows] if weights is None else columns[self.spec.rows] * weights
        achieved, changes = np.empty((1, d, d)), np.empty((1, dof, d, d))
        chain = self._chain
        assert chain is not None
        linear = self.spec.part != "rotation"
        _derivatives(columns[None], rows[None], chain.coupling, chain.weighted, linear, achieved, changes)
        error, jacobian = np.empty(self.size), np.empty((self.size, dof))
        turned = self.weights is not None
        if not fill_terms(rows, changes[0], self._epsilon, self._damped, self._root, turned, error, jacobian):
            raise NotSPDError(
                f"the ellipsoid of the frame {self.frame!r} with a damping of {self._epsilon:g} is singular at "
                f"q = {np.array2string(configuration.q, precision=4)}. Give more damping"
            )
        if dof == configuration.model.nv:
            return error, jacobian
        full = np.zeros((self.size, configuration.model.nv))
        full[:, chain.columns] = jacobian
        return error, full

    def _moving(self, configuration: Configuration) -> tuple[Array, Array | None]:
        """Columns of the frame's Jacobian that belong to its chain, shape (6, dof), and the weights of these joints."""
        model = configuration.model
        if self._chain is None or self._chain.model is not model:
            self._chain = _Chain(model, self.frame, self.spec)
        chain = self._chain
        jacobian = pin.getFrameJacobian(model, configuration.data, chain.frame_id, pin.LOCAL_WORLD_ALIGNED)
        return np.take(jacobian, chain.columns, axis=1), chain.weights


class _Chain:
    """What a task needs to know of a model: looked up once."""

    def __init__(self, model: Any, frame: str, spec: EllipsoidSpec):
        self.model = model
        self.frame_id = frame_id(model, frame)
        self.columns = moving_columns(model, frame)
        self.weights = None
        if spec.joint_weights is not None:
            named = isinstance(spec.joint_weights, str)
            spec = replace(spec, joint_weights=model.velocityLimit) if named else spec
            self.weights = spec.weights(model.nv)[self.columns]
        self.coupling = np.eye(len(self.columns))
        self.weighted = self.coupling if self.weights is None else np.diag(self.weights)
