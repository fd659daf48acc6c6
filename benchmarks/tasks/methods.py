"""Methods of redundancy resolution: joint positions along the same path, by different criteria.

Position-only motions and random ones follow the path by the pseudoinverse. Each other method is one cost of a
configuration at a waypoint. All costs are minimized by the same search over the same random samples, with the same
weight of joint motion: costs are divided by their standard deviation over the samples first.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from benchmarks.tasks.task import Demonstration, StudyRobot, Task, place
from maniport.arms import Arm, EllipsoidSpec, load_arm
from maniport.arms.collisions import Collisions, free_configurations
from maniport.arms.directional import half_sphere, line_extent, polytope_extent
from maniport.arms.manipulability import JOINT_LIMITS
from maniport.domain import sample_domain
from maniport.errors import collected_warnings
from maniport.evaluation.comparison import with_feasible_set
from maniport.motion import MotionLimits
from maniport.motion.plan.roadmap import (
    IN_PLACE,
    Roadmap,
    moved_to_positions,
    shortest_path,
    stages_of,
)
from maniport.motion.problem import ArmProblem
from maniport.motion.targets import TargetTrajectory, damping_of
from maniport.motion.trajectory import interpolated
from maniport.transfer import DomainAdapter, method_of
from maniport.util.defaults import DAMPING
from maniport.util.validation import Array

SPECS = {"velocity": EllipsoidSpec(), "force": EllipsoidSpec("force", joint_weights=JOINT_LIMITS)}

Rows = NDArray[np.intp]
Cost = Callable[[Rows, Array], Array]
"""Cost (m,) of configurations (m, dof) at waypoints (m,)."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A task, the demonstration behind it, and the samples of the robot that all methods share."""

    task: Task
    demonstration: Demonstration
    robot: StudyRobot
    samples: Array  # (m, dof), collision-free
    seed: int

    @cached_property
    def arm(self) -> Arm:
        """The robot arm, with a margin at its joint limits."""
        arm: Arm = MotionLimits.of(self.task.arm).arm
        return arm

    @cached_property
    def collisions(self) -> Collisions:
        """Self-collisions of the robot."""
        return Collisions.of(self.arm)

    @cached_property
    def stages(self) -> tuple[Rows, Rows, Array]:
        """Stages of the first search: their rows, the rows of all nodes, and the nodes on the path (m, dof)."""
        longest, count = 0.8, 600  # [s] between stages, nodes per stage
        rows = stages_of(self.task.time, longest)
        _, near = cKDTree(self.arm.forward(self.samples)[:, :3, 3]).query(
            self.task.path[rows], count
        )
        owners: Rows = np.repeat(rows, count).astype(np.intp)
        nodes = self.samples[near.ravel()]
        idle = ~np.any(np.abs(self.arm.jacobian(nodes)[:, :3]) > 1e-9, axis=(0, 1))
        nodes[:, idle] = np.array(self.robot.ready)[idle]
        return rows, owners, moved_to_positions(self.arm, nodes, self.task.path[owners])[0]


def problem_of(
    robot: StudyRobot, demonstration: Demonstration, seed: int = 0, slower: float = 4.0
) -> Problem:
    """Place a demonstrated path, to be passed in `slower` times the person's time, and sample the robot."""
    samples = _samples(robot.name, seed)
    hand = demonstration.arm.forward(demonstration.joint_angles)[:, :3, 3]
    path, time = place(robot, hand, samples), slower * demonstration.time
    task = Task.of(
        demonstration.name, robot.name, time, path, demonstration.arm, demonstration.joint_angles
    )
    return Problem(task, demonstration, robot, samples, seed)


@lru_cache(1)
def _samples(robot: str, seed: int) -> Array:
    """Collision-free configurations of a robot."""
    arm, generator = MotionLimits.of(load_arm(robot)).arm, np.random.default_rng(seed)
    return np.asarray(free_configurations(arm, 60_000, generator, collisions=True))


def motions(problem: Problem, random_motions: int = 20) -> Iterator[tuple[str, Array]]:
    """Yield the motion (n, dof) of each method by name, random ones several times."""
    yield "position-only", follow(problem, np.array(problem.robot.ready))
    rows, owners, nodes = problem.stages
    starts = nodes[owners == rows[0]]
    for i in np.random.default_rng(problem.seed).choice(len(starts), random_motions, replace=False):
        yield "random", follow(problem, starts[i])
    for name, cost in costs(problem).items():
        yield name, minimize(problem, cost)


def costs(problem: Problem) -> Mapping[str, Cost]:
    """Return the cost of each method that has one."""
    arm, task = problem.arm, problem.task
    result: dict[str, Cost] = {
        "elbow": elbow_cost(problem),
        "yoshikawa": lambda rows, q: -np.linalg.slogdet(arm.ellipsoids(q))[1],
        "direct-force": extent_cost(task, "force", task.force_directions),
        "direct-speed": extent_cost(task, "velocity", task.speed_directions),
    }
    for kind, spec in SPECS.items():
        result[f"direct-profile, {kind}"] = profile_cost(problem, kind)
        result[f"major-axis, {kind}"] = major_axis_cost(problem, spec)
        for name in ("identity", "icp", "length-field"):
            result[f"{name}, {kind}"] = ellipsoid_cost(problem, name, spec)
    return result


def follow(problem: Problem, start: Array) -> Array:
    """Follow the path from a start (dof,) by the pseudoinverse within the joint limits, as differential IK does."""
    path = problem.task.path
    approach = np.linspace(problem.arm.forward(start)[:3, 3], path[0], 10, endpoint=False)
    return follow_positions(problem.arm, start, np.concatenate([approach, path]))[len(approach) :]


def elbow_cost(problem: Problem) -> Cost:
    """Squared difference of the directions in which the elbows leave the lines from shoulder to hand."""
    person, robot = problem.demonstration, problem.robot

    def directions(shoulder: Array, elbow: Array, hand: Array) -> Array:
        line, offset = hand - shoulder, elbow - shoulder
        offset = (
            offset
            - np.sum(offset * line, axis=1, keepdims=True)
            / np.sum(line**2, axis=1, keepdims=True)
            * line
        )
        return np.asarray(offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-9))

    points = person.arm.point_positions(person.joint_angles, ("shoulder", "elbow", "hand"))
    wanted = directions(*np.moveaxis(points, 1, 0))

    def cost(rows: Rows, q: Array) -> Array:
        links = problem.arm.link_poses(q)[..., :3, 3]
        own = directions(
            links[:, robot.shoulder], links[:, robot.elbow], problem.arm.forward(q)[:, :3, 3]
        )
        return np.asarray(np.sum((own - wanted[rows]) ** 2, axis=1))

    return cost


def extent_cost(task: Task, kind: str, directions: Array) -> Cost:
    """Negative logarithm of the capability along the hidden direction, which only the direct optimization knows."""

    def cost(rows: Rows, q: Array) -> Array:
        result = np.empty(len(q))
        for row in np.unique(rows):
            own, nearest = rows == row, np.abs(task.instants - row).argmin()
            extents = line_extent(task.arm, q[own], directions[nearest : nearest + 1], kind)[:, 0]
            result[own] = -np.log(np.clip(extents, 1e-3, 1e6))
        return result

    return cost


def profile_cost(problem: Problem, kind: str) -> Cost:
    """Negative correlation with the person's logarithmic capability over 16 directions, the reference of r."""
    person, u, arm = problem.demonstration, half_sphere(16), problem.arm

    def centered(values: Array) -> Array:
        values = values - values.mean(axis=1, keepdims=True)
        return np.asarray(values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-12))

    model = person.arm.with_limits(velocity=1.0)
    wanted = centered(np.log(polytope_extent(model, person.joint_angles, u, kind)))

    def cost(rows: Rows, q: Array) -> Array:
        own = centered(np.log(np.clip(line_extent(arm, q, u, kind), 1e-3, 1e6)))
        return -np.asarray(np.sum(own * wanted[rows], axis=1))

    return cost


def major_axis_cost(problem: Problem, spec: EllipsoidSpec) -> Cost:
    """Negative logarithm of the extent of the robot's ellipsoid along the longest axis of the person's."""
    person, arm = problem.demonstration, problem.arm
    axes = np.linalg.eigh(person.arm.ellipsoids(person.joint_angles, spec))[1][:, :, -1]

    def cost(rows: Rows, q: Array) -> Array:
        matrices = arm.ellipsoids(q, spec.bounded)  # of forces the inverse
        if spec.kind != "force":
            matrices = np.asarray(np.linalg.inv(matrices + 1e-6 * np.eye(3)))
        squares = np.einsum("ni,nij,nj->n", axes[rows], matrices, axes[rows])
        return np.asarray(0.5 * np.log(np.maximum(squares, 1e-12)))

    return cost


def ellipsoid_cost(problem: Problem, method: str, spec: EllipsoidSpec) -> Cost:
    """Squared affine-invariant distance from the person's ellipsoid, transferred by a method of the package."""
    person, arm = problem.demonstration, problem.arm
    adapter = fitted(method, person.arm, problem.robot.name, spec, problem.seed)
    target = adapter.transform(person.arm.ellipsoids(person.joint_angles, spec))
    if spec.kind == "force":
        target = np.asarray(np.linalg.inv(target))
    targets = TargetTrajectory(
        time=np.zeros(len(target)),
        ellipsoids=target,
        spec=spec.bounded,
        damping=damping_of(arm, spec.bounded, DAMPING),
    )
    aims = ArmProblem.of(arm, targets)
    return lambda rows, q: aims[rows].cost(q)


@lru_cache(16)
def fitted(method: str, person: Arm, robot: str, spec: EllipsoidSpec, seed: int) -> DomainAdapter:
    """Fit a method of the package to a person and a robot; trunk and base are parallel."""
    arm = load_arm(robot)
    unfitted = method_of(method, base_rotation=np.eye(3), damping=DAMPING)
    adapter = with_feasible_set(unfitted, arm, spec, random_state=seed)
    student = sample_domain(arm, 4096, seed + 1, spec=spec, collisions=True)
    with collected_warnings():
        return adapter.fit(sample_domain(person, 1024, seed, spec=spec), student)


def minimize(problem: Problem, cost: Cost) -> Array:
    """Minimize a cost along the path: a search between random configurations, refined around the best motion."""
    arm, (rows, owners, nodes), time = problem.arm, problem.stages, problem.task.time
    values = cost(owners, nodes)
    weight = 0.03 * float(np.std(values[np.isfinite(values)]))
    chosen = interpolated(time[rows], _search(problem, cost, owners, nodes, weight), time)
    q, _ = _on_path(problem, chosen)
    generator, all_rows = np.random.default_rng(problem.seed), np.arange(len(time), dtype=np.intp)
    for size in (0.4, 0.2, 0.1, 0.05, 0.025):
        offsets = np.concatenate(
            [np.zeros((1, arm.dof)), size * generator.normal(size=(39, arm.dof))]
        )
        moved = np.clip(
            np.repeat(q, len(offsets), axis=0) + np.tile(offsets, (len(q), 1)), arm.lower, arm.upper
        )
        owner: Rows = np.repeat(all_rows, len(offsets)).astype(np.intp)
        q = _search(
            problem,
            cost,
            owner,
            moved_to_positions(arm, moved, problem.task.path[owner])[0],
            weight,
        )
        smooth, error = _on_path(problem, gaussian_filter1d(q, 1.0, axis=0, mode="nearest"))
        q = smooth if error.max() <= IN_PLACE else q
    return q


def _search(problem: Problem, cost: Cost, owners: Rows, q: Array, weight: float) -> Array:
    """Choose one of the nodes q (m, dof) for each of the waypoints, `owners` (m,)."""
    arm, rows = problem.arm, np.unique(owners)
    error = np.linalg.norm(arm.forward(q)[:, :3, 3] - problem.task.path[owners], axis=1)
    roadmap = Roadmap(q, cost(owners, q), np.searchsorted(owners, [*rows, len(problem.task.time)]))
    roadmap = roadmap.without((error > IN_PLACE) | problem.collisions.collides(q))
    time = problem.task.time[rows]
    assert arm.velocity_limits is not None
    largest = 0.6 * arm.velocity_limits * np.diff(time, prepend=time[0] - 1.0)[:, None]
    return np.asarray(roadmap.q[shortest_path(roadmap, time, largest, weight)])


def _on_path(problem: Problem, q: Array) -> tuple[Array, Array]:
    """Bring configurations at all waypoints onto the path; return them and their position errors."""
    moved, _ = moved_to_positions(problem.arm, q, problem.task.path)
    return moved_to_positions(problem.arm, moved, problem.task.path)


def follow_positions(
    arm: Arm, start: Array, positions: Array, tolerance: float = 1e-4, most_steps: int = 20
) -> Array:
    """Follow positions (n, 3) from a start (dof,) by the pseudoinverse, within limits; shape (n, dof)."""
    result, now = np.empty((len(positions), arm.dof)), start
    for i, position in enumerate(positions):
        for _ in range(most_steps):
            pose, jacobian = arm.motion(now)
            error = position - pose[:3, 3]
            if error @ error < tolerance**2:
                break
            step = np.linalg.lstsq(jacobian[:3], error, rcond=1e-3)[0]
            ends = (now + step < arm.lower) | (now + step > arm.upper)
            if ends.any():  # the other joints do it
                step = np.where(
                    ends, 0.0, np.linalg.lstsq(jacobian[:3] * ~ends, error, rcond=1e-3)[0]
                )
            now = np.clip(now + step, arm.lower, arm.upper)
        result[i] = now
    return result
