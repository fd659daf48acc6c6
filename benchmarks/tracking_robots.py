"""The same chain on other robots: adapt, place, plan, track; the plan beside its bounds and the tracker."""

import time as clock
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from sysconfig import get_paths
from typing import Any

import numpy as np
from joblib import Parallel, delayed

import maniport as mp
from maniport.arms import VELOCITY, Arm
from maniport.errors import ManiportError
from maniport.motion import MotionLimits, Planner, place_path, plan_motion, track
from maniport.util.defaults import STUDENT_SAMPLES, TEACHER_SAMPLES

from .inputs import DAMPING, Array
from .measure import Row, duration, failed
from .tracking_motions import Motion
from .tracking_runs import spread

FILES = Path(get_paths()["purelib"]) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
"""Where the package example-robot-data puts its robots."""

ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "UR5": ("ur_description/urdf/ur5_robot.urdf", {}),
    "xArm7": ("xarm_description/urdf/xarm7.urdf", {}),
    "Talos, left arm": (
        "talos_data/robots/talos_reduced.urdf",
        {"frame": "arm_left_7_link", "joints": [f"arm_left_{i}_joint" for i in range(1, 8)]},
    ),
    "Tiago, arm": (
        "tiago_description/robots/tiago_no_hand.urdf",
        {"frame": "arm_tool_link", "joints": [f"arm_{i}_joint" for i in range(1, 8)]},
    ),
    "G1, left arm": (
        "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        {
            "frame": "left_wrist_yaw_link",
            "joints": [
                *(f"left_shoulder_{axis}_joint" for axis in ("pitch", "roll", "yaw")),
                "left_elbow_joint",
                *(f"left_wrist_{axis}_joint" for axis in ("roll", "pitch", "yaw")),
            ],
        },
    ),
}
"""File and tip of each. Bases are as the files have them: Talos' is its pelvis, Tiago's the floor under its wheels."""


MOTIONS, QUICK_MOTIONS = ("H-Eval-3", "ladder 3.9–7.8 s"), ("H-Eval-3",)
RATIO = 1.05
ASKED = f"≤ {RATIO}, ≤ 0 %; limits kept, no collision"


@dataclass(frozen=True)
class Chain:
    """What became of one motion on one robot, point by point.

    Attributes
    ----------
    planned, tracked, floor : ndarray, shape (n,)
        Distances of the planned and of the tracked motion, and the least at each point by itself.
    planned_error, tracked_error : ndarray, shape (n,)
        How far the tip is beside its path [m].
    ratio, use, collisions : ndarray, shape (1,)
        Of the plan: rms over that of its pointwise optimum, largest share of a limit, share of steps in collision.
    seconds : ndarray, shape (1,)
        Of one core, for sampling the arm, the place and the plan [s].
    """

    planned: Array
    tracked: Array
    floor: Array
    planned_error: Array
    tracked_error: Array
    ratio: Array
    use: Array
    collisions: Array
    seconds: Array


def chain(name: str, motion: Motion) -> Chain:
    """Adapt a motion to a robot, place it, plan it, and let the tracker follow it from a start of its own choice."""
    robot = _load(name)
    student, teacher = mp.sample_domain(robot, STUDENT_SAMPLES, 1), mp.sample_domain(motion.person, TEACHER_SAMPLES, 0)
    adapter = mp.ParallelTransport(damping=DAMPING, base_rotation=np.eye(3)).fit(teacher, student)
    damping, time = adapter.student_regularization, motion.robot_time
    begin = clock.process_time()
    planner = Planner.of(MotionLimits.of(robot), VELOCITY)
    bank = planner.arms[0].bank
    placed = place_path(
        motion.hand,
        adapter.transform(motion.profile),
        planner.limits.arm,
        time=time,
        reachability_map=planner.arms[0].reachability_map,
        bank=bank,
        damping=damping,
    )
    (plan,) = plan_motion(
        robot, placed.profile, time=time, paths=placed.path, damping=damping, planner=planner, position_tolerance=1e-3
    ).arms
    seconds = clock.process_time() - begin
    # with the same margin of the joints' limits: beyond it lie postures that are nearer, which the plan may not take
    (tracked,) = track(planner.limits.arm, placed.profile, time=time, path=placed.path, bank=bank, damping=damping).arms
    single = (plan.pointwise_ratio, plan.limit_use.shares.max(), plan.clearance.share, seconds)
    return Chain(
        plan.distance,
        tracked.distance,
        plan.pointwise_best,
        plan.position_error,
        tracked.position_error,
        *(np.array([value]) for value in single),
    )


def _attempt(name: str, motion: Motion) -> Chain | str:
    """`chain`, or why there is nothing: a robot that fails is a row of the table."""
    try:
        return chain(name, motion)
    except (ManiportError, ArithmeticError, LookupError) as error:
        return f"{motion.name}: {type(error).__name__}: {error}"


def rows(motions: list[Motion], quick: bool) -> Iterator[Row]:
    """A row for each robot."""
    names = ["UR5"] if quick else list(ROBOTS)
    chosen = [motion for motion in motions if motion.name in (QUICK_MOTIONS if quick else MOTIONS)]
    there = [name for name in names if (FILES / ROBOTS[name][0]).is_file()]
    work = [(name, motion) for name in there for motion in chosen]
    done = Parallel(n_jobs=-1)(delayed(_attempt)(*one) for one in work)
    for name in names:
        what = f"{name}: {len(chosen)} adapted motions, placed, planned: d, median / 95 %"
        found = [one for (robot, _), one in zip(work, done, strict=True) if robot == name]
        if not found:
            yield Row(what, "–", "", "not measured", "–", None, "the package example-robot-data is not installed")
            continue
        errors = [one for one in found if isinstance(one, str)]
        yield failed(what, ASKED, errors[0]) if errors else _row(name, what, found)


def _row(name: str, what: str, found: list[Chain]) -> Row:
    joined = {one.name: np.concatenate([getattr(part, one.name) for part in found]) for one in fields(Chain)}
    rms = {kind: [np.sqrt(np.mean(getattr(one, kind) ** 2)) for one in found] for kind in ("planned", "tracked")}
    worse = max(planned / tracked for planned, tracked in zip(*rms.values(), strict=True)) - 1.0
    ratio, use, collisions = (float(joined[key].max()) for key in ("ratio", "use", "collisions"))
    errors = [1e3 * joined[key] for key in ("planned_error", "tracked_error")]
    tips = [f"{np.percentile(error, 95):.2f} / {error.max():.2f}" for error in errors]
    return Row(
        what,
        spread(joined["planned"]),
        f"tracker: {spread(joined['tracked'])}",
        f"{ratio:.2f} of the pointwise optimum, rms {worse:+.0%} of the tracker's",
        ASKED,
        bool(ratio <= RATIO and worse <= 0.0 and use <= 1.0 + 1e-9 and collisions == 0.0),
        f"{_load(name).dof} joints; the worst of the motions; the least at each point by itself "
        f"{spread(joined['eigenvalue_floor'])}; position error {tips[0]} mm (95 %, largest), the controller's "
        f"{tips[1]} mm; of a limit at most {use:.3f}; collisions {collisions:.2%}; "
        f"place and plan {duration(joined['seconds'].max())}",
    )


def _load(name: str) -> Arm:
    file, options = ROBOTS[name]
    return mp.load_arm(FILES / file, **options)
