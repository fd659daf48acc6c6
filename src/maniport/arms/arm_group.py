"""A group of arms: chains in one frame, of one robot or of several, over the union of their joints."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms.arm import Arm
from maniport.arms.chain import Chain
from maniport.arms.joint_space import JointSpace
from maniport.arms.kinematics import Kinematics
from maniport.arms.manipulability import VELOCITY, EllipsoidSpec, manipulability
from maniport.arms.restriction import carried_inertia
from maniport.errors import InvalidInputError, typed
from maniport.util.validation import Array, as_choice, as_numbers


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
                raise InvalidInputError(
                    f"arms[{i}] must be an Arm, as load_arm makes it; found {type(arm).__name__}"
                )
        self.arms = arms
        self.names = (
            tuple(f"arm{i + 1}" for i in range(len(arms))) if names is None else tuple(names)
        )
        if not arms or len(set(self.names)) != len(arms):
            raise InvalidInputError(
                f"names must be one for each of {len(arms)} arms, all different; found {self.names}"
            )
        self.common, shared = _shared_joints([arm.chain for arm in arms], self.names)
        self.shared = tuple(dict.fromkeys(name for _, _, moving in shared for name in moving))
        self.frames = tuple(dict.fromkeys(frame for arm in arms for frame in arm.frames))
        own: list[
            tuple[Arm, int, int]
        ] = []  # arm, its index, and index of the joint of each column
        columns: list[NDArray[np.intp]] = []
        for i, arm in enumerate(arms):
            columns.append(np.empty(arm.dof, dtype=np.intp))
            earlier = {name: k for k, j, same in shared if j == i for name in same}
            for k, name in enumerate(arm.joint_names):
                if name in earlier:
                    columns[i][k] = columns[earlier[name]][
                        arms[earlier[name]].joint_names.index(name)
                    ]
                else:
                    columns[i][k] = len(own)
                    own.append((arm, i, k))
        self.columns = tuple(columns)
        joints = [arm.joint_names[k] for arm, _, k in own]
        self.prefixes = tuple(f"{name}_" * (len(set(joints)) < len(joints)) for name in self.names)
        self.locked = {
            self.prefixes[i] + name: at
            for i, arm in enumerate(arms)
            for name, at in arm.locked.items()
        }
        speeds, efforts = (
            np.array([np.inf if limits is None else limits[k] for limits, k in of])
            for of in (
                [(arm.velocity_limits, k) for arm, _, k in own],
                [(arm.effort_limits, k) for arm, _, k in own],
            )
        )
        super().__init__(
            "+".join(dict.fromkeys(arm.name for arm in arms)),
            tuple(self.prefixes[i] + arm.joint_names[k] for arm, i, k in own),
            np.array([arm.lower[k] for arm, _, k in own]),
            np.array([arm.upper[k] for arm, _, k in own]),
            speeds,
            efforts,
            tuple(arm.joint_units[k] for arm, _, k in own),
        )

    def __repr__(self) -> str:
        frames = {name: arm.frame for name, arm in zip(self.names, self.arms, strict=True)}
        return (
            f"ArmGroup({self.name!r}, dof={self.dof}, frames={frames}, shared={list(self.shared)})"
        )

    def __len__(self) -> int:
        return len(self.arms)

    def __reduce__(self) -> tuple[Any, tuple[Arm, ...]]:
        return partial(type(self), names=self.names), self.arms

    @property
    def base_positions(self) -> Array:
        """Origin of the base of each arm in the robot's frame, shape (n_arms, 3) [m]."""
        poses = [arm.chain.base_pose for arm in self.arms]
        return np.array([np.zeros(3) if pose is None else pose[:3, 3] for pose in poses])

    @cached_property
    def kinematics(self) -> Kinematics:
        """Links of all arms as one tree."""
        return Kinematics(
            *(arm.chain for arm in self.arms),
            columns=self.columns,
            dof=self.dof,
            common=self.common,
        )

    def split(self, q: ArrayLike) -> tuple[Array, ...]:
        """Return the configurations of each arm, shapes (..., arm.dof)."""
        array = self.configurations(q)
        return tuple(array[..., columns] for columns in self.columns)

    def joined(self, *parts: ArrayLike) -> Array:
        """Return configurations of the group, shape (..., dof), from those of its arms (equal on shared joints)."""
        if len(parts) != len(self.arms):
            raise InvalidInputError(
                f"configurations must be of {len(self.arms)} arms; found {len(parts)}"
            )
        arrays = [
            arm.configurations(part, f"configurations of {name}")
            for arm, part, name in zip(self.arms, parts, self.names, strict=True)
        ]
        shapes = {array.shape[:-1] for array in arrays}
        if len(shapes) > 1:
            raise InvalidInputError(
                f"configurations of all arms must have the same leading shape; found {shapes}"
            )
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
        arms = (
            arm.narrowed(low[c], high[c]) for arm, c in zip(self.arms, self.columns, strict=True)
        )
        return ArmGroup(*arms, names=self.names)

    def with_payload(self, mass: ArrayLike, center: ArrayLike = (0.0, 0.0, 0.0)) -> "ArmGroup":
        """Return the group with payloads [kg], one for all arms or one for each; see `Arm.with_payload`."""
        masses = as_numbers(mass, "mass", len(self), broadcast=True)
        arms = [
            arm.with_payload(float(own), center) for arm, own in zip(self.arms, masses, strict=True)
        ]
        chains = [arm.chain for arm in arms]
        for i, j in permutations(range(len(self)), 2):
            if fork := int(
                self.common[i, j]
            ):  # this link of arm i has the masses of arm j, at rest
                inertia = np.array(chains[i].inertia)
                inertia[fork] += carried_inertia(arms[j].chain, fork) - carried_inertia(
                    self.arms[j].chain, fork
                )
                chains[i] = replace(chains[i], inertia=inertia)
        return ArmGroup(*map(Arm, chains), names=self.names)

    def forward(self, q: ArrayLike) -> Array:
        """Compute the poses of all end effectors, shape (..., n_arms, 4, 4) [m]."""
        return np.stack(
            [arm.forward(part) for arm, part in zip(self.arms, self.split(q), strict=True)], axis=-3
        )

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
        if (
            not isinstance(spec, EllipsoidSpec)
            or spec.joint_weights is None
            or isinstance(spec.joint_weights, str)
        ):
            return tuple(arm.checked_spec(spec) for arm in self.arms)
        weights = np.array(self.checked_spec(spec).joint_weights)
        own = (replace(spec, joint_weights=weights[columns]) for columns in self.columns)
        return tuple(arm.checked_spec(part) for arm, part in zip(self.arms, own, strict=True))

    def cooperative_ellipsoids(
        self, q: ArrayLike, kind: str = "relative", part: str = "translation"
    ) -> Array:
        """Compute velocity ellipsoids of the relative or absolute motion of two arms, shape (..., d, d).

        With Jacobians J_1 and J_2 along the axes of the common frame, the relative motion has J_2 − J_1, and the
        absolute one, the mean of both, ½ (J_1 + J_2). Where no joint is shared, M_r = M_1 + M_2 and M_a = ¼ M_r.

        Parameters
        ----------
        q : array_like, shape (..., dof)
        kind : {"relative", "absolute"}
        part : {"translation", "rotation", "full"}

        References
        ----------
        Uchiyama and Dauchez, ICRA 1988; Chiacchio, Chiaverini and Siciliano, J. Dyn. Syst. Meas. Control 118, 1996.
        """
        factors = {"relative": (-1.0, 1.0), "absolute": (0.5, 0.5)}[
            as_choice(kind, "kind", ("relative", "absolute"))
        ]
        if len(self) != 2:
            raise InvalidInputError(
                f"cooperative ellipsoids are those of two arms; the group has {len(self)}"
            )
        rows = np.einsum("i,...ijk->...jk", factors, self.jacobian(q))[
            ..., EllipsoidSpec(part=part).rows, :
        ]
        return manipulability(rows)


def as_group(arm: Arm | ArmGroup) -> ArmGroup:
    """Return a group as it is and a single arm as a group of one, which has its joint names."""
    return arm if isinstance(arm, ArmGroup) else ArmGroup(arm)


def _shared_joints(
    chains: Sequence[Chain], names: Sequence[str]
) -> tuple[NDArray[np.intp], list[tuple[int, int, tuple[str, ...]]]]:
    """Numbers of common joints (n_arms, n_arms), and the coordinates that move them for each pair of arms."""
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
            advice = f", which stand in one place; place them with {placing_options()}"
            where = "" if first.base_pose is None else advice
            raise InvalidInputError(
                f"frames: {first.frame!r} and {second.frame!r} must end two limbs; found both on one chain of "
                f"{first.name!r}{where}"
            )
        moving: list[dict[str, Any]] = []
        for chain in (first, second):
            limits = zip(
                chain.coordinates, chain.lower, chain.upper, chain.coupling[:count].T, strict=True
            )
            moving.append(
                {name: (low, high, *column) for name, low, high, column in limits if np.any(column)}
            )
        differ = [
            name for name in moving[0] | moving[1] if moving[0].get(name) != moving[1].get(name)
        ]
        differ += [
            first.joints[k].name
            for k in np.flatnonzero(first.offset[:count] != second.offset[:count])
        ]
        if differ:
            ranges = []
            for chain, own in zip((first, second), moving, strict=True):
                locked = dict(
                    zip([joint.name for joint in chain.joints], chain.offset, strict=True)
                ).get(differ[0])
                ranges.append(
                    "{:g} to {:g}".format(*own[differ[0]])
                    if differ[0] in own
                    else f"locked at {locked}"
                )
            raise InvalidInputError(
                f"the joint {differ[0]!r} carries two arms and must have the same limits, or be locked at one "
                f"position; found {ranges[0]} for {names[i]}, {ranges[1]} for {names[j]}"
            )
        common[i, j] = common[j, i] = count
        shared.append((i, j, tuple(moving[0])))
    return common, shared


def placing_options() -> str:
    """Describe the options that place several robots, for messages."""
    text = "--pose of each, such as 0,0.3,0,0 and 0,-0.3,0,0"
    return text if typed() else "bases=, such as ((0, 0.3, 0), (0, -0.3, 0))"
