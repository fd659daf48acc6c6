"""Lines along which a robot's arm shall be strong and fast, as targets; what it gains along them."""

import warnings
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from maniport.arms import Arm
from maniport.arms.directional import half_sphere, is_limited, smooth_extents
from maniport.errors import ManiportWarning
from maniport.evaluation import Capability, compare_capability
from maniport.evaluation.capability import DirectedMotion, PersonMotion
from maniport.mocap import ArmFit
from maniport.motion import Placement, Planner, RobotMotion
from maniport.motion.directions import (
    DirectionTarget,
    extent_reference,
    path_tangents,
    strongest_line,
    strongest_lines,
)
from maniport.motion.targets import TargetTrajectory
from maniport.pipeline.following import SampledRobot, move, plan
from maniport.pipeline.human import Human
from maniport.pipeline.options import TransferOptions
from maniport.pipeline.settings import Settings
from maniport.transfer import DomainAdapter
from maniport.util.progress import Step, no_progress
from maniport.util.validation import Array

LINES = 256  # Number of lines along which the person's extents are compared
CHOSEN = 8  # Number of these lines along which the robot shall be strong or fast
SHARPNESS = 8  # Power of the extents to which the weights of lines are proportional
BLOCK = 512  # Number of frames whose extents are computed at once
EASIER = (
    8  # Factor by which the search is reduced for positions only, whose cost has few local minima
)

CAPABILITIES = {
    "none": (),
    "force": ("force",),
    "speed": ("velocity",),
    "both": ("force", "velocity"),
}
"""Kinds of extents by the words of the option."""

DirectionTargets = tuple[DirectionTarget, ...]  # of an arm, before its path is placed


def person_lines(fit: ArmFit, kind: str) -> tuple[Array, Array]:
    """Find the lines in which a person's arm has most force, or speed with joint velocities of at most 1 rad/s.

    Returns
    -------
    lines : ndarray, shape (n, 8, 3)
        In the trunk frame, from the largest extent on, at each frame.
    weights : ndarray, shape (n, 8)
        Proportional to the eighth power of the extents, so that they change continuously; their sum is one.
    """
    arm = limited_person(fit.arm, kind)
    half = half_sphere(LINES)
    lines = []
    weights = []
    for begin in range(0, len(fit.joint_angles), BLOCK):
        q = fit.joint_angles[begin : begin + BLOCK]
        everywhere = np.broadcast_to(half, (len(q), *half.shape))
        logs = smooth_extents(arm, q, everywhere, kind, derivatives=False).logs
        strongest = strongest_lines(np.exp(logs), half, CHOSEN, SHARPNESS)
        lines.append(strongest[0])
        weights.append(strongest[1])
    return np.concatenate(lines), np.concatenate(weights)


def limited_person(arm: Arm, kind: str) -> Arm:
    """Return the arm of a person with velocity limits of 1 rad/s for speeds: those of people are not known."""
    if kind == "velocity":
        return arm.with_limits(velocity=1.0)
    return arm


def directions_of(
    human: Human, adapters: Sequence[DomainAdapter], planner: Planner, settings: Settings
) -> list[DirectionTargets]:
    """Return lines for each arm, turned as its map turns ellipsoids, where limits are known.

    They are of force and speed, whatever the options ask for: results are compared along them. A file has those of its
    columns.
    """
    options = settings.config
    given = settings.given_lines or (None,) * len(human.motion.arms)
    results = []
    arms = zip(human.motion.arms, human.hand_paths, adapters, planner.arms, given, strict=True)
    for fit, hand_path, adapter, arm_planner, of_file in arms:
        robot = arm_planner.limits.arm
        kinds = CAPABILITIES["both"] if of_file is None else tuple(of_file.lines)
        follows_path = of_file is None and isinstance(options.direction, str)
        directions = []
        for kind in usable_kinds(fit.arm, robot, options.capability, kinds):
            if of_file is None:
                lines, weights = chosen_lines(fit, hand_path, kind, options.direction)
            else:
                lines = of_file.at(fit.time, kind)[:, None]
                weights = np.ones((len(lines), 1))
            if follows_path:
                lines = lines @ adapter.map_rotation_[:3, :3].T
            direction = DirectionTarget(
                kind=kind,
                lines=lines,
                weights=options.capability_weight * weights,
                reference=extent_reference(robot, kind),
                follows_path=follows_path,
            )
            directions.append(direction)
        results.append(tuple(directions))
    return results


def chosen_lines(
    fit: ArmFit, hand_path: Array, kind: str, direction: str | Sequence[float]
) -> tuple[Array, Array]:
    """Return lines (n, k, 3) and weights (n, k) at each frame: the person's, of the path, or a given one."""
    if direction == "person":
        return person_lines(fit, kind)
    if direction == "path":
        lines = path_tangents(fit.time, hand_path)
    else:
        vector = np.asarray(direction, dtype=np.float64)
        lines = np.tile(vector / np.linalg.norm(vector), (len(fit.time), 1))
    return lines[:, None], np.ones((len(lines), 1))


def usable_kinds(
    person: Arm, robot: Arm, capability: str, offered: Sequence[str] = CAPABILITIES["both"]
) -> list[str]:
    """Return the offered kinds of extents for which both have limits, with a warning for others that are asked for."""
    kinds = []
    for kind in offered:
        lacking = []
        for arm in (limited_person(person, kind), robot):
            if not is_limited(arm, kind):
                lacking.append(arm.name)
        if not lacking:
            kinds.append(kind)
        elif kind in CAPABILITIES[capability]:
            what, limits = ("speed", "velocity") if kind == "velocity" else ("force", "effort")
            text = f"{what} is no target: {lacking[0]!r} has no {limits} limits of all joints"
            warnings.warn(text, ManiportWarning, stacklevel=2)
    return kinds


def with_directions(
    targets: Sequence[TargetTrajectory], directions: Sequence[DirectionTargets], capability: str
) -> tuple[TargetTrajectory, ...]:
    """Add those lines to targets that the option asks for."""
    results = []
    for target, of_arm in zip(targets, directions, strict=True):
        wanted = tuple(each for each in of_arm if each.kind in CAPABILITIES[capability])
        results.append(replace(target, directions=wanted))
    return tuple(results)


def positions_only(targets: Sequence[TargetTrajectory]) -> tuple[TargetTrajectory, ...]:
    """Return targets whose ellipsoids and lines do not count."""
    return tuple(replace(target, directions=(), with_ellipsoids=False) for target in targets)


@dataclass(frozen=True, eq=False)
class PlacedMotion:
    """A motion and the placements of its paths, if they were placed."""

    motion: RobotMotion
    placements: tuple[Placement, ...] | None

    def directed(self, arm: int, direction: DirectionTarget, map_rotation: Array) -> DirectedMotion:
        """Return the motion of an arm with the strongest lines at its waypoints."""
        rotation = np.eye(3)
        if self.placements is not None:
            rotation = self.placements[arm].rotation
        lines = strongest_line(direction.turned(rotation))
        joint_positions = self.motion.arms[arm].joint_positions
        return DirectedMotion(joint_positions, lines, rotation @ map_rotation)


@dataclass(frozen=True, eq=False)
class Comparison:
    """A motion and two through the positions alone, which show what ellipsoids and lines gain."""

    moved: PlacedMotion
    position_only: PlacedMotion | None = None
    same_path: PlacedMotion | None = None

    @classmethod
    def of(
        cls,
        moved: PlacedMotion,
        targets: Sequence[TargetTrajectory],
        robot: SampledRobot,
        settings: Settings,
        map_rotation: Array,
    ) -> "Comparison":
        """Plan motions through the positions alone: on an own placement of the same scale, and on the same path."""
        if moved.placements is None:
            return cls(moved)
        step = Step(settings.progress, "Compare with positions only")
        robot = replace(robot, random=deepcopy(robot.random))
        config = settings.config.changed(scale=moved.placements[0].scale)
        assert settings.plan is not None
        options = replace(settings.plan, budget=settings.plan.budget.reduced(EASIER))
        quiet = replace(settings, config=config, plan=options, progress=no_progress)
        free = positions_only(targets)
        other = PlacedMotion(*move(free, robot, quiet, map_rotation, pointwise=False))
        step(0.7)
        placed = []
        starts = []
        for placement, target in zip(moved.placements, free, strict=True):
            placed.append(placement.moved(target))
            starts.append(placement.joint_positions)
        same = plan(placed, robot, quiet, starts, pointwise=False)
        step.end()
        return cls(moved, other, PlacedMotion(same, moved.placements))

    def capabilities(
        self,
        arm: int,
        robot: Arm,
        fit: ArmFit,
        directions: DirectionTargets,
        map_rotation: Array,
        options: TransferOptions,
    ) -> tuple[Capability, ...]:
        """Compare force and speed of an arm along its lines."""
        along = "direction"
        if isinstance(options.direction, str) and not options.directions:
            along = options.direction
        results = []
        for direction in directions:
            references: list[DirectedMotion | None] = []
            for reference in (self.position_only, self.same_path):
                if reference is None:
                    references.append(None)
                else:
                    references.append(reference.directed(arm, direction, map_rotation))
            result = compare_capability(
                direction.kind,
                robot,
                fit.time,
                self.moved.directed(arm, direction, map_rotation),
                position_only=references[0],
                same_path=references[1],
                person=PersonMotion(limited_person(fit.arm, direction.kind), fit.joint_angles),
            )
            is_target = direction.kind in CAPABILITIES[options.capability]
            results.append(replace(result, along=along, is_target=is_target))
        return tuple(results)
