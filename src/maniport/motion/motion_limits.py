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
from maniport.util.validation import Array, Bounds, as_finite, as_number, as_times

PANDA = {
    "panda_joint1": {"acceleration": 15.0, "jerk": 7500.0},
    "panda_joint2": {"acceleration": 7.5, "jerk": 3750.0},
    "panda_joint3": {"acceleration": 10.0, "jerk": 5000.0},
    "panda_joint4": {"acceleration": 12.5, "jerk": 6250.0},
    "panda_joint5": {"acceleration": 15.0, "jerk": 7500.0},
    "panda_joint6": {"acceleration": 20.0, "jerk": 10000.0},
    "panda_joint7": {"acceleration": 20.0, "jerk": 10000.0},
}
"""[rad/s² and rad/s³], by joint: Franka Control Interface, "Limits for Franka Emika Robot (FER)"."""
PANDA_SOURCE = "Franka's limits of the Panda (FER)"

DERIVATIVES = ("velocity", "acceleration", "jerk")
QUANTITIES = ("position", *DERIVATIVES)


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Limits of the joints of an arm; make them with `MotionLimits.of`.

    Attributes
    ----------
    arm : Arm or ArmGroup
        The arm, or the pair of them, with narrowed position limits, which include the margin.
    velocity, acceleration, jerk : ndarray, shape (dof,)
        Largest magnitudes, positive and finite [rad or m, per second, second² and second³].
    sources : dict of str to str
        For ``"velocity"``, ``"acceleration"`` and ``"jerk"`` a sentence on the source of the numbers.
    assumed : dict of str to tuple of str
        For each of `QUANTITIES` the joints whose limit is neither given, nor the maker's, nor in the robot's
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
        given: str | os.PathLike[str] | Mapping[str, Any] | None = None,
        joint_limit_margin: float = MARGIN,
    ) -> "MotionLimits":
        """Take limits from the argument, else from the maker, else from the arm's description, else from defaults.

        Parameters
        ----------
        arm : Arm or ArmGroup
        given : path, mapping or None
            A YAML file or a mapping with ``joints: {name: {velocity:, acceleration:, jerk:, lower:, upper:}}`` and
            ``default: {velocity:, acceleration:, jerk:}`` for the other joints, all of it optional. The Panda's
            accelerations and jerks are known, and recognized by the names of its joints.
        joint_limit_margin : float
            Share of each joint's range that is kept free at either end, in [0, 0.4], unless ``lower`` or ``upper`` is
            given.

        Raises
        ------
        FileFormatError
            When the file cannot be read, names unknown joints or keys, or a value is not allowed.
        InvalidInputError
            The same for a mapping; or for another margin.
        """
        share = as_number(joint_limit_margin, "joint_limit_margin", minimum=0.0, maximum=0.4)
        is_file = isinstance(given, str | os.PathLike)
        where = str(given) if is_file else "limits"
        try:
            content = {} if given is None else read_settings(given, _KEYS) if is_file else given  # type: ignore[arg-type]
            joints, default = _checked(content, arm, where)
        except (InvalidInputError, FileFormatError) as error:
            raise (FileFormatError if is_file else InvalidInputError)(str(error)) from None
        inside = share * (arm.upper - arm.lower)
        ends = np.stack([arm.lower + inside, arm.upper - inside])
        for i, name in enumerate(arm.joint_names):
            for side, key in enumerate(("lower", "upper")):
                ends[side, i] = joints.get(name, {}).get(key, ends[side, i])
        found: dict[str, Array] = {}
        sources: dict[str, str] = {}
        assumed = {"position": tuple(n for n in _unlimited(arm) if not {"lower", "upper"} <= joints.get(n, {}).keys())}
        for quantity in DERIVATIVES:
            found[quantity], sources[quantity], assumed[quantity] = _look_up(
                arm, quantity, joints, default, where, found
            )
        return cls(arm.narrowed(*ends), sources=sources, assumed=assumed, **found)

    def of_joints(self, arm: Arm, columns: NDArray[np.integer]) -> "MotionLimits":
        """Return the limits of one arm of a pair; `columns` are its joints in the pair."""
        names = [self.arm.joint_names[column] for column in columns]
        own = dict(zip(names, arm.joint_names, strict=True))
        assumed = {quantity: tuple(own[n] for n in found if n in own) for quantity, found in self.assumed.items()}
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
        shares, at = [np.abs(values - middle) / half], [times]
        for order, quantity in enumerate(DERIVATIVES, start=1):
            values = np.diff(values, axis=0) / step
            shares.append(np.abs(values) / getattr(self, quantity))
            at.append(times[: len(values)] + 0.5 * order * step)
        when = [
            t[share.argmax(axis=0)] if len(share) else np.full(self.arm.dof, times[0])
            for share, t in zip(shares, at, strict=True)
        ]
        return LimitUse(self.arm.joint_names, np.array([s.max(axis=0, initial=0.0) for s in shares]), np.array(when))


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


_KEYS = ("joints", "default")


def _checked(content: Any, arm: Arm | ArmGroup, where: str) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Numbers for joints by name, and for those that are not named."""
    content = require_mapping(dict(content) if isinstance(content, Mapping) else content, _KEYS, where)
    default = _numbers(content.get("default", {}), DERIVATIVES, f"{where}: default")
    entries = require_mapping(content.get("joints", {}), arm.joint_names, f"{where}: joints of {arm.name!r}")
    joints = {n: _numbers(e, (*DERIVATIVES, "lower", "upper"), f"{where}: joints: {n}") for n, e in entries.items()}
    for name, numbers in joints.items():
        i = arm.joint_names.index(name)
        least, most = float(arm.lower[i]), float(arm.upper[i])
        for key in ("lower", "upper"):
            if key in numbers:
                as_number(numbers[key], f"{where}: joints: {name}: {key}", minimum=least, maximum=most)
        if numbers.get("lower", least) >= numbers.get("upper", most):
            raise InvalidInputError(
                f"{where}: joints: {name}: lower must be below upper; found {numbers.get('lower', least):g} and "
                f"{numbers.get('upper', most):g}"
            )
    return joints, default


def _numbers(content: Any, keys: tuple[str, ...], where: str) -> dict[str, float]:
    return {
        key: as_number(value, f"{where}: {key}", **(Bounds(above=0.0) if key in DERIVATIVES else Bounds()))
        for key, value in require_mapping(content, keys, where).items()
    }


def _own_names(arm: Arm | ArmGroup) -> list[str]:
    """What the joints are called in the descriptions of their robots."""
    names = list(arm.joint_names)
    group = as_group(arm)
    for one, columns in zip(group.arms, group.columns, strict=True):
        for column, name in zip(columns, one.joint_names, strict=True):
            names[column] = name
    return names


def _unlimited(arm: Arm | ArmGroup) -> list[str]:
    """Names of the joints whose position the description does not limit."""
    free = {name for one in as_group(arm).arms for name in one.chain.unlimited}
    return [name for name, own in zip(arm.joint_names, _own_names(arm), strict=True) if own in free]


def _look_up(
    arm: Arm | ArmGroup,
    quantity: str,
    joints: dict[str, dict[str, float]],
    default: dict[str, float],
    where: str,
    found: dict[str, Array],
) -> tuple[Array, str, tuple[str, ...]]:
    """Limits of one quantity for all joints, the sentence about their source, and the assumed ones."""
    values, names_by_source, assumed = np.zeros(arm.dof), dict[str, list[str]](), list[str]()
    for i, (name, unit, own) in enumerate(zip(arm.joint_names, arm.joint_units, _own_names(arm), strict=True)):
        described = np.inf if arm.velocity_limits is None else float(arm.velocity_limits[i])
        known = (
            (joints.get(name, {}).get(quantity), where),
            (default.get(quantity), f"{where} (default)"),
            (PANDA.get(own, {}).get(quantity), PANDA_SOURCE),
            (described if quantity == "velocity" and np.isfinite(described) else None, "the robot's description"),
        )
        value, source = next((one for one in known if one[0] is not None), (None, ""))
        if value is None:
            assumed.append(name)
            value, source = _assumed(quantity, unit, {key: found[key][i] for key in found})
        values[i] = value
        names_by_source.setdefault(source, []).append(name)
    sources = [f"{source} ({', '.join(names)})" for source, names in names_by_source.items()]
    text = next(iter(names_by_source)) if len(sources) == 1 else "; ".join(sources)
    return values, text, tuple(assumed)


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
