"""A group of arms: chains in one frame, of one robot or of several, over the union of their joints."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms.arm import Arm
from maniport.arms.chain import Chain, Joint
from maniport.arms.joint_space import JointSpace
from maniport.arms.kinematics import Kinematics
from maniport.arms.manipulability import VELOCITY, EllipsoidSpec, manipulability
from maniport.arms.restriction import carried_inertia
from maniport.errors import InvalidInputError, typed
from maniport.util.validation import Array, as_choice, as_numbers

EQUAL_POSITIONS = 1e-9  # difference of the positions of a shared joint by rounding [rad] or [m]


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
        self.arms = arms
        self.names = _names_of(arms, names)
        self.common, shared = _shared_joints([arm.chain for arm in arms], self.names)
        shared_names = dict[str, None]()
        for pair in shared:
            shared_names |= dict.fromkeys(pair.coordinates)
        self.shared = tuple(shared_names)
        frames = dict[str, None]()
        for arm in arms:
            frames |= dict.fromkeys(arm.frames)
        self.frames = tuple(frames)
        self.columns, joints = _columns(arms, shared)

        names_in_arms = [arms[i].joint_names[k] for i, k in joints]
        self.prefixes = ("",) * len(arms)
        if len(set(names_in_arms)) < len(joints):
            self.prefixes = tuple(f"{name}_" for name in self.names)
        self.locked = {}
        for prefix, arm in zip(self.prefixes, arms, strict=True):
            for name, position in arm.locked.items():
                self.locked[prefix + name] = position
        properties = _JointProperties.of(arms, joints, self.prefixes)
        super().__init__("+".join(dict.fromkeys(arm.name for arm in arms)), *properties)

    def __repr__(self) -> str:
        frames = {}
        for name, arm in zip(self.names, self.arms, strict=True):
            frames[name] = arm.frame
        return (
            f"ArmGroup({self.name!r}, dof={self.dof}, frames={frames}, shared={list(self.shared)})"
        )

    def __len__(self) -> int:
        return len(self.arms)

    def __reduce__(self) -> tuple[Callable[..., "ArmGroup"], tuple[Arm, ...]]:
        return partial(type(self), names=self.names), self.arms

    @property
    def base_positions(self) -> Array:
        """Origin of the base of each arm in the robot's frame, shape (n_arms, 3) [m]."""
        origins = np.zeros((len(self.arms), 3))
        for i, arm in enumerate(self.arms):
            if arm.chain.base_pose is not None:
                origins[i] = arm.chain.base_pose[:3, 3]
        return origins

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
        arrays = []
        for arm, part, name in zip(self.arms, parts, self.names, strict=True):
            arrays.append(arm.configurations(part, f"configurations of {name}"))
        shapes = {array.shape[:-1] for array in arrays}
        if len(shapes) > 1:
            raise InvalidInputError(
                f"configurations of all arms must have the same leading shape; found {shapes}"
            )

        q = np.empty((*shapes.pop(), self.dof))
        for array, columns in reversed(list(zip(arrays, self.columns, strict=True))):
            q[..., columns] = array
        for array, columns, name in zip(arrays, self.columns, self.names, strict=True):
            self._require_agreement(q[..., columns], array, columns, name)
        return q

    def _require_agreement(
        self, expected: Array, found: Array, columns: NDArray[np.intp], name: str
    ) -> None:
        """Require that an arm has shared joints where an earlier one has them, shapes (..., arm.dof)."""
        difference = np.abs(expected - found)
        if not np.any(difference > EQUAL_POSITIONS):
            return
        worst = np.unravel_index(difference.argmax(), difference.shape)
        joint = self.joint_names[columns[worst[-1]]]
        raise InvalidInputError(
            f"the arms must agree on the shared joint {joint!r}; found "
            f"{found[worst]:.6g} for {name}, {expected[worst]:.6g} for an earlier arm"
        )

    def narrowed(self, lower: ArrayLike, upper: ArrayLike) -> "ArmGroup":
        """Return the group with closer joint limits, shape (dof,); wider ones raise `InvalidInputError`."""
        low = as_numbers(lower, "lower", self.dof)
        high = as_numbers(upper, "upper", self.dof)
        arms = []
        for arm, columns in zip(self.arms, self.columns, strict=True):
            arms.append(arm.narrowed(low[columns], high[columns]))
        return ArmGroup(*arms, names=self.names)

    def with_payload(self, mass: ArrayLike, center: ArrayLike = (0.0, 0.0, 0.0)) -> "ArmGroup":
        """Return the group with payloads [kg], one for all arms or one for each; see `Arm.with_payload`."""
        masses = as_numbers(mass, "mass", len(self), broadcast=True)
        arms = []
        for arm, arm_mass in zip(self.arms, masses, strict=True):
            arms.append(arm.with_payload(float(arm_mass), center))

        chains = [arm.chain for arm in arms]
        for i, j in permutations(range(len(self)), 2):
            fork = int(self.common[i, j])  # this link of arm i has the masses of arm j, at rest
            if fork == 0:
                continue
            inertia = np.array(chains[i].inertia)
            carried = carried_inertia(arms[j].chain, fork)
            inertia[fork] += carried - carried_inertia(self.arms[j].chain, fork)
            chains[i] = replace(chains[i], inertia=inertia)
        return ArmGroup(*map(Arm, chains), names=self.names)

    def forward(self, q: ArrayLike) -> Array:
        """Compute the poses of all end effectors, shape (..., n_arms, 4, 4) [m]."""
        poses = []
        for arm, configurations in zip(self.arms, self.split(q), strict=True):
            poses.append(arm.forward(configurations))
        return np.stack(poses, axis=-3)

    def jacobian(self, q: ArrayLike) -> Array:
        """Compute the geometric Jacobians in all joints, shape (..., n_arms, 6, dof), linear rows first."""
        configurations = self.split(q)
        leading = configurations[0].shape[:-1]
        jacobians = np.zeros((*leading, len(self.arms), 6, self.dof))
        for i, arm in enumerate(self.arms):
            jacobian = arm.jacobian(configurations[i])
            jacobians[..., i, :, self.columns[i]] = np.moveaxis(jacobian, -1, 0)
        return jacobians

    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Compute the manipulability matrices of all arms, shape (..., n_arms, d, d); weights are for all joints."""
        ellipsoids = []
        for arm, configurations, spec_of_arm in zip(
            self.arms, self.split(q), self.specs(spec), strict=True
        ):
            ellipsoids.append(arm.ellipsoids(configurations, spec_of_arm))
        return np.stack(ellipsoids, axis=-3)

    def specs(self, spec: EllipsoidSpec) -> tuple[EllipsoidSpec, ...]:
        """Return the specification of each arm: numbers as joint weights of the group are split."""
        if (
            not isinstance(spec, EllipsoidSpec)
            or spec.joint_weights is None
            or isinstance(spec.joint_weights, str)
        ):
            return tuple(arm.checked_spec(spec) for arm in self.arms)
        weights = np.array(self.checked_spec(spec).joint_weights)
        specs = []
        for arm, columns in zip(self.arms, self.columns, strict=True):
            specs.append(arm.checked_spec(replace(spec, joint_weights=weights[columns])))
        return tuple(specs)

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
    if isinstance(arm, ArmGroup):
        return arm
    return ArmGroup(arm)


def _names_of(arms: Sequence[Arm], names: Sequence[str] | None) -> tuple[str, ...]:
    """Require arms, and one name for each."""
    for i, arm in enumerate(arms):
        if not isinstance(arm, Arm):
            raise InvalidInputError(
                f"arms[{i}] must be an Arm, as load_arm makes it; found {type(arm).__name__}"
            )
    if names is None:
        titles = tuple(f"arm{i + 1}" for i in range(len(arms)))
    else:
        titles = tuple(names)
    if not arms or len(set(titles)) != len(arms):
        raise InvalidInputError(
            f"names must be one for each of {len(arms)} arms, all different; found {titles}"
        )
    return titles


def _columns(
    arms: Sequence[Arm], shared: Sequence["_SharedJoints"]
) -> tuple[tuple[NDArray[np.intp], ...], list[tuple[int, int]]]:
    """Columns of each arm's joints, and for each column the first arm with that joint, and its index there."""
    joints: list[tuple[int, int]] = []
    columns: list[NDArray[np.intp]] = []
    for i, arm in enumerate(arms):
        earlier: dict[str, int] = {}  # arm with the same joint, by its name
        for pair in shared:
            if pair.second == i:
                earlier |= dict.fromkeys(pair.coordinates, pair.first)
        listed = np.empty(arm.dof, dtype=np.intp)
        for k, name in enumerate(arm.joint_names):
            if name in earlier:
                other = earlier[name]
                listed[k] = columns[other][arms[other].joint_names.index(name)]
            else:
                listed[k] = len(joints)
                joints.append((i, k))
        columns.append(listed)
    return tuple(columns), joints


class _JointProperties(NamedTuple):
    """Properties of the joints of a group (dof,), in the order of the arguments of `JointSpace`."""

    names: tuple[str, ...]
    lower: Array
    upper: Array
    velocity_limits: Array  # infinite where those of an arm are unknown
    effort_limits: Array
    units: tuple[str, ...]

    @classmethod
    def of(
        cls, arms: Sequence[Arm], joints: Sequence[tuple[int, int]], prefixes: Sequence[str]
    ) -> "_JointProperties":
        """Collect the properties of joints by arm and index."""
        names = []
        units = []
        limits = np.full((4, len(joints)), np.inf)
        for column, (i, k) in enumerate(joints):
            arm = arms[i]
            names.append(prefixes[i] + arm.joint_names[k])
            units.append(arm.joint_units[k])
            limits[0, column] = arm.lower[k]
            limits[1, column] = arm.upper[k]
            if arm.velocity_limits is not None:
                limits[2, column] = arm.velocity_limits[k]
            if arm.effort_limits is not None:
                limits[3, column] = arm.effort_limits[k]
        lower, upper, velocity, effort = limits
        return cls(tuple(names), lower, upper, velocity, effort, tuple(units))


class _SharedJoints(NamedTuple):
    """Coordinates that move two arms."""

    first: int  # of the arms
    second: int
    coordinates: tuple[str, ...]


def _shared_joints(
    chains: Sequence[Chain], names: Sequence[str]
) -> tuple[NDArray[np.intp], list[_SharedJoints]]:
    """Numbers of common joints (n_arms, n_arms), and the coordinates that move them for each pair of arms."""
    common = np.diag([len(chain.joints) for chain in chains]).astype(np.intp)
    shared = []
    for i, j in combinations(range(len(chains)), 2):
        pair = (chains[i], chains[j])
        count = _common_joints(*pair)
        _require_equal_joints(pair, (names[i], names[j]), count)
        common[i, j] = count
        common[j, i] = count
        shared.append(_SharedJoints(i, j, tuple(_moving(chains[i], count))))
    return common, shared


def _common_joints(first: Chain, second: Chain) -> int:
    """Count the joints with which two chains begin in common; they must have one base, and end two limbs."""
    if first.base != second.base:
        ends = " and ".join(repr(chain.base or "the robot's base") for chain in (first, second))
        raise InvalidInputError(f"all arms must have the same base frame; found {ends}")
    count = 0
    for one, other in zip(first.joints, second.joints, strict=False):
        if not _is_same(one, other):
            break
        count += 1
    if count in (len(first.joints), len(second.joints)):
        advice = f", which stand in one place; place them with {placing_options()}"
        where = "" if first.base_pose is None else advice
        raise InvalidInputError(
            f"frames: {first.frame!r} and {second.frame!r} must end two limbs; found both on one chain of "
            f"{first.name!r}{where}"
        )
    return count


def _is_same(first: Joint, second: Joint) -> bool:
    """Whether two joints are one joint of a robot."""
    if (first.name, first.kind) != (second.name, second.kind):
        return False
    same_axis = np.array_equal(first.axis, second.axis)
    return same_axis and np.array_equal(first.placement, second.placement)


def _moving(chain: Chain, count: int) -> dict[str, tuple[float, ...]]:
    """Return the coordinates that move the first joints of a chain: limits, and coupling to these joints."""
    moving: dict[str, tuple[float, ...]] = {}
    columns = chain.coupling[:count].T
    limits = zip(chain.coordinates, chain.lower, chain.upper, columns, strict=True)
    for name, low, high, column in limits:
        if np.any(column):
            moving[name] = (low, high, *column)
    return moving


def _require_equal_joints(chains: tuple[Chain, Chain], names: tuple[str, str], count: int) -> None:
    """Require that joints which carry two arms have the same limits, or are locked at one position."""
    first = _moving(chains[0], count)
    second = _moving(chains[1], count)
    differ = [name for name in first | second if first.get(name) != second.get(name)]
    offsets = chains[0].offset[:count] != chains[1].offset[:count]
    differ += [chains[0].joints[k].name for k in np.flatnonzero(offsets)]
    if not differ:
        return

    ranges = []
    for chain, moving in zip(chains, (first, second), strict=True):
        if differ[0] in moving:
            ranges.append("{:g} to {:g}".format(*moving[differ[0]]))
            continue
        locked = {}
        for joint, offset in zip(chain.joints, chain.offset, strict=True):
            locked[joint.name] = offset
        ranges.append(f"locked at {locked.get(differ[0])}")
    raise InvalidInputError(
        f"the joint {differ[0]!r} carries two arms and must have the same limits, or be locked at one "
        f"position; found {ranges[0]} for {names[0]}, {ranges[1]} for {names[1]}"
    )


def placing_options() -> str:
    """Describe the options that place several robots, for messages."""
    text = "--pose of each, such as 0,0.3,0,0 and 0,-0.3,0,0"
    if typed():
        return text
    return "bases=, such as ((0, 0.3, 0), (0, -0.3, 0))"
