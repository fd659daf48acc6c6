"""Directions in which the person is strong and fast, as targets of a robot's arm."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from maniport.arms import Arm
from maniport.arms.directional import half_sphere, is_limited, smooth_extents
from maniport.errors import ManiportWarning
from maniport.mocap import ArmFit
from maniport.motion import Planner
from maniport.motion.directions import DirectionTarget, extent_reference, strongest_lines
from maniport.motion.targets import TargetTrajectory
from maniport.pipeline.human import Human
from maniport.pipeline.options import TransferOptions
from maniport.transfer import DomainAdapter
from maniport.util.validation import Array

LINES = 256  # Along which the person's extents are compared
CHOSEN = 8  # Of them, those that the robot's extents are compared along
SHARPNESS = 8  # Power of extents to which weights of lines are proportional
BLOCK = 512  # Frames at a time
CAPABILITIES = {
    "none": (),
    "force": ("force",),
    "speed": ("velocity",),
    "both": ("force", "velocity"),
}
"""Kinds of extents by the words of the option."""


@dataclass(frozen=True, eq=False)
class PersonDirections:
    """Lines in which a person's arm has most force or speed, at each frame, in the trunk frame."""

    kind: str
    lines: Array  # (n, k, 3), from the largest extent on
    weights: Array  # (n, k), sum 1

    @property
    def best(self) -> Array:
        """The line with the largest extent, shape (n, 3)."""
        return self.lines[:, 0]


def person_directions(fit: ArmFit, kind: str) -> PersonDirections:
    """Find the lines in which a person's arm has most force, or most speed with joint velocities of at most 1 rad/s."""
    arm = limited_person(fit.arm, kind)
    half = half_sphere(LINES)
    chosen = []
    weights = []
    for begin in range(0, len(fit.joint_angles), BLOCK):
        q = fit.joint_angles[begin : begin + BLOCK]
        lines = np.broadcast_to(half, (len(q), *half.shape))
        logs = smooth_extents(arm, q, lines, kind, derivatives=False).logs
        best = strongest_lines(np.exp(logs), half, CHOSEN, SHARPNESS)
        chosen.append(best[0])
        weights.append(best[1])
    return PersonDirections(kind, np.concatenate(chosen), np.concatenate(weights))


def limited_person(arm: Arm, kind: str) -> Arm:
    """Return the arm of a person with velocity limits of 1 rad/s for speeds: those of people are not known."""
    if kind == "velocity":
        return arm.with_limits(velocity=1.0)
    return arm


def with_directions(
    targets: Sequence[TargetTrajectory],
    human: Human,
    adapters: Sequence[DomainAdapter],
    planner: Planner,
    options: TransferOptions,
) -> tuple[TargetTrajectory, ...]:
    """Add the person's directions, turned as the maps turn ellipsoids, where limits are known."""
    results = []
    arms = zip(targets, human.motion.arms, adapters, planner.arms, strict=True)
    for target, fit, adapter, arm_planner in arms:
        robot = arm_planner.limits.arm
        directions = []
        for kind in usable_kinds(fit.arm, robot, options.capability):
            of_person = person_directions(fit, kind)
            direction = DirectionTarget(
                kind=kind,
                lines=of_person.lines @ adapter.map_rotation_[:3, :3].T,
                weights=options.capability_weight * of_person.weights,
                reference=extent_reference(robot, kind),
            )
            directions.append(direction)
        results.append(replace(target, directions=tuple(directions)))
    return tuple(results)


def usable_kinds(person: Arm, robot: Arm, capability: str) -> list[str]:
    """Return the kinds of extents for which person and robot have limits, with a warning for others."""
    kinds = []
    for kind in CAPABILITIES[capability]:
        lacking = [
            arm.name for arm in (limited_person(person, kind), robot) if not is_limited(arm, kind)
        ]
        if not lacking:
            kinds.append(kind)
            continue
        limits = "velocity" if kind == "velocity" else "effort"
        text = f"{kind} along the person's directions is no target: {lacking[0]!r} has no {limits} limits"
        warnings.warn(text, ManiportWarning, stacklevel=2)
    return kinds


def positions_only(targets: Sequence[TargetTrajectory]) -> tuple[TargetTrajectory, ...]:
    """Return targets whose ellipsoids and directions do not count."""
    return tuple(replace(target, directions=(), with_ellipsoids=False) for target in targets)
