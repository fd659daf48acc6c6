"""What moves one frame and has ellipsoids there: an arm, or both arms of a pair as one."""

from abc import abstractmethod
from collections.abc import Mapping

from numpy.typing import ArrayLike

from maniport.bodies.joint_space import JointSpace
from maniport.bodies.manipulability import manipulability, principal_axes
from maniport.bodies.spec import VELOCITY, EllipsoidSpec
from maniport.validation import Array


class Manipulable(JointSpace):
    """A joint space that moves one frame; what searches, domains and plans ask of an arm."""

    frame: str
    base: str | None
    locked: Mapping[str, float]

    @abstractmethod
    def forward(self, q: ArrayLike) -> Array:
        """Poses of the frame, shape (..., 4, 4) [m]."""

    @abstractmethod
    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobians of the frame, shape (..., 6, dof), linear rows first."""

    @abstractmethod
    def posed_differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array, Array]:
        """What `forward` gives, and then what `differentials` does."""

    def manipulability(
        self,
        q: ArrayLike,
        kind: str = "velocity",
        part: str = "translation",
        joint_weights: ArrayLike | str | None = None,
    ) -> Array:
        """Manipulability matrices ``J W² Jᵀ`` (velocity) or their inverses (force).

        Parameters
        ----------
        q : array_like, shape (..., dof)
            Configurations.
        kind, part, joint_weights
            Which ellipsoids, as in `EllipsoidSpec`. Singular velocity ellipsoids are returned as they are.

        Returns
        -------
        ndarray, shape (..., d, d)
            Exactly symmetric matrices.

        Raises
        ------
        InvalidInputError
            When an argument has a wrong shape or value, or the velocity limits are not known.
        NotSPDError
            When a force ellipsoid is asked for where the arm is singular.
        """
        return self.ellipsoids(q, EllipsoidSpec(kind, part, joint_weights))

    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Manipulability matrices (..., d, d) as a specification asks for; see `manipulability`."""
        return manipulability(self.jacobian(q), self.resolved(spec))

    def principal_axes(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array]:
        """Semi-axis lengths (..., d), ascending, and directions (..., d, d), columns, of the ellipsoids.

        They come from the singular values of the Jacobian and are more accurate than an eigendecomposition of the
        matrix. Errors are those of `manipulability`.
        """
        return principal_axes(self.jacobian(q), self.resolved(spec))

    def manipulability_jacobian(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Derivatives ``∂M/∂q_k`` of the manipulability matrices, shape (..., dof, d, d), exactly symmetric.

        Closed form, see `maniport.bodies.manipulability_jacobian`. Errors are those of `manipulability`; the unit is
        that of M for each radian or metre of the joint.
        """
        return self.differentials(q, spec)[2]

    def differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array]:
        """Jacobians, ellipsoids and their derivatives at once, for searches.

        The same as `jacobian`, `ellipsoids` and `manipulability_jacobian` give, bit for bit.
        """
        return self.posed_differentials(q, spec)[1:]
