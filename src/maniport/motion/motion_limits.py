"""How far, how fast and how abruptly the joints of a robot may move, and what share of that a motion uses."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import Arm, ArmGroup, as_group
from maniport.errors import FileFormatError, InvalidInputError
from maniport.motion.arm_model import InverseDynamics
from maniport.util.defaults import MARGIN
from maniport.util.files import read_settings, require_mapping
from maniport.util.validation import Array, as_finite, as_number, as_times, require_shape

DERIVATIVES = ("velocity", "acceleration", "jerk")
TORQUES = ("torque", "torque rate")
LIMITS = (*DERIVATIVES, "effort", "effort_rate")  # keys of limits of a joint
ASSUMED = "assumed: "  # beginning of such sources
PANDA = {
    f"panda_joint{i}": {
        "acceleration": acceleration,
        "jerk": 500.0 * acceleration,
        "effort_rate": 1000.0,
    }
    for i, acceleration in enumerate((15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0), 1)
}
"""[rad/s², rad/s³, N m/s], by joint: Franka Control Interface, "Limits for Franka Emika Robot (FER)"."""


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Limits of the joints of an arm; make them with `MotionLimits.of`.

    Attributes
    ----------
    arm : Arm or ArmGroup
        With narrowed position limits, which include the margin.
    velocity, acceleration, jerk : ndarray, shape (dof,)
        Largest magnitudes, positive and finite [rad or m, per second, second² and second³].
    effort, effort_rate : ndarray, shape (dof,)
        Largest magnitudes of torques [N m] or forces [N] and of their derivatives [N m/s or N/s]; infinite where
        unknown.
    sources : dict of str to str
        Source of the numbers, by ``"velocity"``, ``"acceleration"``, ``"jerk"`` and, where any is known, ``"effort"``
        and ``"effort_rate"``.
    assumed : dict of str to tuple of str
        For position, velocity, acceleration and jerk the joints with an assumed limit: it is neither in `source`, nor
        the maker's, nor in the robot's description.
    """

    arm: Any
    velocity: Array
    acceleration: Array
    jerk: Array
    effort: Array
    effort_rate: Array
    sources: dict[str, str]
    assumed: dict[str, tuple[str, ...]]

    @classmethod
    def of(
        cls,
        arm: Arm | ArmGroup,
        source: str | os.PathLike[str] | Mapping[str, object] | None = None,
        joint_limit_margin: float = MARGIN,
    ) -> "MotionLimits":
        """Take limits from the argument, else from the maker, else from the arm's description, else from defaults.

        Parameters
        ----------
        arm : Arm or ArmGroup
        source : path, mapping or None
            A YAML file or a mapping with ``joints: {name: {velocity:, acceleration:, jerk:, effort:, effort_rate:,
            lower:, upper:}}`` and ``default: {velocity:, acceleration:, jerk:, effort:, effort_rate:}`` for the other
            joints, all of it optional. The Panda's accelerations, jerks and torque rates are known, and recognized by
            the names of its joints.
        joint_limit_margin : float
            Share of each joint's range that is kept free at either end, in [0, 0.4], unless ``lower`` or ``upper`` is
            specified.

        Raises
        ------
        FileFormatError, InvalidInputError
            When a file, or a mapping, names unknown joints or keys, or a value is not allowed.
        """
        share = as_number(joint_limit_margin, "joint_limit_margin", minimum=0.0, maximum=0.4)
        given = _given_limits(source, arm)
        joints = _described_joints(arm)

        inside = share * (arm.upper - arm.lower)
        lower = arm.lower + inside
        upper = arm.upper - inside
        free = []
        for i, joint in enumerate(joints):
            numbers = given.joints.get(joint.name, {})
            lower[i] = numbers.get("lower", lower[i])
            upper[i] = numbers.get("upper", upper[i])
            if joint.is_unlimited and not {"lower", "upper"} <= numbers.keys():
                free.append(joint.name)

        limits = dict[str, Array]()
        sources = dict[str, str]()
        assumed = {"position": tuple(free)}
        for quantity in LIMITS:
            values = np.empty(arm.dof)
            origins = []
            for i, joint in enumerate(joints):
                value, origin = given.limit(quantity, joint)
                if not origin and quantity in DERIVATIVES:
                    found = {key: magnitudes[i] for key, magnitudes in limits.items()}
                    value, origin = _assumed(quantity, arm.joint_units[i], found)
                values[i] = value
                origins.append(origin)
            limits[quantity] = values
            if quantity in DERIVATIVES:
                assumed[quantity] = _assumed_joints(arm.joint_names, origins)
            if any(origins):
                sources[quantity] = "; ".join(filter(None, dict.fromkeys(origins)))
        return cls(arm.narrowed(lower, upper), sources=sources, assumed=assumed, **limits)

    def of_joints(self, arm: Arm, columns: NDArray[np.integer]) -> "MotionLimits":
        """Return the limits of one arm of a group; `columns` are its joints in the group."""
        names = [self.arm.joint_names[column] for column in columns]
        names_in_arm = dict(zip(names, arm.joint_names, strict=True))
        assumed = {}
        for quantity, joints in self.assumed.items():
            assumed[quantity] = tuple(names_in_arm[name] for name in joints if name in names_in_arm)
        limits = {quantity: getattr(self, quantity)[columns] for quantity in LIMITS}
        return MotionLimits(arm, sources=self.sources, assumed=assumed, **limits)

    @cached_property
    def dynamics(self) -> InverseDynamics | None:
        """Inverse dynamics; None where the description of an arm has no masses."""
        has_masses = all(arm.chain.inertia is not None for arm in as_group(self.arm).arms)
        if has_masses:
            return InverseDynamics(self.arm)
        return None

    def require_held(self, least: float = 0.05) -> None:
        """Require that the joints hold the arm against gravity in a share of at least `least` of its configurations."""
        has_weight = any(any(arm.chain.gravity) for arm in as_group(self.arm).arms)
        if not has_weight or self.dynamics is None or not np.isfinite(self.effort).any():
            return
        q = self.arm.sample(400, 0)
        torques = np.abs(self.dynamics.gravity(q))
        shares = torques / self.effort
        if np.mean(shares.max(axis=1) < 1.0) < least:
            joint = int(np.bincount(shares.argmax(axis=1)).argmax())
            raise InvalidInputError(
                f"{self.arm.name!r} cannot hold itself and its payload: "
                f"{self.held_fault(joint, float(np.median(torques[:, joint])))}"
            )

    def held_fault(self, joint: int, torque: float) -> str:
        """Describe what torque gravity needs of a joint, and what helps."""
        limit = self.effort[joint]
        unit = {"rad": "N m", "m": "N"}[self.arm.joint_units[joint]]
        return (
            f"{self.arm.joint_names[joint]} needs {torque:.4g} {unit}, its limit is {limit:.4g} {unit}; reduce the "
            "payload, or correct effort limits in a file for --limits"
        )

    def torques(self, positions: Array, rate: float) -> Array:
        """Torques (m, dof) [N m or N] of positions (m, dof) at a constant rate [Hz], at rest before and after."""
        assert self.dynamics is not None
        ends = np.concatenate([positions[:1], positions, positions[-1:]])
        return self.dynamics.torques(
            positions, 0.5 * rate * (ends[2:] - ends[:-2]), rate**2 * np.diff(ends, 2, axis=0)
        )

    def use(self, time: ArrayLike, q: ArrayLike) -> dict[str, tuple[str, float, float]]:
        """Largest share of each limit that a motion uses, with times (m,) at a constant rate [s] and q (m, dof).

        By quantity: the joint that uses most, the share, and when [s]. That of a position is measured from the middle
        of the joint's range. Velocity, acceleration and jerk are first, second and third differences of
        neighboring samples, at the middle of these samples. Torques are left out where limits or masses are unknown.
        """
        times = as_times(time, fewest=2)
        values = as_finite(q, "q")
        require_shape(values, "q", (len(times), self.arm.dof), ", one row for each time")
        step = (times[-1] - times[0]) / (len(times) - 1)
        steps = np.diff(times)
        if np.ptp(steps) > 1e-3 * step:
            raise InvalidInputError(
                f"time must have a constant rate; found steps of {steps.min():g} to {steps.max():g} s"
            )
        lower = self.arm.lower
        upper = self.arm.upper
        middle = 0.5 * (lower + upper)
        half = np.maximum(0.5 * (upper - lower), 1e-12)
        shares = {"position": np.abs(values - middle) / half}
        derivative = values
        for quantity in DERIVATIVES:
            derivative = np.diff(derivative, axis=0) / step
            shares[quantity] = np.abs(derivative) / getattr(self, quantity)
        if self.dynamics is not None:
            torques = self.torques(values, 1.0 / step)
            series = (
                np.abs(torques) / self.effort,
                np.abs(np.diff(torques, axis=0)) / step / self.effort_rate,
            )
            for name, torque_shares in zip(TORQUES, series, strict=True):
                if torque_shares.max(initial=0.0) > 0.0:
                    shares[name] = torque_shares
        result = {}
        for quantity, share in shares.items():
            if len(share):
                joint = int(share.max(axis=0).argmax())
                row = int(share[:, joint].argmax())
                at = times[row] + 0.5 * step * (len(times) - len(share))
                result[quantity] = self.arm.joint_names[joint], float(share[row, joint]), float(at)
        return result


class DescribedJoint(NamedTuple):
    """A joint of an arm or a group, as its robot's description has it."""

    name: str  # in the arm or group
    own_name: str  # in the description
    is_unlimited: bool  # whether the description has no limits of its position
    velocity: float  # limit [rad/s or m/s], infinite where there is none
    effort: float  # limit [N m or N]


def _described_joints(arm: Arm | ArmGroup) -> list[DescribedJoint]:
    group = as_group(arm)
    own_names = list(arm.joint_names)
    unlimited = set[str]()
    for member, columns in zip(group.arms, group.columns, strict=True):
        unlimited |= set(member.chain.unlimited)
        for column, name in zip(columns, member.joint_names, strict=True):
            own_names[column] = name

    joints = []
    for i, own_name in enumerate(own_names):
        joint = DescribedJoint(
            arm.joint_names[i],
            own_name,
            own_name in unlimited,
            np.inf if arm.velocity_limits is None else arm.velocity_limits[i],
            np.inf if arm.effort_limits is None else arm.effort_limits[i],
        )
        joints.append(joint)
    return joints


class GivenLimits(NamedTuple):
    """Limits that a file or a mapping gives, by the names of joints and of quantities."""

    joints: Mapping[str, Mapping[str, float]]
    default: Mapping[str, float]  # of other joints
    where: str  # name of the source

    def limit(self, quantity: str, joint: DescribedJoint) -> tuple[float, str]:
        """Return the limit of a joint from here, its maker or its description, and the source; ∞ and "" for none."""
        numbers = self.joints.get(joint.name, {})
        if quantity in numbers:
            return numbers[quantity], self.where
        if quantity in self.default:
            return self.default[quantity], f"{self.where} (default)"
        by_maker = PANDA.get(joint.own_name, {})
        if quantity in by_maker:
            return by_maker[quantity], "Franka's limits of the Panda (FER)"
        described = {"velocity": joint.velocity, "effort": joint.effort}
        if np.isfinite(described.get(quantity, np.inf)):
            return described[quantity], "the robot's description"
        return np.inf, ""


def _given_limits(
    source: str | os.PathLike[str] | Mapping[str, object] | None, arm: Arm | ArmGroup
) -> GivenLimits:
    """Read and check limits; errors are `FileFormatError` in a file, and else `InvalidInputError`."""
    if isinstance(source, str | os.PathLike):
        try:
            content = read_settings(source, ("joints", "default"))
            return _checked(content, arm, str(source))
        except (InvalidInputError, FileFormatError) as error:
            raise FileFormatError(str(error)) from None
    try:
        return _checked({} if source is None else source, arm, "limits")
    except (InvalidInputError, FileFormatError) as error:
        raise InvalidInputError(str(error)) from None


def _checked_numbers(content: object, keys: tuple[str, ...], name: str) -> dict[str, float]:
    """Require a mapping of some keys to numbers; limits are positive."""
    numbers = {}
    for key, value in require_mapping(content, keys, name).items():
        if key in LIMITS:
            numbers[key] = as_number(value, f"{name}: {key}", above=0.0)
        else:
            numbers[key] = as_number(value, f"{name}: {key}")
    return numbers


def _checked(content: object, arm: Arm | ArmGroup, where: str) -> GivenLimits:
    """Require limits for joints by name, and for those that are not named."""
    if isinstance(content, Mapping):
        content = dict(content)
    content = require_mapping(content, ("joints", "default"), where)
    default = _checked_numbers(content.get("default", {}), LIMITS, f"{where}: default")
    entries = require_mapping(
        content.get("joints", {}), arm.joint_names, f"{where}: joints of {arm.name!r}"
    )
    joints = {}
    for name, entry in entries.items():
        label = f"{where}: joints: {name}"
        numbers = _checked_numbers(entry, (*LIMITS, "lower", "upper"), label)
        i = arm.joint_names.index(name)
        least = float(arm.lower[i])
        largest = float(arm.upper[i])
        for key in ("lower", "upper"):
            if key in numbers:
                as_number(numbers[key], f"{label}: {key}", minimum=least, maximum=largest)
        lower = numbers.get("lower", least)
        upper = numbers.get("upper", largest)
        if lower >= upper:
            raise InvalidInputError(
                f"{label}: lower must be below upper; found {lower:g} and {upper:g}"
            )
        joints[name] = numbers
    return GivenLimits(joints, default, where)


def _assumed_joints(names: Sequence[str], origins: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the joints whose limits are assumed."""
    assumed = []
    for name, origin in zip(names, origins, strict=True):
        if origin.startswith(ASSUMED):
            assumed.append(name)
    return tuple(assumed)


def _assumed(quantity: str, unit: str, lower: Mapping[str, float]) -> tuple[float, str]:
    """Limit of a joint of which nothing is known, by its limits of lower derivatives, and its source."""
    if quantity == "velocity":
        speed = {"rad": 1.0, "m": 0.25}[unit]  # slow enough for any arm
        return speed, f"{ASSUMED}{speed:g} {unit}/s"
    # on the safe side of makers: the Panda takes 0.13 to 0.29 s and 0.002 s, the xArm7 0.16 s and 0.04 s
    if quantity == "acceleration":
        return lower["velocity"] / 0.25, f"{ASSUMED}velocity limit reached in 0.25 s"
    return lower["acceleration"] / 0.04, f"{ASSUMED}acceleration limit reached in 0.04 s"
