"""What an audit computes for each frame of a motion, and what it cannot check."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.collisions import Collisions
from maniport.arms.directional import is_limited, polytope_extent
from maniport.audit.kernels import fill_speed_extents
from maniport.errors import some_of
from maniport.motion import MotionLimits
from maniport.util.validation import Array

POSITION = "position"
VELOCITY = "velocity"
ACCELERATION = "acceleration"
TORQUE = "torque"
COLLISION = "collision"
KINDS = (POSITION, VELOCITY, ACCELERATION, TORQUE, COLLISION)
"""Kinds of findings."""
SHARES = (POSITION, VELOCITY, ACCELERATION, TORQUE)

POSITION_TOLERANCE = 1e-3  # of limits of positions [rad or m]: files have three digits or more
PLACEHOLDERS = (
    1.0,
    10.0,
    100.0,
    1000.0,
)  # of velocities and torques that files have for unknown ones
STILL = 1e-4  # speed of an end effector below which its motion has no direction [m/s]


@dataclass(frozen=True)
class NotChecked:
    """A quantity that an audit does not check.

    Attributes
    ----------
    kind : str
        Of `KINDS`, or another quantity.
    reason : str
    complete : bool
        Whether nothing of the kind is checked; otherwise some joints or links are left out.
    """

    kind: str
    reason: str
    complete: bool = True


class FrameTable(NamedTuple):
    """Results for the n frames of one motion; nan where a quantity is not checked."""

    time: Array  # (n,) [s]
    shares: Mapping[str, Array]  # (n,) largest share of a limit of all joints, by `SHARES`
    joints: Mapping[str, NDArray[np.intp]]  # (n,) the joint of that share
    exceeded: Mapping[str, NDArray[np.bool_]]  # (n,) whether a limit is exceeded, by `KINDS`
    singular_value: (
        Array  # (n,) smallest one of the linear Jacobian [m, for 1 rad or 1 m of a joint]
    )
    speed: Array  # (n,) of the end effector [m/s]
    speed_share: Array  # (n,) of the largest speed in its direction
    force: Array  # (n,) largest force in the direction of motion [N]


@dataclass(frozen=True, eq=False)
class Checks:
    """The checks of a robot; they can be sent to other processes.

    Attributes
    ----------
    robot : Arm or ArmGroup
    limits : MotionLimits
        Without a margin.
    collisions : Collisions or None
    tolerance : float
        Share by which limits of velocity, acceleration and torque may be exceeded.
    checked : mapping of str to ndarray of bool, shape (dof,)
        Joints whose limits are known, by `SHARES`.
    not_checked : tuple of NotChecked
    """

    robot: Arm | ArmGroup
    limits: MotionLimits
    collisions: Collisions | None
    tolerance: float
    checked: Mapping[str, NDArray[np.bool_]]
    not_checked: tuple[NotChecked, ...] = field(default_factory=tuple)

    @classmethod
    def of(
        cls,
        robot: Arm | ArmGroup,
        limits: MotionLimits,
        collisions: Collisions | None,
        tolerance: float,
        stated: Sequence[str] = (),
    ) -> "Checks":
        """Choose what can be checked of a robot.

        Parameters
        ----------
        robot : Arm or ArmGroup
        limits : MotionLimits
            Without a margin.
        collisions : Collisions, optional
        tolerance : float
        stated : sequence of str
            Quantities whose limits a file of the caller states: they are no placeholders.
        """
        left_out: list[NotChecked] = []
        checked = {}
        for kind in SHARES:
            known, reasons = _known_limits(robot, limits, kind, kind in stated)
            checked[kind] = known
            left_out += reasons
        if limits.dynamics is not None:
            left_out.append(
                NotChecked("payload", f"torques are with the payload of {_payload(robot)}", False)
            )
        if collisions is None or not collisions.checked:
            reason = "collision checking is off" if collisions is None else collisions.reason
            left_out.append(NotChecked(COLLISION, reason))
        elif not collisions.pairs:
            reason = "the description excludes all contacts, or no two links can touch"
            left_out.append(NotChecked(COLLISION, reason))
        elif collisions.unchecked:
            left_out.append(
                NotChecked(COLLISION, f"not checked: {some_of(collisions.unchecked, 20)}", False)
            )
        left_out.append(
            NotChecked(
                "contacts", "objects, grippers' loads and people are not in the model", False
            )
        )
        return cls(robot, limits, collisions, tolerance, checked, tuple(left_out))

    def is_checked(self, kind: str) -> bool:
        """Whether anything of a kind is checked."""
        if kind == COLLISION:
            return self.collisions is not None and bool(self.collisions.pairs)
        return bool(self.checked[kind].any())

    def table(self, time: Array, q: Array) -> FrameTable:
        """Compute all quantities of a motion with times (n,) [s] and positions (n, dof) [rad or m]."""
        velocities, accelerations = derivatives(time, q)
        shares = {}
        joints = {}
        exceeded = {}
        values = self._share_values(q, velocities, accelerations)
        for kind in SHARES:
            share = values[kind]
            known = self.checked[kind]
            if share is None or not known.any():
                shares[kind] = np.full(len(q), np.nan)
                joints[kind] = np.zeros(len(q), dtype=np.intp)
                exceeded[kind] = np.zeros(len(q), dtype=np.bool_)
                continue
            share = np.where(known, share, 0.0)
            joints[kind] = share.argmax(axis=1)
            shares[kind] = share.max(axis=1)
            exceeded[kind] = shares[kind] > 1.0 + self.tolerance
        exceeded[POSITION] = self._outside(q)
        exceeded[COLLISION] = np.zeros(len(q), dtype=np.bool_)
        if self.collisions is not None and self.is_checked(COLLISION):
            exceeded[COLLISION] = self.collisions.collides(q)
        return FrameTable(time, shares, joints, exceeded, *self._directional(q, velocities))

    def _share_values(
        self, q: Array, velocities: Array, accelerations: Array
    ) -> dict[str, Array | None]:
        """Shares (n, dof) of limits by kind; None without masses."""
        lower = self.limits.arm.lower
        upper = self.limits.arm.upper
        middle = 0.5 * (lower + upper)
        half = np.maximum(0.5 * (upper - lower), 1e-12)
        torque_shares = None
        if self.checked[TORQUE].any() and self.limits.dynamics is not None:
            torques = self.limits.dynamics.torques(q, velocities, accelerations)
            torque_shares = np.abs(torques) / self.limits.effort
        return {
            POSITION: np.abs(q - middle) / half,
            VELOCITY: np.abs(velocities) / self.limits.velocity,
            ACCELERATION: np.abs(accelerations) / self.limits.acceleration,
            TORQUE: torque_shares,
        }

    def _outside(self, q: Array) -> NDArray[np.bool_]:
        below = q < self.limits.arm.lower - POSITION_TOLERANCE
        above = q > self.limits.arm.upper + POSITION_TOLERANCE
        return np.asarray(((below | above) & self.checked[POSITION]).any(axis=1))

    def _directional(self, q: Array, velocities: Array) -> tuple[Array, Array, Array, Array]:
        """Smallest singular values, speeds, their shares and forces along the motion; the worst of all arms."""
        group = as_group(self.robot)
        count = len(q)
        singular_values = np.full(count, np.inf)
        speeds = np.zeros(count)
        speed_shares = np.full(count, np.nan)
        forces = np.full(count, np.nan)
        for arm, own, rates in zip(
            group.arms, group.split(q), group.split(velocities), strict=True
        ):
            jacobians = arm.jacobian(own)[:, :3]
            squares = np.linalg.eigvalsh(jacobians @ np.swapaxes(jacobians, 1, 2))
            singular_values = np.minimum(singular_values, np.sqrt(np.maximum(squares[:, 0], 0.0)))
            motions = np.einsum("nij,nj->ni", jacobians, rates)
            speed = np.linalg.norm(motions, axis=1)
            speeds = np.maximum(speeds, speed)
            moving = np.flatnonzero(speed > STILL)
            directions = motions[moving] / speed[moving, None]
            largest = arm.velocity_limits
            if largest is not None and is_limited(arm, "velocity") and self.checked[VELOCITY].all():
                extents = np.empty(len(moving))
                generators = np.ascontiguousarray(jacobians[moving] * largest)
                fill_speed_extents(generators, np.ascontiguousarray(directions), extents)
                used = speed[moving] / extents
                speed_shares[moving] = np.fmax(speed_shares[moving], used)
            if is_limited(arm, "force") and self.checked[TORQUE].all() and len(moving):
                limits = polytope_extent(arm, own[moving], directions[:, None], "force")[:, 0]
                forces[moving] = np.fmin(forces[moving], limits)
        return singular_values, speeds, speed_shares, forces


def derivatives(time: Array, q: Array) -> tuple[Array, Array]:
    """Central differences of positions (n, dof) at times (n,), with those of the neighbors at the ends."""
    slopes = np.diff(q, axis=0) / np.diff(time)[:, None]
    velocities = np.empty_like(q)
    velocities[0] = slopes[0]
    velocities[-1] = slopes[-1]
    accelerations = np.zeros_like(q)
    if len(q) > 2:
        before = np.diff(time)[:-1, None]
        after = np.diff(time)[1:, None]
        velocities[1:-1] = (after * slopes[:-1] + before * slopes[1:]) / (before + after)
        accelerations[1:-1] = np.diff(slopes, axis=0) / (0.5 * (before + after))
        accelerations[0] = accelerations[1]
        accelerations[-1] = accelerations[-2]
    return velocities, accelerations


def _known_limits(
    robot: Arm | ArmGroup, limits: MotionLimits, kind: str, stated: bool
) -> tuple[NDArray[np.bool_], list[NotChecked]]:
    """Return the joints (dof,) whose limits are known, and why others are not checked."""
    known = np.ones(robot.dof, dtype=np.bool_)
    names = np.array(robot.joint_names)
    if kind == TORQUE:
        if limits.dynamics is None:
            reason = f"the description of {robot.name!r} has no masses"
            return ~known, [NotChecked(kind, reason)]
        values = limits.effort
        known = np.isfinite(values)
    else:
        known = ~np.isin(names, limits.assumed[kind])
        values = limits.velocity
    if not known.any():
        reason = "no limits of joints are known"
        if kind == POSITION:
            reason = "no joint has limits"
        return known, [NotChecked(kind, f"{reason}; a file for --limits states them")]
    if kind in (VELOCITY, TORQUE) and not stated and _are_placeholders(values[known]):
        unit = "rad/s" if kind == VELOCITY else "N m"
        reason = (
            f"all joints have the limit {values[known][0]:g} {unit}, a placeholder; a file for --limits "
            "states the true ones"
        )
        return np.zeros_like(known), [NotChecked(kind, reason)]
    if not known.all():
        reason = f"limits of some joints are unknown: {some_of(names[~known], 20)}"
        return known, [NotChecked(kind, reason, complete=False)]
    return known, []


def _are_placeholders(values: Array) -> bool:
    """Whether all limits are one round number, as in descriptions without known limits."""
    return bool(np.all(values == values[0]) and values[0] in PLACEHOLDERS)


def _payload(robot: Arm | ArmGroup) -> str:
    masses = [arm.chain.payload for arm in as_group(robot).arms]
    return " and ".join(f"{mass:g} kg" for mass in masses)
