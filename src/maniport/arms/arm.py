"""Arms: kinematic chains of humans and robots from a base to an end effector."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.chain import (
    PRISMATIC,
    REVOLUTE,
    Chain,
    Frame,
    Joint,
    as_pose,
    check_names,
    point_mass,
    pose,
)
from maniport.arms.joint_space import JointSpace
from maniport.arms.kinematics import Kinematics, PointKinematics
from maniport.arms.manipulability import (
    VELOCITY,
    EllipsoidSpec,
    RemainingTorques,
    manipulability,
    remaining_torques,
    weighting,
    with_derivatives,
)
from maniport.arms.meshes import Geometry, Surface
from maniport.arms.restriction import restrict
from maniport.errors import InvalidInputError, unknown_name
from maniport.util.plotting import Plottable
from maniport.util.validation import Array, as_choice, as_finite, as_number, as_numbers

if TYPE_CHECKING:
    import mujoco
    import pinocchio
    import yourdfpy


def _dh_limits(lower: ArrayLike, upper: ArrayLike, names: Sequence[str]) -> tuple[Array, Array]:
    """Return lower and upper limits of joints (n,), of which each pair is a range."""
    low = as_numbers(lower, "lower", len(names), broadcast=True)
    high = as_numbers(upper, "upper", len(names), broadcast=True)
    if np.any(low >= high):
        i = int(np.argmax(low >= high))
        raise InvalidInputError(
            f"lower of {names[i]!r} must be below upper; found {low[i]:g} and {high[i]:g}"
        )
    return low, high


class Arm(JointSpace, Plottable):
    """One kinematic chain from the base to the end effector.

    Make arms with `maniport.load_arm`, `maniport.arms.myoarm`, `maniport.arms.rhuman`, `Arm.from_dh` or `Arm.of`.
    Configurations `q` have shape (..., dof), in radians and meters; limits are not enforced. Results have the same
    leading shape and are in the base frame of the arm. Every method raises `InvalidInputError` when `q` has a wrong
    shape, nan or infinity.

    Attributes
    ----------
    name, side : str
        Name of the arm; side of a person, ``"right"`` or ``"left"``, None for robots.
    dof : int
        Number of degrees of freedom.
    joint_names : tuple of str
        Names of the joints that move.
    lower, upper : ndarray, shape (dof,)
        Their limits [rad] or [m], read-only.
    velocity_limits : ndarray, shape (dof,), or None
        Largest speeds [rad/s] or [m/s], read-only; infinite if unknown, None if all are unknown.
    effort_limits : ndarray, shape (dof,), or None
        Largest torques [N m] or forces [N], read-only; infinite if unknown, None if all are unknown.
    joint_units : tuple of str
        Units of the joints, ``"rad"`` or ``"m"``.
    base : str or None
        Reference frame of all results if not the first of the description.
    locked : mapping of str to float
        Positions of locked joints [rad] or [m].
    frame, frames : str, tuple of str
        Names of the end effector and of all frames on the chain.
    chain : Chain
        Description of the kinematics.
    """

    def __init__(self, chain: Chain):
        limits = chain.lower, chain.upper, chain.velocity_limits, chain.effort_limits
        super().__init__(chain.name, chain.coordinates, *limits, chain.units)
        self.chain = chain
        self.side = chain.side
        self.base = chain.base
        self.locked = chain.locked
        self.frame = chain.frame
        self.frames = tuple(chain.frames)
        self._kinematics = Kinematics(chain)
        self.geometry = Geometry(chain)

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
    ) -> "Arm":
        """Make an arm with frames ``base``, ``link1``, … from Denavit-Hartenberg parameters.

        Parameters
        ----------
        name : str
        rows : array_like, shape (n, 4)
            One row for each joint: theta [rad], d [m], a [m], alpha [rad] of ``Rz(θ) Tz(d) Tx(a) Rx(α)``. The joint's
            coordinate adds to theta, or to d when the joint is prismatic.
        lower, upper : array_like, shape (n,) or one number
            Limits of the joints [rad] or [m].
        base : array_like, shape (3, 3) or (4, 4), optional
            Rotation or pose of the first frame of the table in the base frame; identity by default.
        joint_names, kinds : sequence of str, optional
            By default ``joint1``, ``joint2``, …, and all ``"revolute"``; the other kind is ``"prismatic"``.

        Examples
        --------
        A planar arm with two links of one meter:

        >>> Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]])
        Arm('planar', dof=2, frame='link2', joints=['joint1', 'joint2'])
        """
        table = as_finite(rows, "rows")
        if table.ndim != 2 or table.shape[1] != 4 or not len(table):
            raise InvalidInputError(
                f"rows must have shape (n, 4), columns theta, d, a, alpha; found shape {table.shape}"
            )
        n = len(table)
        if joint_names is None:
            names = tuple(f"joint{i + 1}" for i in range(n))
        else:
            names = check_names(joint_names, "joint_names")
        kinds = [REVOLUTE] * n if kinds is None else kinds
        for key, values in (("joint_names", names), ("kinds", kinds)):
            if len(values) != n:
                raise InvalidInputError(
                    f"{key} must have {n} entries, one for each row; found {len(values)}"
                )
        low, high = _dh_limits(lower, upper, names)

        placement = np.eye(4) if base is None else as_pose(base, "base")
        joints = []
        frames = {"base": Frame(0, placement)}
        for i, (theta, d, a, alpha) in enumerate(table):
            kind = as_choice(kinds[i], f"kinds[{i}]", (REVOLUTE, PRISMATIC))
            joints.append(Joint(names[i], kind, np.eye(3)[2], placement))
            placement = pose((0, 0, d), (0, 0, theta)) @ pose((a, 0, 0), (alpha, 0, 0))
            frames[f"link{i + 1}"] = Frame(i + 1, placement)
        chain = Chain(
            name=name,
            joints=tuple(joints),
            frames=frames,
            frame=f"link{n}",
            coordinates=names,
            lower=low,
            upper=high,
            coupling=np.eye(n),
            offset=np.zeros(n),
        )
        return cls(chain)

    @classmethod
    def of(
        cls,
        model: "pinocchio.Model | mujoco.MjModel | yourdfpy.URDF",
        frame: str | None = None,
        joints: Sequence[str] | None = None,
        *,
        base: str | None = None,
        lock: Mapping[str, float] | None = None,
    ) -> "Arm":
        """Make an arm from a robot model that the program already holds.

        Parameters
        ----------
        model : pinocchio.Model, mujoco.MjModel or yourdfpy.URDF
            It is read once; later changes of the object have no effect. A model of Pinocchio has
            no shapes, so that collisions are not checked.
        frame, joints, base, lock
            As for `maniport.load_arm`.

        Raises
        ------
        InvalidInputError
            When `model` is of another type, or a prismatic joint of the arm has no limits.
        UnknownNameError
            When there is no frame or joint of a name.

        Examples
        --------
        >>> import pinocchio
        >>> Arm.of(pinocchio.buildSampleModelManipulator()).dof
        6
        """
        from maniport.arms.loaders.objects import arm_of

        return arm_of(model, frame, joints, base, lock)

    def __repr__(self) -> str:
        return f"Arm({self.name!r}, dof={self.dof}, frame={self.frame!r}, joints={list(self.joint_names)})"

    def __reduce__(self) -> tuple[type["Arm"], tuple[Chain]]:
        return type(self), (self.chain,)

    def restricted(
        self,
        frame: str | None = None,
        joints: Sequence[str] | None = None,
        base: str | None = None,
        lock: Mapping[str, float] | None = None,
    ) -> "Arm":
        """Return the arm with another end effector or base, or with some joints only; see `maniport.load_arm`."""
        return Arm(restrict(self.chain, frame, joints, base, lock))

    def narrowed(self, lower: ArrayLike, upper: ArrayLike) -> "Arm":
        """Return the arm with narrower joint limits, shape (dof,); wider ones raise `InvalidInputError`."""
        low = as_numbers(lower, "lower", self.dof)
        high = as_numbers(upper, "upper", self.dof)
        wrong = (low < self.lower) | (high > self.upper) | (low > high)
        if np.any(wrong):
            i = int(wrong.argmax())
            raise InvalidInputError(
                f"joint {self.joint_names[i]!r} of {self.name!r} must have limits within {self.lower[i]:g} to "
                f"{self.upper[i]:g}; found {low[i]:g} to {high[i]:g}"
            )
        return self._changed(lower=low, upper=high)

    def with_limits(
        self, velocity: ArrayLike | None = None, effort: ArrayLike | None = None
    ) -> "Arm":
        """Return the arm with other velocity limits [rad/s, m/s] or effort limits [N m, N], shape (dof,) or numbers."""
        changes = {}
        for key, value in (("velocity_limits", velocity), ("effort_limits", effort)):
            if value is not None:
                changes[key] = as_numbers(value, key, self.dof, broadcast=True, above=0.0)
        return self._changed(**changes)

    def with_payload(self, mass: float, center: ArrayLike = (0.0, 0.0, 0.0)) -> "Arm":
        """Return the arm with a payload [kg], a point mass at `center` (3,) [m] in the frame of the end effector.

        `InvalidInputError` for a negative mass, and for an arm without masses.
        """
        amount = as_number(mass, "mass", minimum=0.0)
        point = as_numbers(center, "center", 3)
        if self.chain.inertia is None:
            raise InvalidInputError(
                f"a payload needs masses, and the description of {self.name!r} has none"
            )
        inertia = self.chain.inertia.copy()
        end_frame = self.chain.frames[self.frame]
        inertia[end_frame.joint] += point_mass(
            amount, end_frame.placement[:3, :3] @ point + end_frame.placement[:3, 3]
        )
        return self._changed(inertia=inertia, payload=self.chain.payload + amount)

    def _changed(self, **fields: Any) -> "Arm":
        """Return the arm with other fields of its chain and the same cache of meshes."""
        arm = Arm(replace(self.chain, **fields))
        arm.geometry = self.geometry
        return arm

    def forward(self, q: ArrayLike) -> Array:
        """Compute poses of the end effector in the base frame [m], shape (..., 4, 4)."""
        return self._motions(q, with_jacobians=False)[0]

    def motion(self, q: ArrayLike) -> tuple[Array, Array]:
        """Return the results of `forward` and `jacobian`."""
        return self._motions(q)[:2]

    def jacobian(self, q: ArrayLike) -> Array:
        """Compute geometric Jacobians of the end effector, shape (..., 6, dof).

        Rows 0 to 2: linear velocity of its origin; rows 3 to 5: angular velocity; both in the base frame.
        """
        return self._motions(q)[1]

    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Compute the manipulability matrices (..., d, d) of a specification; see `manipulability`."""
        return self.posed_ellipsoids(q, spec)[1]

    def posed_ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array]:
        """Return the results of `forward` and `ellipsoids`."""
        poses, jacobians, _ = self._motions(q)
        weight = self._weights(q, spec)[0]
        rows = jacobians[..., spec.rows, :]
        if weight is not None:
            rows = (rows.reshape(-1, *rows.shape[-2:]) * weight).reshape(rows.shape)
        return poses, manipulability(rows, spec.kind)

    def posed_differentials(
        self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY
    ) -> tuple[Array, Array, Array, Array]:
        """Return the results of `forward`, `jacobian` and `ellipsoids`, and derivatives of the latter.

        Derivatives ``∂M/∂q_k`` have shape (..., dof, d, d), symmetric, in closed form; see
        `maniport.arms.kernels.fill_derivatives`. Units are those of M per radian or meter.
        """
        poses, jacobians, of_joints = self._motions(q)
        flat = jacobians.reshape(-1, 6, self.dof)
        weights = self._weights(q, spec, changes=True)
        coupling = self._kinematics.coupling
        ellipsoids, changes = with_derivatives(flat, of_joints, coupling, spec, *weights)
        leading = poses.shape[:-2]
        ellipsoids = ellipsoids.reshape(*leading, *ellipsoids.shape[1:])
        changes = changes.reshape(*leading, *changes.shape[1:])
        return poses, jacobians, ellipsoids, changes

    def gravity_torques(self, q: ArrayLike) -> Array:
        """Compute the joint torques that hold the arm against gravity, shape (..., dof) [N m] or [N].

        `InvalidInputError` for an arm without masses.
        """
        array = self.configurations(q)
        if self.chain.inertia is None:
            raise InvalidInputError(f"the description of {self.name!r} has no masses")
        gravity = self._kinematics.gravity(array.reshape(-1, self.dof))
        return gravity.torques.reshape(array.shape)

    def remaining_torques(self, q: ArrayLike, *, derivatives: bool = True) -> RemainingTorques:
        """Compute the torques that gravity leaves for forces and, if wanted, their derivatives.

        They are effort limits less the absolute values of gravity torques, at least `LEAST_TORQUE` of the limit;
        without masses, or in a world without gravity, they are the limits. `InvalidInputError` without effort limits.
        """
        array = self.configurations(q).reshape(-1, self.dof)
        limits = self._limits("force")
        if not self._kinematics.has_weight:
            torques = np.tile(limits, (len(array), 1))
            return RemainingTorques(torques, np.zeros((*array.shape, self.dof)))
        return remaining_torques(limits, self._kinematics.gravity(array, derivatives))

    def _weights(
        self, q: ArrayLike, spec: EllipsoidSpec, changes: bool = False
    ) -> tuple[Array | None, Array | None]:
        """Weights of the joints for a specification at checked configurations."""
        if isinstance(self.checked_spec(spec).joint_weights, str):
            limits = self._limits(spec.kind)
        else:
            limits = None
        flat = np.asarray(q, dtype=np.float64).reshape(-1, self.dof)
        return weighting(spec, self._kinematics, limits, flat, changes)

    def _motions(self, q: ArrayLike, with_jacobians: bool = True) -> tuple[Array, Array, Array]:
        """Results of `forward` and `jacobian`, and Jacobians (n, 6, joints) in the joints of the chain."""
        array = self.configurations(q)
        flat = array.reshape(-1, self.dof)
        poses, of_joints = self._kinematics.motion(flat, with_jacobians)
        shape = array.shape[:-1]
        jacobians = self._kinematics.coupled(of_joints)
        if with_jacobians:
            jacobians = jacobians.reshape(*shape, 6, self.dof)
        return poses.reshape(*shape, 4, 4), jacobians, of_joints

    def point_positions(self, q: ArrayLike, frames: Sequence[str]) -> Array:
        """Compute the origins of frames [m], shape (..., len(frames), 3)."""
        return self._points(q, frames)[0]

    def point_jacobians(self, q: ArrayLike, frames: Sequence[str]) -> Array:
        """Compute linear Jacobians of the origins of frames, shape (..., len(frames), 3, dof)."""
        return self._points(q, frames)[1]

    def _points(self, q: ArrayLike, frames: Sequence[str]) -> tuple[Array, Array]:
        names = check_names(frames, "frames")
        array = self.configurations(q)
        for name in names:
            if name not in self.frames:
                raise unknown_name("frame", name, self.frames, f"on the arm {self.name!r}")
        points, slopes = PointKinematics(self.chain, names)(array.reshape(-1, self.dof))
        shape = (*array.shape[:-1], len(names), 3)
        return points.reshape(shape), slopes.reshape(*shape, self.dof)

    def axis_direction(self, q: ArrayLike, joint_name: str) -> Array:
        """Compute the axis of a joint in the base frame, unit vectors of shape (..., 3).

        A revolute joint rotates about this direction by the right-hand rule; a prismatic joint moves along it.
        """
        joints = {joint.name: joint for joint in self.chain.joints}
        if joint_name not in joints:
            raise unknown_name("joint", joint_name, joints, f"on the arm {self.name!r}")
        return np.asarray(
            self.link_poses(q)[..., 1 + [*joints].index(joint_name), :3, :3]
            @ joints[joint_name].axis
        )

    def skeleton(self, q: ArrayLike) -> Array:
        """Compute the polyline from the base through the joints to the end effector, shape (..., k, 3) [m]."""
        points = self.link_poses(q)[..., :3, 3]
        joints = self.chain.joints
        end_frame = self.chain.frames[self.frame]
        if self.chain.base_pose is not None:
            points[..., 0, :] = self.chain.base_pose[:3, 3]
        corners = [0]
        for i, joint in enumerate(joints, 1):
            if np.any(joint.placement[:3, 3]) or joint.kind == PRISMATIC:
                corners.append(i)
        points = points[..., corners, :]
        if np.any(end_frame.placement[:3, 3]) or len(corners) == 1:
            points = np.concatenate([points, self.forward(q)[..., None, :3, 3]], axis=-2)
        return points

    def link_poses(self, q: ArrayLike) -> Array:
        """Compute poses of the base and of the frame after each joint [m], shape (..., joints + 1, 4, 4).

        `Surface.joint` is an index into them; all joints of the chain count, also locked and mimic joints.
        """
        array = self.configurations(q)
        rotations, origins = self._kinematics.link_poses(array.reshape(-1, self.dof))
        poses = np.zeros((*origins.shape[:2], 4, 4))
        poses[..., :3, :3] = rotations
        poses[..., :3, 3] = origins
        poses[..., 3, 3] = 1.0
        return poses.reshape(*array.shape[:-1], *poses.shape[1:])

    def surfaces(self) -> tuple[Surface, ...]:
        """Return the visual meshes of the arm by joint; files are read on the first call.

        Bodies beyond the end effector and moving fingers are omitted. Links without visual shapes, or with missing
        visual meshes, have their collision shapes. Meshes with more than 15 000 triangles in total are simplified to
        about that.

        Returns
        -------
        tuple of Surface
            One for each joint index with shapes, ascending; empty if the description has no shapes. `FileFormatError`
            when the robot's file or a mesh is missing or cannot be read.
        """
        return self.geometry.surfaces
