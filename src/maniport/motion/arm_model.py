"""Models of arms for Pinocchio, joint torques, the axis that an arm turns about, and requirements of motions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.chain import PRISMATIC
from maniport.arms.restriction import carried_inertia
from maniport.errors import InvalidInputError
from maniport.util.validation import Array


def robot_model(arm: Arm | ArmGroup) -> pin.Model:
    """Make a Pinocchio model of an arm or a group of arms.

    Its configuration vector, limits and gravity are those of the arm; limits of velocity and effort are infinite where
    unknown, and masses zero where the description has none. Frames keep their names, and locked joints are fixed.
    Shared joints of a group exist once; frames of several robots have the prefixes of the group's joints.

    Returns
    -------
    pinocchio.Model

    Raises
    ------
    InvalidInputError
        When joints of the arm are coupled, as in the shoulder girdle of ``"myoarm"``: a Pinocchio model has a
        coordinate for each joint.

    Examples
    --------
    >>> import maniport as mp
    >>> model = robot_model(mp.load_arm("panda"))
    >>> model.nq, model.existFrame("panda_link8")
    (7, True)
    """
    model = pin.Model()
    model.name = arm.name
    group = as_group(arm)
    places = list[list[Place]]()
    for i, (member, prefix) in enumerate(zip(group.arms, model_prefixes(group), strict=True)):
        before = group.common[i, :i]
        if i:
            shared = places[int(before.argmax())][: int(before.max()) + 1]
        else:
            shared = []
        places.append(_add_arm(model, member, prefix, shared))
        _add_masses(model, group, i, places[-1])
    model.gravity.linear = np.array(group.arms[0].chain.gravity)
    model.lowerPositionLimit = arm.lower
    model.upperPositionLimit = arm.upper
    unknown = np.full(arm.dof, np.inf)
    if arm.velocity_limits is None:
        model.velocityLimit = unknown
    else:
        model.velocityLimit = arm.velocity_limits
    model.effortLimit = unknown if arm.effort_limits is None else arm.effort_limits
    return model


Place = tuple[int, pin.SE3]  # A joint of a model, and a pose in its frame


def _add_arm(model: pin.Model, arm: Arm, prefix: str, shared: Sequence[Place]) -> list[Place]:
    """Add the joints and frames of an arm beyond the shared ones; return the place after each joint of its chain."""
    chain = arm.chain
    parents = list(shared) or [(0, pin.SE3.Identity())]
    joints = list(zip(chain.joints, _own_coordinates(arm), chain.offset, strict=True))
    for joint, factor, offset in joints[len(parents) - 1 :]:
        parent, place = parents[-1]
        if joint.kind == PRISMATIC:
            kind = pin.JointModelPrismaticUnaligned
            shift = pin.SE3(np.eye(3), offset * joint.axis)
        else:
            kind = pin.JointModelRevoluteUnaligned
            shift = pin.SE3(pin.exp3(offset * joint.axis), np.zeros(3))
        place = place * pin.SE3(joint.placement) * shift
        if factor != 0.0:
            name = prefix + joint.name
            parent = model.addJoint(parent, kind(factor * joint.axis), place, name)
            place = pin.SE3.Identity()
            model.armature[-1] = joint.armature
        parents.append((parent, place))
    for name, frame in chain.frames.items():
        parent, place = parents[frame.joint]
        if not model.existFrame(prefix + name):
            pose = place * pin.SE3(frame.placement)
            model.addFrame(pin.Frame(prefix + name, parent, 0, pose, pin.FrameType.OP_FRAME))
    return parents


def _add_masses(model: pin.Model, group: ArmGroup, arm: int, places: Sequence[Place]) -> None:
    """Add the masses of an arm of a group to its links that no earlier arm has."""
    chain = group.arms[arm].chain
    if chain.inertia is None:
        return
    inertia = chain.inertia.copy()
    shared = int(group.common[arm, :arm].max(initial=0))
    for other in range(arm + 1, len(group)):  # has masses of its own beyond the common links
        fork = int(group.common[arm, other])
        other_chain = group.arms[other].chain
        if (
            fork
            and other_chain.inertia is not None
            and (group.common[other, arm + 1 : other] <= fork).all()
        ):
            inertia[fork] -= carried_inertia(other_chain, fork)
    for k in range(shared + 1 if shared else 1, len(inertia)):  # the base does not move
        joint, place = places[k]
        mass = inertia[k, 0, 0]
        if mass > 1e-9:
            center = inertia[k, [5, 3, 4], [1, 2, 0]] / mass
            about_center = inertia[k, 3:, 3:] + mass * pin.skewSquare(center, center)
            model.appendBodyToJoint(joint, pin.Inertia(mass, center, about_center), place)


def model_prefixes(group: ArmGroup) -> tuple[str, ...]:
    """Return the prefixes of each arm's joints and frames: none where all names are different."""
    same = any(group.prefixes) or len({arm.frame for arm in group.arms}) < len(group)
    return tuple(f"{name}_" * same for name in group.names)


def _own_coordinates(arm: Arm) -> Array:
    """How each joint of the chain follows its own coordinate: 1 or −1, or 0 where it is locked."""
    coupling = arm.chain.coupling
    moving = coupling[np.any(coupling != 0, axis=1)]
    if moving.shape != (arm.dof, arm.dof) or not np.array_equal(np.abs(moving), np.eye(arm.dof)):
        follow_one = (np.count_nonzero(coupling, axis=0) == 1) & np.all(
            np.isin(np.abs(coupling), (0, 1)), axis=0
        )
        shared = []
        for name, follows_one in zip(arm.joint_names, follow_one, strict=True):
            if not follows_one:
                shared.append(name)
        raise InvalidInputError(
            f"{arm.name!r} cannot be tracked: its joints are coupled ({', '.join(shared or arm.joint_names)}), while "
            "tracking needs one joint for each degree of freedom, in order from base to end effector. A robot's arm "
            "without mimic joints has that"
        )
    return np.asarray(coupling.sum(axis=1))


class InverseDynamics:
    """Torques of an arm or a group of arms with masses, by Pinocchio's recursive Newton-Euler algorithm."""

    def __init__(self, arm: Arm | ArmGroup):
        self.arm = arm
        self._model = robot_model(arm)
        self._data = self._model.createData()

    def __reduce__(self) -> tuple[type["InverseDynamics"], tuple[Arm | ArmGroup]]:
        return type(self), (self.arm,)

    def torques(self, q: Array, velocities: Array, accelerations: Array) -> Array:
        """Torques H q̈ + C q̇ + g at n states, each of shape (n, dof); the result is [N m] or [N]."""
        result = np.empty(q.shape)
        for row, state in enumerate(zip(q, velocities, accelerations, strict=True)):
            result[row] = pin.rnea(self._model, self._data, *state)
        return result

    def gravity(self, q: Array) -> Array:
        """Torques g at n configurations (n, dof) [N m] or [N]."""
        return np.array([pin.computeGeneralizedGravity(self._model, self._data, row) for row in q])

    def along(self, q: Array, first: Array, second: Array) -> tuple[Array, Array, Array]:
        """Return a, b and g of the torques a s̈ + b ṡ² + g on a path q(s) with derivatives `first` and `second`."""
        still = np.zeros(q.shape)
        gravity = self.gravity(q)
        return (
            self.torques(q, still, first) - gravity,
            self.torques(q, first, second) - gravity,
            gravity,
        )


def require_trackable(arm: Arm, spec: EllipsoidSpec = VELOCITY) -> None:
    """Raise InvalidInputError unless an arm has enough joints, none of them coupled, to follow such ellipsoids."""
    if arm.dof < 3:
        d = spec.size
        raise InvalidInputError(
            f"{arm.name!r} has {arm.dof} joint{'s' * (arm.dof > 1)} ({', '.join(arm.joint_names)}); following {d}×{d} "
            f"ellipsoids needs at least 3, and {d * (d + 1) // 2} to follow all of their shape"
        )
    _own_coordinates(arm)


def require_compatible(
    what: str, arms: tuple[Arm, Arm], specs: tuple[EllipsoidSpec, EllipsoidSpec]
) -> None:
    """Raise InvalidInputError unless something made for the first arm and ellipsoids serves the second."""
    there, here = arms
    properties = {
        "joints": (there.joint_names, here.joint_names),
        "end effector": (there.frame, here.frame),
        "base": (there.base, here.base),
        "held joints": (dict(there.locked), dict(here.locked)),
        "ellipsoids": specs,
    }
    different = []
    for name, (value, found) in properties.items():
        if value != found:
            different.append(f"{name}: {value!r} there, {found!r} here")
    if different:
        raise InvalidInputError(
            f"{what} {arms[0].name!r}; it does not fit {arms[1].name!r}: {'; '.join(different)}"
        )


@dataclass(frozen=True)
class Axis:
    """A fixed line about which the first joint turns the whole arm."""

    frame: Array  # (3, 3); rows: two directions across the line and the one along it
    origin: Array  # (3,); point of the line next to the base [m]

    @classmethod
    def of(cls, jacobian: Array, end_positions: Array) -> "Axis | None":
        """Find the line from the first columns of Jacobians (n, 6, dof) and the positions there (n, 3)."""
        direction = jacobian[:, 3:, 0]
        moment = jacobian[:, :3, 0] - np.cross(direction, end_positions)
        turns = abs(np.linalg.norm(direction[0]) - 1.0) < 1e-9
        if (
            not turns
            or np.ptp(direction, axis=0).max() > 1e-9
            or np.ptp(moment, axis=0).max() > 1e-9
        ):
            return None
        across = np.linalg.svd(direction[:1])[2][1:]
        across[1] = np.cross(direction[0], across[0])
        return cls(np.vstack([across, direction[0]]), np.cross(direction[0], moment[0]))

    def cylindrical(self, points: Array) -> tuple[Array, Array]:
        """Distance from the line and position along it (..., 2) [m], and angle about it (...) [rad]."""
        local = (points - self.origin) @ self.frame.T
        radius = np.hypot(local[..., 0], local[..., 1])
        return np.stack([radius, local[..., 2]], axis=-1), np.arctan2(local[..., 1], local[..., 0])

    def rotations(self, angles: Array) -> Array:
        """Rotations about the line, shape (..., 3, 3)."""
        vectors = angles[..., None] * self.frame[2]
        return np.asarray(
            Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*angles.shape, 3, 3)
        )
