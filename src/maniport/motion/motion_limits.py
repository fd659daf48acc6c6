"""How far, how fast and how abruptly the joints of a robot may move, and what share of that a motion uses."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

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
        source: str | os.PathLike[str] | Mapping[str, Any] | None = None,
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
        is_file = isinstance(source, str | os.PathLike)
        if is_file:
            where = str(source)
        else:
            where = "limits"
        try:
            content: Any = {} if source is None else source
            if is_file:
                content = read_settings(content, ("joints", "default"))
            joints, default = _checked(content, arm, where)
        except (InvalidInputError, FileFormatError) as error:
            raise (FileFormatError if is_file else InvalidInputError)(str(error)) from None
        # in the descriptions of the robots
        own_names = list(arm.joint_names)
        unlimited = set[str]()
        for member, columns in zip(as_group(arm).arms, as_group(arm).columns, strict=True):
            unlimited |= set(member.chain.unlimited)
            for column, name in zip(columns, member.joint_names, strict=True):
                own_names[column] = name
        inside = share * (arm.upper - arm.lower)
        ends = np.stack([arm.lower + inside, arm.upper - inside])
        pairs = [
            (name, joints.get(name, {}), own)
            for name, own in zip(arm.joint_names, own_names, strict=True)
        ]
        for i, (_, numbers, _) in enumerate(pairs):
            ends[:, i] = numbers.get("lower", ends[0, i]), numbers.get("upper", ends[1, i])
        free = (
            name
            for name, numbers, own in pairs
            if own in unlimited and not {"lower", "upper"} <= numbers.keys()
        )
        limits = dict[str, Array]()
        sources = dict[str, str]()
        assumed = {"position": tuple(free)}
        described = {"velocity": arm.velocity_limits, "effort": arm.effort_limits}
        for quantity in LIMITS:
            values = np.empty(arm.dof)
            chosen = [""] * arm.dof
            nominal = described.get(quantity)
            for i, (_, numbers, own) in enumerate(pairs):
                candidates = [
                    (numbers.get(quantity), where),
                    (default.get(quantity), f"{where} (default)"),
                    (PANDA.get(own, {}).get(quantity), "Franka's limits of the Panda (FER)"),
                    (
                        None if nominal is None or np.isinf(nominal[i]) else nominal[i],
                        "the robot's description",
                    ),
                ]
                if quantity in DERIVATIVES:
                    lower = {key: magnitudes[i] for key, magnitudes in limits.items()}
                    candidates.append(_assumed(quantity, arm.joint_units[i], lower))
                values[i], chosen[i] = next(
                    (pair for pair in candidates if pair[0] is not None), (np.inf, "")
                )
            limits[quantity] = values
            if quantity in DERIVATIVES:
                named = zip(arm.joint_names, chosen, strict=True)
                assumed[quantity] = tuple(name for name, text in named if text.startswith(ASSUMED))
            if any(chosen):
                sources[quantity] = "; ".join(filter(None, dict.fromkeys(chosen)))
        return cls(arm.narrowed(*ends), sources=sources, assumed=assumed, **limits)

    def of_joints(self, arm: Arm, columns: NDArray[np.integer]) -> "MotionLimits":
        """Return the limits of one arm of a group; `columns` are its joints in the group."""
        names = [self.arm.joint_names[column] for column in columns]
        own = dict(zip(names, arm.joint_names, strict=True))
        assumed = {}
        for quantity, joints in self.assumed.items():
            assumed[quantity] = tuple(own[n] for n in joints if n in own)
        theirs = {name: getattr(self, name)[columns] for name in LIMITS}
        return MotionLimits(arm, sources=self.sources, assumed=assumed, **theirs)

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
            shares |= {
                name: own
                for name, own in zip(TORQUES, series, strict=True)
                if own.max(initial=0.0) > 0.0
            }
        result = {}
        for quantity, share in shares.items():
            if len(share):
                joint = int(share.max(axis=0).argmax())
                row = int(share[:, joint].argmax())
                at = times[row] + 0.5 * step * (len(times) - len(share))
                result[quantity] = self.arm.joint_names[joint], float(share[row, joint]), float(at)
        return result


def _checked(
    content: Any, arm: Arm | ArmGroup, where: str
) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Numbers for joints by name, and for those that are not named."""

    def numbers(content: Any, keys: tuple[str, ...], name: str) -> dict[str, float]:
        return {
            key: as_number(value, f"{name}: {key}", **({"above": 0.0} if key in LIMITS else {}))
            for key, value in require_mapping(content, keys, name).items()
        }

    if isinstance(content, Mapping):
        content = dict(content)
    content = require_mapping(content, ("joints", "default"), where)
    default = numbers(content.get("default", {}), LIMITS, f"{where}: default")
    entries = require_mapping(
        content.get("joints", {}), arm.joint_names, f"{where}: joints of {arm.name!r}"
    )
    joints = {}
    for name, entry in entries.items():
        own = f"{where}: joints: {name}"
        i = arm.joint_names.index(name)
        joints[name] = numbers(entry, (*LIMITS, "lower", "upper"), own)
        bounds = {"lower": float(arm.lower[i]), "upper": float(arm.upper[i])}
        for key in bounds.keys() & joints[name].keys():
            as_number(
                joints[name][key], f"{own}: {key}", minimum=bounds["lower"], maximum=bounds["upper"]
            )
        lower, upper = (joints[name].get(key, bound) for key, bound in bounds.items())
        if lower >= upper:
            raise InvalidInputError(
                f"{own}: lower must be below upper; found {lower:g} and {upper:g}"
            )
    return joints, default


def _assumed(quantity: str, unit: str, lower: Mapping[str, float]) -> tuple[float, str]:
    """Limit of a joint of which nothing is known, by its limits of lower derivatives, and its source."""
    if quantity == "velocity":
        speed = {"rad": 1.0, "m": 0.25}[unit]  # slow enough for any arm
        return speed, f"{ASSUMED}{speed:g} {unit}/s"
    # on the safe side of makers: the Panda takes 0.13 to 0.29 s and 0.002 s, the xArm7 0.16 s and 0.04 s
    if quantity == "acceleration":
        return lower["velocity"] / 0.25, f"{ASSUMED}velocity limit reached in 0.25 s"
    return lower["acceleration"] / 0.04, f"{ASSUMED}acceleration limit reached in 0.04 s"
