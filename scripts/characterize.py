"""Record the results that every change of the package must keep, and compare two such records.

    python scripts/characterize.py record FILE.json [--whole] [--only GROUP ...]
    python scripts/characterize.py compare BEFORE.json AFTER.json

The small record takes about three minutes on one core; the whole record has five seeds and all robots.
Robots other than the Panda come from example-robot-data. Timings compare only on one quiet machine.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import maniport as mp
from benchmarks.inputs import DAMPING, domains, spd_matrices
from benchmarks.motions import motions
from benchmarks.robots import FILES, ROBOTS, transferred
from maniport.mocap import shipped_recording
from maniport.motion import TargetTrajectory, plan_motion

Row = tuple[str, dict[str, float]]

LIMITED_ARMS = (
    *(
        "panda",
        "ur3",
        "ur5",
        "ur10",
        "ur3e",
        "ur5e",
        "xarm7",
        "kinova",
        "z1",
        "so100",
        "tiago",
        "talos_left_arm",
    ),
    *(
        "talos_right_arm",
        "baxter_left_arm",
        "g1_left_arm",
        "g1_right_arm",
        "romeo_left_arm",
        "icub_left_arm",
    ),
    *("pr2_left_arm", "alex_left_arm"),
)
"""Arms with limits of velocity and torque: the Panda, and arms of example-robot-data."""

WORSE = 0.02
"""Relative change above which `compare` marks a value; timings are marked above ten times as much."""


def statistics(
    distance: np.ndarray, error: np.ndarray | None, duration: float, collides: float
) -> dict[str, float]:
    """Metrics of one motion: distances, position errors [mm], duration [s], share of samples in collision."""
    row = {
        "rms": float(np.sqrt(np.mean(distance**2))),
        "median": float(np.median(distance)),
        "p95": float(np.percentile(distance, 95)),
        "max": float(distance.max()),
    }
    if error is not None:
        row |= {
            "error_p95_mm": 1e3 * float(np.percentile(error, 95)),
            "error_max_mm": 1e3 * float(error.max()),
        }
    return row | {"duration_s": duration, "collides": collides}


def transfers(recording: str, seeds: int, **options: Any) -> Iterator[Row]:
    """Run the transfer on a bundled recording."""
    for seed in range(seeds):
        begin = time.process_time()
        result = mp.transfer_recording(shipped_recording(recording), seed=seed, **options)
        motion = result.arm.motion
        row = statistics(
            motion.distance,
            motion.position_error,
            float(motion.control_time[-1]),
            motion.clearance.share,
        )
        yield f"{recording}, seed {seed}", row | {"seconds": time.process_time() - begin}


def demo(whole: bool) -> Iterator[Row]:
    """Freeform recording on the Panda, default options."""
    return transfers("freeform", 5 if whole else 2)


def ladder(whole: bool) -> Iterator[Row]:
    """Ladder recording on the Panda with a position tolerance of 12 mm."""
    return transfers("ladder", 5 if whole else 1, position_tolerance=0.012)


def short_motions(whole: bool) -> Iterator[Row]:
    """Short motions on other robots: placed and planned, beside the tracker."""
    chosen = [motion for motion in motions() if whole or motion.name == "H-Eval-3"]
    names = [
        name
        for name in (ROBOTS if whole else ("UR5", "xArm7"))
        if (FILES / ROBOTS[name][0]).is_file()
    ]
    for name in names:
        for motion in chosen:
            done = transferred(name, motion)
            row = statistics(done.planned, done.planned_error, float("nan"), done.collisions)
            row |= {
                "tracker_rms": float(np.sqrt(np.mean(done.tracked**2))),
                "seconds": done.seconds,
            }
            yield f"{name}, {motion.name}", row


def both_arms(whole: bool) -> Iterator[Row]:
    """Both arms of the bundled recording on robots with two arms, beside each arm planned alone on the same path."""
    robots: dict[str, dict[str, Any]] = {
        "two Pandas": {"robot": "panda", "bases": ((0.0, 0.3, 0.0), (0.0, -0.3, 0.0))}
    }
    if whole:
        robots["Baxter"] = {"robot": "baxter"}
        robots["Talos, fixed torso"] = {
            "robot": "talos",
            "lock": {"torso_1_joint": 0.0, "torso_2_joint": 0.0},
        }
        robots["Talos, shared torso"] = {"robot": "talos"}
    for name, options in robots.items():
        arms = mp.load_arms(**options)
        result = mp.transfer_recording(
            shipped_recording("both-arms"), robot=arms, method="scaled-transport"
        )
        for side, arm, output in zip(("left", "right"), arms.arms, result.arms, strict=True):
            motion = output.motion
            clearance = result.motion.clearance
            target = TargetTrajectory.checked(
                arm, output.time, motion.target, positions=motion.path
            )
            alone = plan_motion(arm, target).arms[0]
            row = statistics(
                motion.distance,
                motion.position_error,
                float(motion.control_time[-1]),
                clearance.share,
            )
            rms = float(np.sqrt(np.mean(alone.distance**2)))
            row |= {"rms_over_alone": row["rms"] / rms, "clearance_mm": 1e3 * clearance.distance}
            yield f"{name}, {side}", row


def length_field(whole: bool) -> Iterator[Row]:
    """Feasibility gap of the length field, on motions and held out."""
    from lengths_table import HEADS, cases, measured
    from maniport.arms import VELOCITY

    for case in cases(["Panda", "UR5", "xArm7"] if whole else ["Panda"]):
        if not whole and case.person != "rHuMan":
            continue
        for draw in range(5 if whole else 1):
            projector = mp.FeasibleProjector(case.arm, VELOCITY)
            adapter = mp.LengthField(damping=DAMPING, base_rotation=np.eye(3), projector=projector)
            values = measured(adapter, case, 100 + draw, VELOCITY)
            yield (
                f"{case.robot}, {case.person}, draw {draw}",
                dict(zip(_unique(HEADS), map(float, values), strict=True)),
            )


def capability(whole: bool) -> Iterator[Row]:
    """Correlate ellipsoids, with joint limits and with unit weights, and polytopes over configurations and directions.

    Of logarithms; `_directions`: without the level of each configuration.
    """
    from maniport.evaluation import ellipsoid_extent, half_sphere, line_extent, resemblance

    u = half_sphere()
    for name in LIMITED_ARMS:
        arm = mp.load_arm(name)
        row = dict[str, float]()
        q = arm.sample(5000 if whole else 500, random_state=0)
        light = mp.Arm(replace(arm.chain, inertia=None))
        for key, own in (("force", arm), ("force_without_gravity", light), ("velocity", arm)):
            kind = key.partition("_")[0]
            polytope = line_extent(own, q, u, kind)
            usable = polytope.min(axis=1) > 0.0
            polytope = polytope[usable]
            for weights, suffix in (("joint-limits", ""), (None, "_unit")):
                ellipsoid = ellipsoid_extent(
                    own.manipulability(q[usable], kind, joint_weights=weights), u
                )
                row[f"{key}{suffix}"] = float(
                    np.corrcoef(np.log(polytope.ravel()), np.log(ellipsoid.ravel()))[0, 1]
                )
                row[f"{key}{suffix}_directions"] = resemblance(ellipsoid, polytope)
            if key == "force":
                row["holds_itself"] = float(usable.mean())
        yield name, row


FORCE_PAIRS = (
    *(("panda", "freeform"), ("panda", "ladder"), ("panda", "both-arms"), ("iiwa", "freeform")),
    *(
        ("kinova3", "freeform"),
        ("xarm7", "freeform"),
        ("ur5", "freeform"),
        ("g1_left_arm", "freeform"),
    ),
)
"""Robots and recordings of the table in docs/capability.md; iiwa and kinova3 are of robosuite."""


def force(whole: bool) -> Iterator[Row]:
    """Force along the person's strongest direction [N] with ellipsoids of velocity and of force.

    `position_only`: the same start and path, by the pseudoinverse; `best_node`, `median_node` and `direct`: see
    `_forces_on_path`.
    """
    for name, recording in FORCE_PAIRS if whole else FORCE_PAIRS[:1]:
        options: dict[str, Any] = {"robot": name}
        if recording == "both-arms":
            options = {
                "robot": mp.load_arms(name, bases=((0.0, 0.3, 0.0), (0.0, -0.3, 0.0))),
                "side": "both",
            }
        for kind, seed in product(("velocity", "force"), range(5 if whole else 1)):
            begin = time.process_time()
            result = mp.transfer_recording(
                shipped_recording(recording), ellipsoids=kind, seed=seed, **options
            )
            seconds = time.process_time() - begin
            for arm in result.arms:
                motion = arm.motion
                (own,) = [own for own in arm.capabilities if own.kind == "force"]
                row = {
                    "force": float(np.median(own.robot)),
                    "force_p5": float(np.percentile(own.robot, 5)),
                }
                row |= {
                    "position_only": float(np.median(own.position_only)),
                    "r": own.resemblance,
                    "seconds": seconds,
                }
                duration = float(result.motion.trajectory.control_time[-1])
                row |= statistics(
                    motion.distance, motion.position_error, duration, motion.clearance.share
                )
                yield (
                    f"{name}, {recording}, {arm.name}, {kind}, seed {seed}",
                    row | _forces_on_path(arm),
                )


def _forces_on_path(result: Any, waypoints: int = 60, count: int = 700) -> dict[str, float]:
    """Force of the best and the median node on the path of a motion, and of a motion through them; medians [N].

    The motion is found by a graph search that knows the directions, for four times the demonstrated time.
    """
    from maniport.evaluation import half_sphere, line_extent, polytope_extent
    from maniport.motion import MotionLimits
    from maniport.motion.plan.reachability_map import ReachabilityMap
    from maniport.motion.plan.roadmap import LARGEST_CHANGE, shortest_path
    from maniport.motion.problem import ArmProblem
    from maniport.motion.targets import TargetTrajectory

    motion = result.motion
    fit = result.fit
    place = result.placement
    limits = MotionLimits.of(result.robot)
    rows = np.unique(np.linspace(0, len(result.time) - 1, waypoints).astype(int))
    strongest = half_sphere()[
        polytope_extent(fit.arm, fit.joint_angles[rows], half_sphere()).argmax(axis=1)
    ]
    directions = strongest @ (place.rotation @ place.map_rotation).T
    samples = ReachabilityMap(limits.arm, motion.spec, collisions=True)
    target = TargetTrajectory(
        time=result.time[rows],
        ellipsoids=motion.target[rows],
        spec=motion.spec,
        damping=motion.damping,
        positions=motion.path[rows],
    )
    problem = ArmProblem.of(limits.arm, target)
    nodes = samples.nodes(problem, count, np.random.default_rng(0))
    nodes = (
        nodes.without(samples.collisions.collides(nodes.q))
        if samples.collisions is not None
        else nodes
    )
    parts = [slice(*ends) for ends in pairwise(nodes.first)]
    forces = [
        line_extent(limits.arm, nodes.q[part], u[None])[:, 0]
        for part, u in zip(parts, directions, strict=True)
    ]
    cost = np.concatenate([4.0 * np.log(own.max() / np.maximum(own, 1e-3)) ** 2 for own in forces])
    times = 4.0 * (result.time[rows] - result.time[0])
    largest = np.array([LARGEST_CHANGE[unit] for unit in limits.arm.joint_units])
    largest = np.minimum(
        0.9 * limits.velocity * np.diff(times, prepend=times[0] - 1.0)[:, None], largest
    )
    direct = np.concatenate(forces)[shortest_path(replace(nodes, cost=cost), times, largest, 0.03)]
    best, middle = np.median([(own.max(), np.median(own)) for own in forces], axis=0)
    return {
        "best_node": float(best),
        "median_node": float(middle),
        "direct": float(np.median(direct)),
    }


def recovery(whole: bool) -> Iterator[Row]:
    """Recover a random rotation from a domain and its rotated copy by ICP."""
    from scipy.stats import special_ortho_group

    cloud = domains(100)[1] + 1e-3 * np.eye(3)
    random = np.random.default_rng(0)
    errors = []
    for _ in range(20 if whole else 5):
        turn = special_ortho_group.rvs(3, random_state=random)
        adapter = mp.RiemannianICP(damping=DAMPING).fit(cloud, turn @ cloud @ turn.T)
        images = adapter.transform(cloud)
        errors.append(float(mp.spd.distance(images, turn @ cloud @ turn.T).max()))
    yield (
        "ICP, rotated copy",
        {"largest_distance": max(errors), "recovered": float(np.mean(np.array(errors) < 2e-6))},
    )


def speed(whole: bool) -> Iterator[Row]:
    """Kernels and maps; the least of several calls."""
    del whole
    from pyriemann.geometry.distance import distance_riemann

    a = spd_matrices(100_000, 3, seed=1)
    b = spd_matrices(100_000, 3, seed=2)
    ours = _least(lambda: mp.spd.distance(a, b))
    peer = _least(lambda: distance_riemann(a, b))
    yield "distance of 100 000 pairs", {"seconds": ours, "times_faster_than_pyriemann": peer / ours}
    adapter = mp.RiemannianICP(damping=DAMPING)
    clouds = domains(400)
    yield "ICP, N = 400", {"seconds": _least(lambda: adapter.fit(*clouds))}
    one = clouds[0][7]
    many = domains(1_000_000)[0]
    yield (
        "transform of one",
        {"seconds": _least(lambda: [adapter.transform(one) for _ in range(1000)]) / 1000},
    )
    yield "transform of a million", {"seconds": _least(lambda: adapter.transform(many))}


def processes(whole: bool) -> Iterator[Row]:
    """Run the demo in fresh processes, with an empty and a warm compile cache."""
    del whole
    with tempfile.TemporaryDirectory() as folder:
        for name in ("empty cache", "warm"):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            begin = time.perf_counter()
            command = [
                sys.executable,
                "-m",
                "maniport",
                "demo",
                "--quiet",
                "--overwrite",
                "-o",
                f"{folder}/results",
            ]
            environment = {**os.environ, "NUMBA_CACHE_DIR": f"{folder}/cache"}
            subprocess.run(command, check=True, env=environment)
            wall = time.perf_counter() - begin
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            yield (
                f"maniport demo, {name}",
                {"seconds": wall, "cpu_seconds": used, "peak_mb": after.ru_maxrss / 1024},
            )


GROUPS: dict[str, Callable[[bool], Iterator[Row]]] = {
    "demo": demo,
    "ladder": ladder,
    "short_motions": short_motions,
    "both_arms": both_arms,
    "length_field": length_field,
    "capability": capability,
    "force": force,
    "recovery": recovery,
    "speed": speed,
    "processes": processes,
}


def record(file: Path, whole: bool, only: list[str]) -> None:
    """Measure, print and write the rows of some groups."""
    rows: dict[str, dict[str, float]] = {}
    for group in only or GROUPS:
        for name, row in GROUPS[group](whole):
            rows[f"{group}: {name}"] = row
            print(
                f"{group}: {name}:",
                ", ".join(f"{key} {value:.4g}" for key, value in row.items()),
                flush=True,
            )
            file.write_text(json.dumps(rows, indent=1))


def compare(before: Path, after: Path) -> None:
    """Print every value of two records side by side, with a mark where it changes by more than `WORSE`."""
    old, new = (json.loads(path.read_text()) for path in (before, after))
    for name in old | new:
        for key in old.get(name, new.get(name, {})):
            a, b = (rows.get(name, {}).get(key, float("nan")) for rows in (old, new))
            share = (b - a) / abs(a) if a else float(b != a)
            mark = "!" if not abs(share) <= WORSE * (10 if "seconds" in key else 1) else " "
            print(f"{mark} {name:45s} {key:28s} {a:12.5g} {b:12.5g} {share:+8.1%}")


def _least(function: Callable[[], Any], repeats: int = 5) -> float:
    function()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def _unique(heads: tuple[str, ...]) -> list[str]:
    return [f"{heads[i - 1]} {head}" if head == "95 %" else head for i, head in enumerate(heads)]


def main() -> None:
    """Parse and run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(required=True)
    recorder = verbs.add_parser("record")
    recorder.add_argument("file", type=Path)
    recorder.add_argument("--whole", action="store_true")
    recorder.add_argument("--only", nargs="+", choices=list(GROUPS), default=[])
    recorder.set_defaults(run=lambda options: record(options.file, options.whole, options.only))
    comparer = verbs.add_parser("compare")
    comparer.add_argument("before", type=Path)
    comparer.add_argument("after", type=Path)
    comparer.set_defaults(run=lambda options: compare(options.before, options.after))
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    options.run(options)


if __name__ == "__main__":
    main()
