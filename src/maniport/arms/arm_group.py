"""A group of arms: chains in one frame, of one robot or of several, over the union of their joints."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from maniport.arms.arm import Arm
from maniport.arms.chain import Chain
from maniport.arms.joint_space import JointSpace, Manipulable
from maniport.arms.kinematics import DynamicsTerms, Kinematics
from maniport.arms.manipulability import VELOCITY, EllipsoidSpec
from maniport.errors import InvalidInputError, typed
from maniport.util.validation import Array, as_choice, as_numbers

FACTORS: Mapping[str, tuple[float, float]] = {"relative": (-1.0, 1.0), "absolute": (0.5, 0.5)}  # of both Jacobians


class ArmGroup(JointSpace):
    """One or more arms over the union of their joints. Make one with `maniport.load_arms` or from arms.

    Configurations `q` have shape (..., dof): the joints of the first arm in their order, then those of each further arm
    that it does not share with an earlier one. Positions and directions are expressed in the common base frame.

    Parameters
    ----------
    *arms : Arm
        Joints with which several chains begin, such as those of a torso, are shared. `InvalidInputError` when base
        frames differ, one arm is a part of another, or shared joints differ in limits or locked positions.
    names : sequence of str, optional
        Names of the arms, such as ``("left", "right")``; ``("arm1", "arm2", …)`` by default.

    Attributes
    ----------
    arms, names, columns : tuple
        Arms, names and indices of each arm's joints in `q`.
    shared : tuple of str
        Names of the joints that move more than one arm.
    common : ndarray of int, shape (n_arms, n_arms)
        Number of joints, locked ones included, with which two chains begin in common.
    joint_names
        As the other attributes those of `maniport.arms.Arm`, with the name of the arm as a prefix where joints of two
        robots have the same name.
    """

    def __init__(self, *arms: Arm, names: Sequence[str] | None = None):
        for i, arm in enumerate(arms):
            if not isinstance(arm, Arm):
                raise InvalidInputError(f"arms[{i}] must be an Arm, as load_arm makes it; found {type(arm).__name__}")
        self.arms = arms
        self.names = tuple(f"arm{i + 1}" for i in range(len(arms))) if names is None else tuple(names)
        if not arms or len(set(self.names)) != len(arms):
            raise InvalidInputError(
                f"names must be one for each of {len(arms)} arms, all different; found {self.names}"
            )
        self.common, shared = _shared_joints([arm.chain for arm in arms], self.names)
        self.shared = tuple(dict.fromkeys(name for _, _, moving in shared for name in moving))
        self.frames = tuple(dict.fromkeys(frame for arm in arms for frame in arm.frames))
        own: list[tuple[int, int]] = []  # arm and joint of each column
        columns: list[NDArray[np.intp]] = []
        for i, arm in enumerate(arms):
            earlier = {name: (k, arms[k].joint_names.index(name)) for k, j, same in shared if j == i for name in same}
            at = [earlier.get(name, (i, k)) for k, name in enumerate(arm.joint_names)]
            columns.append(np.empty(arm.dof, dtype=np.intp))
            for k, (owner, joint) in enumerate(at):
                if owner == i:
                    own.append((i, joint))
                columns[-1][k] = len(own) - 1 if owner == i else columns[owner][joint]
        self.columns = tuple(columns)
        joints = [arms[i].joint_names[k] for i, k in own]
        self.prefixes = tuple(f"{name}_" * (len(set(joints)) < len(joints)) for name in self.names)
        self.locked = {self.prefixes[i] + name: at for i, arm in enumerate(arms) for name, at in arm.locked.items()}
        super().__init__(
            "+".join(dict.fromkeys(arm.name for arm in arms)),
            tuple(self.prefixes[i] + joint for (i, _), joint in zip(own, joints, strict=True)),
            np.array([arms[i].lower[k] for i, k in own]),
            np.array([arms[i].upper[k] for i, k in own]),
            _joined_limits([arm.velocity_limits for arm in arms], arms, own),
            _joined_limits([arm.effort_limits for arm in arms], arms, own),
            tuple(arms[i].joint_units[k] for i, k in own),
        )

    def __repr__(self) -> str:
        frames = {name: arm.frame for name, arm in zip(self.names, self.arms, strict=True)}
        return f"ArmGroup({self.name!r}, dof={self.dof}, frames={frames}, shared={list(self.shared)})"

    def __len__(self) -> int:
        return len(self.arms)

    def __reduce__(self) -> tuple[Any, tuple[Arm, ...]]:
        return partial(type(self), names=self.names), self.arms

    @cached_property
    def kinematics(self) -> Kinematics:
        """Links of all arms as one tree."""
        return Kinematics(*(arm.chain for arm in self.arms), columns=self.columns, dof=self.dof, common=self.common)

    def split(self, q: ArrayLike) -> tuple[Array, ...]:
        """Return the configurations of each arm, shapes (..., arm.dof)."""
        array = self.configurations(q)
        return tuple(array[..., columns] for columns in self.columns)

    def joined(self, *parts: ArrayLike) -> Array:
        """Return configurations of the group, shape (..., dof), from those of its arms (equal on shared joints)."""
        if len(parts) != len(self.arms):
            raise InvalidInputError(f"configurations must be of {len(self.arms)} arms; found {len(parts)}")
        arrays = [
            arm.configurations(part, f"configurations of {name}")
            for arm, part, name in zip(self.arms, parts, self.names, strict=True)
        ]
        shapes = {array.shape[:-1] for array in arrays}
        if len(shapes) > 1:
            raise InvalidInputError(f"configurations of all arms must have the same leading shape; found {shapes}")
        q = np.empty((*shapes.pop(), self.dof))
        for array, columns in reversed(list(zip(arrays, self.columns, strict=True))):
            q[..., columns] = array
        for array, columns, name in zip(arrays, self.columns, self.names, strict=True):
            difference = np.abs(q[..., columns] - array)
            if np.any(difference > 1e-9):
                worst = np.unravel_index(difference.argmax(), difference.shape)
                raise InvalidInputError(
                    f"the arms must agree on the shared joint {self.joint_names[columns[worst[-1]]]!r}; found "
                    f"{array[worst]:.6g} for {name}, {q[..., columns][worst]:.6g} for an earlier arm"
                )
        return q

    def narrowed(self, lower: ArrayLike, upper: ArrayLike) -> "ArmGroup":
        """Return the group with closer joint limits, shape (dof,); wider ones raise `InvalidInputError`."""
        low, high = as_numbers(lower, "lower", self.dof), as_numbers(upper, "upper", self.dof)
        arms = (arm.narrowed(low[c], high[c]) for arm, c in zip(self.arms, self.columns, strict=True))
        return ArmGroup(*arms, names=self.names)

    def forward(self, q: ArrayLike) -> Array:
        """Compute the poses of all end effectors, shape (..., n_arms, 4, 4) [m]."""
        return np.stack([arm.forward(part) for arm, part in zip(self.arms, self.split(q), strict=True)], axis=-3)

    def jacobian(self, q: ArrayLike) -> Array:
        """Compute the geometric Jacobians in all joints, shape (..., n_arms, 6, dof), linear rows first."""
        parts = self.split(q)
        jacobians = np.zeros((*parts[0].shape[:-1], len(self.arms), 6, self.dof))
        for i, (arm, part, columns) in enumerate(zip(self.arms, parts, self.columns, strict=True)):
            jacobians[..., i, :, columns] = np.moveaxis(arm.jacobian(part), -1, 0)
        return jacobians

    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Compute the manipulability matrices of all arms, shape (..., n_arms, d, d); weights are for all joints."""
        parts = zip(self.arms, self.split(q), self.specs(spec), strict=True)
        return np.stack([arm.ellipsoids(part, own) for arm, part, own in parts], axis=-3)

    def specs(self, spec: EllipsoidSpec) -> tuple[EllipsoidSpec, ...]:
        """Return the specification of each arm: numbers as joint weights of the group are split."""
        if not isinstance(spec, EllipsoidSpec) or spec.joint_weights is None or isinstance(spec.joint_weights, str):
            return tuple(arm.checked_spec(spec) for arm in self.arms)
        weights = np.array(self.checked_spec(spec).joint_weights)
        own = (replace(spec, joint_weights=weights[columns]) for columns in self.columns)
        return tuple(arm.checked_spec(part) for arm, part in zip(self.arms, own, strict=True))

    @cached_property
    def relative(self) -> "CooperativeArm":
        """Motion of the second end effector relative to the first, of a group of two arms."""
        return CooperativeArm(self, "relative")

    @cached_property
    def absolute(self) -> "CooperativeArm":
        """Mean motion of both end effectors, of a group of two arms."""
        return CooperativeArm(self, "absolute")


def as_group(arm: Arm | ArmGroup) -> ArmGroup:
    """Return a group as it is and a single arm as a group of one, which has its joint names."""
    return arm if isinstance(arm, ArmGroup) else ArmGroup(arm)


class CooperativeArm(Manipulable):
    """The relative or the absolute motion of two end effectors, over all joints of their group.

    With v_i and ω_i the velocities of the two end effectors, all along the axes of the common frame,

        relative   v_r = v_2 − v_1,         ω_r = ω_2 − ω_1,         J_r = J_2 − J_1
        absolute   v_a = ½ (v_1 + v_2),     ω_a = ½ (ω_1 + ω_2),     J_a = ½ (J_1 + J_2)

    (the cooperative task space: Uchiyama & Dauchez, ICRA 1988; Chiacchio, Chiaverini & Siciliano, J. Dyn. Syst. Meas.
    Control 118, 1996). Where no joint is shared, M_r = M_1 + M_2 and M_a = ¼ M_r. It has the methods of an arm.
    Relative poses: the vector from the first end effector to the second, along the common axes, and the rotation of
    the second in the frame of the first. Absolute poses: the midpoint, and the rotation halfway, undefined at 180°.

    Parameters
    ----------
    group, kind : ArmGroup, {"relative", "absolute"}
    pair : (int, int), optional
        Indices of the two arms; by default those of a group of two.
    """

    def __init__(self, group: ArmGroup, kind: str, pair: tuple[int, int] | None = None):
        limits = group.lower, group.upper, group.velocity_limits, group.effort_limits
        super().__init__(group.name, group.joint_names, *limits, group.joint_units)
        if pair is None and len(group) != 2:
            raise InvalidInputError(f"pair must name two arms by index, since the group has {len(group)}; found None")
        self.arms, self.kind, self.pair = group, as_choice(kind, "kind", FACTORS), pair or (0, 1)
        if len(set(self.pair)) != 2 or not set(self.pair) <= set(range(len(group))):
            raise InvalidInputError(f"pair must be two different indices below {len(group)}; found {self.pair}")
        self.frame = f"{kind}: {', '.join(group.arms[i].frame for i in self.pair)}"
        self.base, self.locked = group.arms[0].base, group.locked
        self._parts = [
            (factor, Kinematics(group.arms[i].chain, columns=[group.columns[i]], dof=group.dof))
            for factor, i in zip(FACTORS[kind], self.pair, strict=True)
        ]

    def __repr__(self) -> str:
        return f"CooperativeArm({self.arms!r}, {self.kind!r}, {self.pair})"

    def __reduce__(self) -> tuple[type["CooperativeArm"], tuple[ArmGroup, str, tuple[int, int]]]:
        return type(self), (self.arms, self.kind, self.pair)

    def _dynamics_terms(self, q: Array, gravity: bool, inertia: bool, changes: bool) -> DynamicsTerms | None:
        """Terms of both arms, of a shared joint those of the first; its inertia couples both, which chains omit."""
        if inertia and self.arms.shared:
            raise InvalidInputError(
                "kind 'acceleration' of two arms needs arms without shared joints; found " + ", ".join(self.arms.shared)
            )
        n, dof = q.shape
        result = DynamicsTerms(*(np.zeros((n, *[dof] * size)) for size in (1, 2, 2, 3)))
        for i in sorted(self.pair, reverse=True):
            columns = self.arms.columns[i]
            own = self.arms.arms[i]._dynamics_terms(q[:, columns], gravity, inertia, changes)
            if own is None:
                return None
            for target, part in zip(result, own, strict=True):
                if len(part):
                    target[np.ix_(np.arange(n), *[columns] * (target.ndim - 1))] = part
        still = np.setdiff1d(np.arange(dof), np.concatenate([self.arms.columns[i] for i in self.pair]))
        result.inertia[:, still, still] = 1.0  # of the other arms: any positive number makes H regular
        return result

    def _pose(self, poses: Sequence[Array]) -> Array:
        first, second = poses
        factors, rotation = FACTORS[self.kind], np.swapaxes(first[:, :3, :3], -1, -2) @ second[:, :3, :3]
        result = np.zeros(first.shape)
        result[:, :3, 3], result[:, 3, 3] = factors[0] * first[:, :3, 3] + factors[1] * second[:, :3, 3], 1.0
        if self.kind == "absolute" and rotation.size:
            half = Rotation.from_rotvec(0.5 * Rotation.from_matrix(rotation).as_rotvec())
            rotation = first[:, :3, :3] @ half.as_matrix()
        result[:, :3, :3] = rotation
        return result


def _joined_limits(limits: Sequence[Array | None], arms: Sequence[Arm], own: Sequence[tuple[int, int]]) -> Array | None:
    """Limits of the joints of a group, (arm, joint) each; infinite where unknown, None if all are."""
    parts = [np.full(arm.dof, np.inf) if part is None else part for part, arm in zip(limits, arms, strict=True)]
    joined = np.array([parts[i][k] for i, k in own])
    return None if np.all(np.isinf(joined)) else joined


def _shared_joints(
    chains: Sequence[Chain], names: Sequence[str]
) -> tuple[NDArray[np.intp], list[tuple[int, int, tuple[str, ...]]]]:
    """Numbers of common joints (n_arms, n_arms), and the coordinates that move them for each pair of arms.

    An error when chains do not share their base, end on one another, or differ in the limits of common joints.
    """
    common = np.diag([len(chain.joints) for chain in chains]).astype(np.intp)
    shared = []
    for i, j in combinations(range(len(chains)), 2):
        first, second = chains[i], chains[j]
        if first.base != second.base:
            ends = " and ".join(repr(chain.base or "the robot's base") for chain in (first, second))
            raise InvalidInputError(f"all arms must have the same base frame; found {ends}")
        pairs = list(zip(first.joints, second.joints, strict=False))
        differences = (
            k for k, (a, b) in enumerate(pairs)
            if (a.name, a.kind) != (b.name, b.kind)
            or not (np.array_equal(a.axis, b.axis) and np.array_equal(a.placement, b.placement))
        )  # fmt: skip
        count = next(differences, len(pairs))
        if count in (len(first.joints), len(second.joints)):
            where = "" if first.stand is None else f", which stand in one place; place them with {placing_options()}"
            raise InvalidInputError(
                f"frames: {first.frame!r} and {second.frame!r} must end two limbs; found both on one chain of "
                f"{first.name!r}{where}"
            )
        moving: list[dict[str, Any]] = []
        ranges = []
        for chain in (first, second):
            limits = zip(chain.coordinates, chain.lower, chain.upper, chain.coupling[:count].T, strict=True)
            own = {name: (low, high, column.tolist()) for name, low, high, column in limits if np.any(column)}
            locked = {joint.name: f"locked at {at:g}" for joint, at in zip(chain.joints, chain.offset, strict=True)}
            moving.append(own)
            ranges.append({**locked, **{name: f"{low:g} to {high:g}" for name, (low, high, _) in own.items()}})
        differ = [name for name in moving[0] | moving[1] if moving[0].get(name) != moving[1].get(name)]
        differ += [first.joints[k].name for k in np.flatnonzero(first.offset[:count] != second.offset[:count])]
        if differ:
            raise InvalidInputError(
                f"the joint {differ[0]!r} carries two arms and must have the same limits, or be locked at one "
                f"position; found {ranges[0].get(differ[0])} for {names[i]}, {ranges[1].get(differ[0])} for {names[j]}"
            )
        common[i, j] = common[j, i] = count
        shared.append((i, j, tuple(moving[0])))
    return common, shared


def placing_options() -> str:
    """Describe the options that place several robots, for messages."""
    text = "--pose of each, such as 0,0.3,0,0 and 0,-0.3,0,0"
    return text if typed() else "bases=, such as ((0, 0.3, 0), (0, -0.3, 0))"
