"""Search for the best way from point to point, to compare planned motions with.

    python scripts/bound_of_motion.py "freeform" "xArm7"

The pointwise optimum takes each waypoint by itself; its configurations at neighboring waypoints may lie on different
branches. Here the least root mean square of d is searched among motions from waypoint to waypoint within the velocity
limits, in the duration of the planned motion, with the end effector on the path: a shortest path through many nodes,
with the configurations of the pointwise optimum and of the plan, then again with more nodes around the result. Limits
of acceleration and jerk do not count, nor what lies between the points, and another column allows 1.5 times the speed.
The result is no bound: a shortest path through so many nodes may miss better ones, which half as many nodes estimate,
and a position error gains, too. "none": nothing was found that is so quick with its tip in place, as where a recording
leaps. Cases are those of the benchmark groups `planning` and `tracking` whose names contain one of the words. A short
motion takes half a minute of one core, a recording up to five.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import tracking_plan, tracking_robots, tracking_runs
from benchmarks.inputs import DAMPING
from benchmarks.tracking_motions import Motion, motions

import maniport as mp
from maniport.arms import VELOCITY, Arm
from maniport.motion import ArmMotion, PlanControl, Planner, place_path, plan_motion
from maniport.motion.arm_motion import rms_ratio
from maniport.motion.objective import EXACT_WEIGHT, Objective, Targets
from maniport.motion.plan.optimizer import time_weights
from maniport.motion.plan.roadmap import IN_PLACE, Roadmap, moved_to_positions, shortest_path
from maniport.motion.search.descent import pointwise_best
from maniport.studies.paper.trajectories import robot_arm
from maniport.util.defaults import STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.validation import Array

STAGES, NODES, MOST_NODES, ROUNDS, AROUND = 1200, 800, 2000, 4, 0.2
"""Points at most, more than a shipped recording has; nodes at each, and at most where points are few; how often nodes
are added around the best ways, and what share of the first each time."""
SPREAD = 0.4
"""Of the nodes around the first way [rad or m]; of the next ones a half, a third and so on."""
PACES = (1.0, 1.5)
"""Times the limits of speed."""
HEAD = ("motion", "planned", "at the limits of speed", "half as many nodes", "at 1.5 times these")


def main(words: list[str]) -> None:
    """Print a table in Markdown: root mean squares of d over that of the pointwise optimum."""
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for name, plan in cases(words):
        count = int(np.clip(NODES * STAGES / len(plan.time), NODES, MOST_NODES))
        full, half = least(plan, count), least(plan, count // 2)
        found = (full["planned"], full[PACES[0]], half[PACES[0]], full[PACES[1]])
        told = (f"{one:.3f}" if np.isfinite(one) else "none" for one in found)
        print(f"| {name} | " + " | ".join(told) + " |", flush=True)


def cases(words: list[str]) -> Iterator[tuple[str, ArmMotion]]:
    """Planned motions of the benchmarks."""

    def asked(name: str) -> bool:
        return not words or any(word in name for word in words)

    people = list(motions())
    for one in people:
        if asked(f"Panda, {one.name}"):
            yield f"Panda, {one.name}", _planned(robot_arm(), one, joint_limit_margin=False)
        for robot in tracking_robots.ROBOTS:
            if one.name in tracking_robots.MOTIONS and asked(f"{robot}, {one.name}"):
                yield f"{robot}, {one.name}", _planned(tracking_robots._load(robot), one, joint_limit_margin=True)
    for case in tracking_plan.CASES:
        if asked(case.name):
            yield case.name, tracking_plan.found(case).plan


def _planned(arm: Arm, motion: Motion, margin: bool) -> ArmMotion:
    """As the benchmarks do it: placed for an arm with the margin of its limits, or for one without."""
    domains = mp.sample_domain(motion.person, TEACHER_SAMPLES, 0), mp.sample_domain(arm, STUDENT_SAMPLES, 1)
    adapter = mp.ParallelTransport(damping=DAMPING, base_rotation=np.eye(3)).fit(*domains)
    target, damping, time = adapter.transform(motion.profile), adapter.student_regularization, motion.robot_time
    planner = PlanControl().planner(arm, VELOCITY, 0)
    if margin:
        same = {"time": time, "reachability_map": planner.arms[0].reachability_map, "bank": planner.arms[0].bank}
        placed = place_path(motion.hand, target, planner.limits.arm, damping=damping, **same)
    else:
        placed = place_path(motion.hand, target, arm, damping=damping, bank=tracking_runs.bank())
    return plan_motion(
        arm, placed.profile, time=time, paths=placed.path, damping=damping, planner=planner, position_tolerance=1e-3
    ).arms[0]


def least(plan: ArmMotion, count: int) -> dict[object, float]:
    """Ratios to the pointwise optimum at some points: of the plan, and of the best way found at each of `PACES`."""
    step = -(-len(plan.time) // STAGES)
    rows = np.unique(np.append(np.arange(0, len(plan.time), step), len(plan.time) - 1))
    planner = Planner.of(plan.limits, VELOCITY, True, 0)
    objective = Objective(planner.limits.arm, VELOCITY, plan.damping, EXACT_WEIGHT)
    targets, time, known = objective.targets(plan.target, plan.path)[rows], plan.time[rows], plan.joint_positions[rows]
    starts, random = planner.arms[0].bank.starts_for(targets, 32), np.random.default_rng(0)
    floor = pointwise_best(targets, starts, known)
    nodes = _free(planner, planner.arms[0].reachability_map.nodes(targets, count, random))
    for q in (floor.joint_positions, known):
        nodes = _merged(nodes, Roadmap(q, targets.cost(q), np.arange(len(q) + 1)))
    speeds = planner.limits.velocity * np.diff(time, prepend=time[0] - 1.0)[:, None]
    found: dict[object, float] = {"planned": rms_ratio(targets.distance(known), floor.distance)}
    for turn in range(1, ROUNDS + 1):
        # all points count alike, however long they last
        even = replace(nodes, cost=nodes.cost / np.repeat(time_weights(time), np.diff(nodes.first)))
        more = []
        for pace in PACES:
            way = nodes.q[shortest_path(even, time, pace * speeds, 0.0)]
            if np.all(np.abs(np.diff(way, axis=0)) <= pace * speeds[1:] * (1.0 + 1e-9)):
                found[pace] = rms_ratio(targets.distance(way), floor.distance)
            more.append(_around(planner, targets, way, SPREAD / turn, int(AROUND * count), random))
        for one in more:
            nodes = _merged(nodes, one)
    return {pace: found.get(pace, np.inf) for pace in ("planned", *PACES)}


def _free(planner: Planner, nodes: Roadmap) -> Roadmap:
    return nodes if planner.collisions is None else nodes.without(planner.collisions.collides(nodes.q))


def _around(
    planner: Planner, targets: Targets, way: Array, spread: float, count: int, random: np.random.Generator
) -> Roadmap:
    """Nodes next to those of a way (n, dof), with the tip in its place."""
    arm, owner = planner.limits.arm, np.repeat(np.arange(len(way)), count)
    sizes = spread * random.uniform(0.05, 1.0, (len(owner), 1))
    q = np.clip(way[owner] + sizes * random.standard_normal((len(owner), arm.dof)), arm.lower, arm.upper)
    q[:, planner.arms[0].reachability_map.idle] = way[owner][:, planner.arms[0].reachability_map.idle]
    there = targets[owner]
    q, away = moved_to_positions(arm, q, there.positions)
    near = away <= IN_PLACE
    first = np.searchsorted(owner[near], np.arange(len(way) + 1))
    return _free(planner, Roadmap(q[near], there[near].cost(q[near]), first))


def _merged(nodes: Roadmap, more: Roadmap) -> Roadmap:
    """The nodes of both at each stage."""
    stages = np.arange(len(nodes.first) - 1)
    owner = np.concatenate([np.repeat(stages, np.diff(one.first)) for one in (nodes, more)])
    order = np.argsort(owner, kind="stable")
    q, cost = np.concatenate([nodes.q, more.q])[order], np.concatenate([nodes.cost, more.cost])[order]
    return replace(nodes, q=q, cost=cost, first=nodes.first + more.first)


if __name__ == "__main__":
    main(sys.argv[1:])
