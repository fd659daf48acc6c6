"""How far, how fast and how abruptly the joints of a robot may move, and what share of that a motion uses."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import Arm, ArmGroup, as_group
from maniport.errors import FileFormatError, InvalidInputError
from maniport.motion.schedule import require_rows
from maniport.util.defaults import MARGIN
from maniport.util.files import read_settings, require_mapping
from maniport.util.validation import Array, as_finite, as_number, as_times

DERIVATIVES = ("velocity", "acceleration", "jerk")
QUANTITIES = ("position", *DERIVATIVES)
PANDA = {
    f"panda_joint{i}": {"acceleration": acceleration, "jerk": 500.0 * acceleration}
    for i, acceleration in enumerate((15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0), 1)
}
"""[rad/s² and rad/s³], by joint: Franka Control Interface, "Limits for Franka Emika Robot (FER)"."""


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Limits of the joints of an arm; make them with `MotionLimits.of`.

    Attributes
    ----------
    arm : Arm or ArmGroup
        With narrowed position limits, which include the margin.
    velocity, acceleration, jerk : ndarray, shape (dof,)
        Largest magnitudes, positive and finite [rad or m, per second, second² and second³].
    sources : dict of str to str
        For ``"velocity"``, ``"acceleration"`` and ``"jerk"`` a sentence on the source of the numbers.
    assumed : dict of str to tuple of str
        For each of `QUANTITIES` the joints whose limit is neither in `source`, nor the maker's, nor in the robot's
        description.
    """

    arm: Any
    velocity: Array
    acceleration: Array
    jerk: Array
    sources: dict[str, str]
    assumed: dict[str, tuple[str, ...]]

    @classmethod
    def of(
        cls,
        arm: Arm | ArmGroup,
        source: str | os.PathLike[str] | Mapping[str, Any] | None = None,
        joint_limit_margin: float = MARGIN,
    ) -> "MotionLimits":
        """Take limits from the argument, else from the maker, else from the arm's description, else from defaults.

        Parameters
        ----------
        arm : Arm or ArmGroup
        source : path, mapping or None
            A YAML file or a mapping with ``joints: {name: {velocity:, acceleration:, jerk:, lower:, upper:}}`` and
            ``default: {velocity:, acceleration:, jerk:}`` for the other joints, all of it optional. The Panda's
            accelerations and jerks are known, and recognized by the names of its joints.
        joint_limit_margin : float
            Share of each joint's range that is kept free at either end, in [0, 0.4], unless ``lower`` or ``upper`` is
            specified.

        Raises
        ------
        FileFormatError
            When the file cannot be read, names unknown joints or keys, or a value is not allowed.
        InvalidInputError
            The same for a mapping; or for another margin.
        """
        share = as_number(joint_limit_margin, "joint_limit_margin", minimum=0.0, maximum=0.4)
        is_file = isinstance(source, str | os.PathLike)
        where = str(source) if is_file else "limits"
        try:
            content: Any = {} if source is None else source
            content = read_settings(content, ("joints", "default")) if is_file else content
            joints, default = _checked(content, arm, where)
        except (InvalidInputError, FileFormatError) as error:
            raise (FileFormatError if is_file else InvalidInputError)(str(error)) from None
        own_names, free = list(arm.joint_names), set[str]()  # in the descriptions of the robots
        for member, columns in zip(as_group(arm).arms, as_group(arm).columns, strict=True):
            free |= set(member.chain.unlimited)
            for column, name in zip(columns, member.joint_names, strict=True):
                own_names[column] = name
        inside = share * (arm.upper - arm.lower)
        ends = np.stack([arm.lower + inside, arm.upper - inside])
        limits: dict[str, Array] = {quantity: np.zeros(arm.dof) for quantity in DERIVATIVES}
        joints_by_source: dict[str, dict[str, list[str]]] = {quantity: {} for quantity in DERIVATIVES}
        assumed: dict[str, list[str]] = {quantity: [] for quantity in QUANTITIES}
        for i, (name, unit, own) in enumerate(zip(arm.joint_names, arm.joint_units, own_names, strict=True)):
            numbers = joints.get(name, {})
            ends[:, i] = numbers.get("lower", ends[0, i]), numbers.get("upper", ends[1, i])
            if own in free and not {"lower", "upper"} <= numbers.keys():
                assumed["position"].append(name)
            described = np.inf if arm.velocity_limits is None else float(arm.velocity_limits[i])
            sources = {
                where: numbers,
                f"{where} (default)": default,
                "Franka's limits of the Panda (FER)": PANDA.get(own, {}),
                "the robot's description": {"velocity": described} if np.isfinite(described) else {},
            }
            for quantity in DERIVATIVES:
                source = next((source for source, values in sources.items() if quantity in values), None)
                if source is not None:
                    value = sources[source][quantity]
                else:
                    assumed[quantity].append(name)
                    value, source = _assumed(quantity, unit, {key: limits[key][i] for key in limits})
                limits[quantity][i] = value
                joints_by_source[quantity].setdefault(source, []).append(name)
        texts = {
            quantity: "; ".join(f"{source} ({', '.join(names)})" for source, names in by_source.items())
            if len(by_source) > 1
            else next(iter(by_source))
            for quantity, by_source in joints_by_source.items()
        }
        names = {quantity: tuple(own) for quantity, own in assumed.items()}
        return cls(arm.narrowed(*ends), sources=texts, assumed=names, **limits)

    def of_joints(self, arm: Arm, columns: NDArray[np.integer]) -> "MotionLimits":
        """Return the limits of one arm of a group; `columns` are its joints in the group."""
        names = [self.arm.joint_names[column] for column in columns]
        own = dict(zip(names, arm.joint_names, strict=True))
        assumed = {quantity: tuple(own[n] for n in joints if n in own) for quantity, joints in self.assumed.items()}
        theirs = {name: getattr(self, name)[columns] for name in DERIVATIVES}
        return MotionLimits(arm, sources=self.sources, assumed=assumed, **theirs)

    @property
    def lower(self) -> Array:
        """Smallest positions with the margin, shape (dof,) [rad] or [m]."""
        return np.asarray(self.arm.lower)

    @property
    def upper(self) -> Array:
        """Largest positions with the margin, shape (dof,) [rad] or [m]."""
        return np.asarray(self.arm.upper)

    def use(self, time: ArrayLike, q: ArrayLike) -> "LimitUse":
        """Largest share of each limit that a motion uses.

        Velocity, acceleration and jerk are first, second and third differences of neighboring samples, at the middle
        of these samples.

        Parameters
        ----------
        time : array_like, shape (m,)
            At a constant rate [s].
        q : array_like, shape (m, dof)
            [rad] or [m].

        Raises
        ------
        InvalidInputError
            When shapes do not fit, or the rate is not constant.
        """
        times, values = as_times(time, fewest=2), as_finite(q, "q")
        require_rows(len(times), q=(values, (self.arm.dof,)))
        step, steps = (times[-1] - times[0]) / (len(times) - 1), np.diff(times)
        if np.ptp(steps) > 1e-3 * step:
            raise InvalidInputError(
                f"time must have a constant rate; found steps of {steps.min():g} to {steps.max():g} s"
            )
        middle, half = 0.5 * (self.lower + self.upper), np.maximum(0.5 * (self.upper - self.lower), 1e-12)
        shares, at = np.zeros((4, self.arm.dof)), np.full((4, self.arm.dof), times[0])
        for order, quantity in enumerate(QUANTITIES):
            if order:
                values = np.diff(values, axis=0) / step
            if len(values):
                share = np.abs(values) / getattr(self, quantity) if order else np.abs(values - middle) / half
                shares[order] = share.max(axis=0)
                at[order] = times[share.argmax(axis=0)] + 0.5 * order * step
        return LimitUse(self.arm.joint_names, shares, at)


@dataclass(frozen=True, eq=False)
class LimitUse:
    """Largest shares of limits that a motion uses; 1 is the limit.

    Attributes
    ----------
    joint_names : tuple of str
        Names of the degrees of freedom.
    shares, times : ndarray, shape (4, dof)
        Largest shares of `QUANTITIES` (position, velocity, acceleration, jerk), and when [s]. A share of a position
        is measured from the middle of the joint's range.
    """

    joint_names: tuple[str, ...]
    shares: Array
    times: Array

    @property
    def largest(self) -> dict[str, tuple[str, float, float]]:
        """For each of `QUANTITIES` the joint that uses most, the share, and when [s]."""
        joint = self.shares.argmax(axis=1)
        return {
            quantity: (self.joint_names[j], float(self.shares[i, j]), float(self.times[i, j]))
            for i, (quantity, j) in enumerate(zip(QUANTITIES, joint, strict=True))
        }

    @property
    def within(self) -> bool:
        """Whether nothing exceeds its limit."""
        return bool(self.shares.max() <= 1.0 + 1e-9)


def _checked(content: Any, arm: Arm | ArmGroup, where: str) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Numbers for joints by name, and for those that are not named."""

    def numbers(content: Any, keys: tuple[str, ...], name: str) -> dict[str, float]:
        return {
            key: as_number(value, f"{name}: {key}", **({"above": 0.0} if key in DERIVATIVES else {}))
            for key, value in require_mapping(content, keys, name).items()
        }

    content = dict(content) if isinstance(content, Mapping) else content
    content = require_mapping(content, ("joints", "default"), where)
    default = numbers(content.get("default", {}), DERIVATIVES, f"{where}: default")
    entries = require_mapping(content.get("joints", {}), arm.joint_names, f"{where}: joints of {arm.name!r}")
    joints = {}
    for name, entry in entries.items():
        own, i = f"{where}: joints: {name}", arm.joint_names.index(name)
        joints[name] = numbers(entry, (*DERIVATIVES, "lower", "upper"), own)
        bounds = {"lower": float(arm.lower[i]), "upper": float(arm.upper[i])}
        for key in bounds.keys() & joints[name].keys():
            as_number(joints[name][key], f"{own}: {key}", minimum=bounds["lower"], maximum=bounds["upper"])
        lower, upper = (joints[name].get(key, bound) for key, bound in bounds.items())
        if lower >= upper:
            raise InvalidInputError(f"{own}: lower must be below upper; found {lower:g} and {upper:g}")
    return joints, default


def _assumed(quantity: str, unit: str, lower: Mapping[str, float]) -> tuple[float, str]:
    """Limit of a joint of which nothing is known, by its limits of lower derivatives, and its source.

    Without a number for them, accelerations reach the velocity limit, and jerks that acceleration, in certain times: on
    the safe side of makers who publish theirs. The Panda takes 0.13 to 0.29 s and 0.002 s, the xArm7 0.16 s and 0.04 s.
    """
    if quantity == "velocity":
        speed = {"rad": 1.0, "m": 0.25}[unit]  # slow enough for any arm
        return speed, f"assumed: {speed:g} {unit}/s"
    if quantity == "acceleration":
        return lower["velocity"] / 0.25, "assumed: velocity limit reached in 0.25 s"
    return lower["acceleration"] / 0.04, "assumed: acceleration limit reached in 0.04 s"
