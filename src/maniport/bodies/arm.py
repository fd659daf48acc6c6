"""An arm: one kinematic chain from a base to one frame, human or robot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies.arm_drawing import DrawnArm
from maniport.bodies.chain import Chain, check_names
from maniport.bodies.denavit_hartenberg import chain_from_dh
from maniport.bodies.manipulability import manipulability, principal_axes
from maniport.bodies.spec import VELOCITY, EllipsoidSpec
from maniport.errors import unknown_name
from maniport.validation import Array


class Arm(DrawnArm):
    """One kinematic chain from the base to the tip frame.

    Make arms with `maniport.load_arm`, `maniport.bodies.myoarm`, `maniport.bodies.rhuman` or `Arm.from_dh`.
    Configurations `q` have shape (..., dof) with any leading shape, angles in radians, slides in metres; results
    have the same leading shape. Positions and directions are expressed in the arm's base frame.

    Parameters
    ----------
    chain : Chain
        The description of the kinematics.

    Attributes
    ----------
    name : str
        Name of the arm.
    dof : int
        Number of degrees of freedom.
    joint_names : tuple of str
        Their names.
    lower, upper : ndarray, shape (dof,)
        Their limits [rad] or [m], read-only.
    velocity_limits : ndarray, shape (dof,), or None
        Their largest speeds [rad/s] or [m/s], read-only; infinite where unknown, None when none is known.
    frame : str
        Name of the tip frame.
    frames : tuple of str
        Names of all frames on the chain.
    chain : Chain
        The description it was made from.
    """

    @classmethod
    def from_dh(
        cls,
        name: str,
        rows: ArrayLike,
        lower: ArrayLike = -np.pi,
        upper: ArrayLike = np.pi,
        *,
        base: ArrayLike | None = None,
        joint_names: Sequence[str] | None = None,
        kinds: Sequence[str] | None = None,
        convention: str = "standard",
        velocity_limits: ArrayLike | None = None,
    ) -> "Arm":
        """Make an arm from a table of Denavit-Hartenberg parameters.

        Parameters
        ----------
        name : str
            Name of the arm.
        rows : array_like, shape (n, 4)
            One row for each joint: theta [rad], d [m], a [m], alpha [rad]. The joint's coordinate adds to theta, or
            to d when the joint is prismatic.
        lower, upper : array_like, shape (n,) or one number
            Limits of the joints [rad] or [m].
        base : array_like, shape (3, 3) or (4, 4), optional
            Rotation or pose of the first frame of the table in the base frame; identity by default.
        joint_names : sequence of str, optional
            ``joint1``, ``joint2``, … by default.
        kinds : sequence of {"revolute", "prismatic"}, optional
            All revolute by default.
        convention : {"standard", "modified"}
            ``Rz(θ) Tz(d) Tx(a) Rx(α)`` or Craig's ``Rx(α) Tx(a) Rz(θ) Tz(d)``.
        velocity_limits : array_like, shape (n,) or one number, optional
            Largest speeds [rad/s] or [m/s].

        Returns
        -------
        Arm
            With frames ``base``, ``link1``, … and the last link as tip.

        Raises
        ------
        InvalidInputError
            When an argument has a wrong shape or value.

        Examples
        --------
        A planar arm with two links of one metre:

        >>> Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]])
        Arm('planar', dof=2, frame='link2', joints=['joint1', 'joint2'])
        """
        chain = chain_from_dh(
            name, rows, lower, upper, base=base, joint_names=joint_names, kinds=kinds, convention=convention,
            velocity_limits=velocity_limits,
        )  # fmt: skip
        return cls(chain)

    def __repr__(self) -> str:
        return f"Arm({self.name!r}, dof={self.dof}, frame={self.frame!r}, joints={list(self.joint_names)})"

    def __reduce__(self) -> tuple[type["Arm"], tuple[Chain]]:
        return type(self), (self._chain,)

    def restricted(self, frame: str | None = None, joints: Sequence[str] | None = None) -> "Arm":
        """The same arm with another tip, or with some joints only; see `maniport.load_arm`."""
        return Arm(self._chain.restrict(frame, joints))

    # ---- kinematics -------------------------------------------------------------------------------------------

    def forward(self, q: ArrayLike) -> Array:
        """Poses of the tip in the base frame.

        Parameters
        ----------
        q : array_like, shape (..., dof)
            Configurations; limits are not enforced.

        Returns
        -------
        ndarray, shape (..., 4, 4)
            Homogeneous transforms, metres.

        Raises
        ------
        InvalidInputError
            When `q` has a wrong shape, nan or infinity.
        """
        positions, shape = self._positions(q)
        return self._kinematics.forward(positions).reshape(*shape, 4, 4)

    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobians of the tip.

        Parameters
        ----------
        q : array_like, shape (..., dof)
            Configurations; limits are not enforced.

        Returns
        -------
        ndarray, shape (..., 6, dof)
            Rows 0 to 2: velocity of the tip's origin; rows 3 to 5: angular velocity; both along the axes of the
            base frame.

        Raises
        ------
        InvalidInputError
            When `q` has a wrong shape, nan or infinity.
        """
        positions, shape = self._positions(q)
        return self._coupled(self._kinematics.jacobian(positions)).reshape(*shape, 6, self.dof)

    def point_positions(self, q: ArrayLike, frames: Sequence[str]) -> Array:
        """Origins of several frames [m], shape (..., len(frames), 3)."""
        names = self._known_frames(frames)
        positions, shape = self._positions(q)
        return self._kinematics.point_positions(positions, names).reshape(*shape, len(names), 3)

    def point_jacobians(self, q: ArrayLike, frames: Sequence[str]) -> Array:
        """Linear Jacobians of the origins of several frames, shape (..., len(frames), 3, dof)."""
        names = self._known_frames(frames)
        positions, shape = self._positions(q)
        jacobians = self._coupled(self._kinematics.point_jacobians(positions, names))
        return jacobians.reshape(*shape, len(names), 3, self.dof)

    def axis_direction(self, q: ArrayLike, joint_name: str) -> Array:
        """Direction of a joint's axis in the base frame, unit vectors of shape (..., 3).

        A revolute joint turns what follows it about this direction by the right-hand rule; a slide moves it along.
        """
        joints = {joint.name: joint for joint in self._chain.joints}
        if joint_name not in joints:
            raise unknown_name("joint", joint_name, joints, f"on the arm {self.name!r}")
        positions, shape = self._positions(q)
        rotations = self._kinematics.joint_poses(positions, [joint_name])[:, 0, :3, :3]
        return np.asarray(rotations @ joints[joint_name].axis).reshape(*shape, 3)

    # ---- ellipsoids -------------------------------------------------------------------------------------------

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
            Configurations; limits are not enforced.
        kind : {"velocity", "force"}
            Which ellipsoid. Singular velocity ellipsoids are returned as they are.
        part : {"translation", "rotation", "full"}
            Which motion counts: d = 3, 3 or 6. ``"full"`` mixes metres and radians.
        joint_weights : array_like, shape (dof,), or "velocity-limits", optional
            Positive diagonal of W: the joint velocity that counts as one. ``"velocity-limits"`` takes the arm's own.

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
        from maniport.bodies.manipulability_jacobian import manipulability_jacobian  # here: Numba takes its time

        positions, shape = self._positions(q)
        changes = manipulability_jacobian(
            self._kinematics.jacobian(positions), self._chain.coupling, self.resolved(spec)
        )
        return changes.reshape(*shape, *changes.shape[1:])

    def differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array]:
        """Jacobians, ellipsoids and their derivatives at once, for searches; one pass over the kinematics.

        The same as `jacobian`, `ellipsoids` and `manipulability_jacobian` give, bit for bit.
        """
        from maniport.bodies.manipulability_jacobian import manipulability_jacobian  # here: Numba takes its time

        positions, shape = self._positions(q)
        of_joints, meant = self._kinematics.jacobian(positions), self.resolved(spec)
        jacobian = self._coupled(of_joints).reshape(*shape, 6, self.dof)
        changes = manipulability_jacobian(of_joints, self._chain.coupling, meant)
        return jacobian, manipulability(jacobian, meant), changes.reshape(*shape, *changes.shape[1:])

    def resolved(self, spec: EllipsoidSpec) -> EllipsoidSpec:
        """The same ellipsoids with numbers for joint weights, one for each joint, where it has words.

        Raises
        ------
        InvalidInputError
            When the numbers are not as many as the joints, or the arm does not know its velocity limits.
        """
        if spec.joint_weights is None:
            return spec
        numbers = replace(spec, joint_weights=self._weights(spec.joint_weights))
        numbers.weights(self.dof)
        return numbers

    # ---- private ----------------------------------------------------------------------------------------------

    def _coupled(self, jacobians: Array) -> Array:
        """Chain rule from the chain's joints to the degrees of freedom."""
        if self._trivial:
            return jacobians
        # One large product is faster than one small product a configuration.
        flat = jacobians.reshape(-1, jacobians.shape[-1]) @ self._chain.coupling
        return np.asarray(flat.reshape(*jacobians.shape[:-1], self.dof))

    def _known_frames(self, frames: Sequence[str]) -> tuple[str, ...]:
        names = check_names(frames, "frames")
        for name in names:
            if name not in self.frames:
                raise unknown_name("frame", name, self.frames, f"on the arm {self.name!r}")
        return names
