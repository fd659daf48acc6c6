"""What robots gain in force and speed along the person's directions: ``python -m benchmarks.capability FILE``.

Each clip is transferred to each robot with several seeds by several methods. All but the first take the scale of the
path that the first one found, so that their paths have the same size: a smaller path is an easier one. The results are
appended to FILE, one JSON object a line; runs that it has already are not repeated.
"""

import argparse
import itertools
import json
import time
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import maniport as mp
from maniport.arms.directional import half_sphere, is_limited, line_extent
from maniport.mocap import ArmFit, shipped_recording
from maniport.motion import Placement, RobotMotion
from maniport.motion.configurations import Configurations
from maniport.motion.costs.posture import PostureCost
from maniport.motion.directions import DirectionTarget, extent_reference
from maniport.motion.targets import TargetTrajectory
from maniport.pipeline.capability import CAPABILITIES, person_lines, positions_only
from maniport.pipeline.config import Config
from maniport.pipeline.following import SampledRobot, move, place, plan
from maniport.pipeline.human import Human
from maniport.pipeline.settings import Settings
from maniport.pipeline.transfer import FittedTransfer, mean_rotation
from maniport.util.validation import Array

ROBOTS = ("panda", "xarm7", "ur5", "iiwa", "kinova3", "g1_right_arm")
CLIPS = (
    ("freeform", "right", 0.5, 2.5),
    ("freeform", "right", 2.0, 3.0),
    ("freeform", "right", 2.0, 6.0),
    ("freeform", "right", 5.0, 6.2),
    ("freeform", "right", 1.0, 7.0),
    ("both-arms", "left", 1.0, 4.0),
    ("both-arms", "left", 5.0, 7.0),
    ("both-arms", "right", 3.0, 6.0),
    ("ladder", "right", 5.0, 9.0),
    ("ladder", "right", 10.0, 13.0),
    ("ladder", "right", 20.0, 21.5),
    ("ladder", "right", 22.0, 26.0),
    ("ladder", "right", 14.0, 17.0),
    ("both-arms", "right", 0.5, 2.5),
    ("ladder", "right", 28.0, 31.0),
    ("ladder", "right", 32.0, 36.0),
)
SHOULDER = 2  # index of the link at the shoulder
ELBOWS = {"panda": 4, "xarm7": 4, "ur5": 3, "g1_right_arm": 4}  # indices of the links at the elbow
SEEDS = (0, 1, 2)
POSITIONS = "positions only"
FOREARM = "forearm line"
DEFAULT = "default"
WEIGHTS = ("weight 0.03", "weight 0.1", "weight 0.3", "weight 1")
FIXED = "eight fixed lines"
YOSHIKAWA = "Yoshikawa"
ELBOW = "elbow angle"
STRONG = "started strong"
CONTROLS = (FIXED, YOSHIKAWA, ELBOW, STRONG)
"""Methods that know nothing of the person's strength; all but the first beside positions only, as costs of the plan."""
METHODS = (DEFAULT, "none", POSITIONS, FOREARM, "directions alone", *WEIGHTS, *CONTROLS)

STEP = 1e-5  # of central differences [rad]
STRONG_SAMPLES = (
    256  # Configurations of which one is the strongest; more are nearer to singular ones
)
POSTURE_WEIGHT = 0.1  # of the distance to it [1/rad]


@dataclass(frozen=True)
class Run:
    """One transfer."""

    recording: str
    side: str
    start: float
    stop: float
    robot: str
    seed: int
    method: str


def options_of(run: Run, scale: float | None) -> Config:
    """Return the options of a run; methods that change the targets start from the default."""
    config = Config(side=run.side, start=run.start, stop=run.stop, seed=run.seed, scale=scale)
    if run.method == "none":
        return config.changed(capability="none")
    if run.method in WEIGHTS:
        return config.changed(capability_weight=float(run.method.split()[1]))
    return config


def changed_targets(
    run: Run, targets: Sequence[TargetTrajectory], fit: ArmFit, rotation: Array, robot: mp.Arm
) -> Sequence[TargetTrajectory]:
    """Return the targets of a method."""
    if run.method in (POSITIONS, YOSHIKAWA, ELBOW, STRONG):
        return positions_only(targets)
    if run.method == FIXED:
        return [along_fixed_lines(target, robot) for target in targets]
    if run.method == "directions alone":
        return [replace(target, with_ellipsoids=False) for target in targets]
    if run.method == FOREARM:
        return [along_forearm(target, fit, rotation, robot) for target in targets]
    return targets


def along_forearm(
    target: TargetTrajectory, fit: ArmFit, rotation: Array, robot: mp.Arm
) -> TargetTrajectory:
    """Return targets with the line of the forearm in place of the person's strongest and fastest ones."""
    points = fit.arm.point_positions(fit.joint_angles, ["elbow", "wrist"])
    lines = points[:, 1] - points[:, 0]
    lines /= np.linalg.norm(lines, axis=1, keepdims=True)
    weight = mp.pipeline.Config().capability_weight
    directions = []
    for direction in target.directions:
        directions.append(
            DirectionTarget(
                kind=direction.kind,
                lines=(lines @ rotation.T)[:, None],
                weights=np.full((len(lines), 1), weight),
                reference=extent_reference(robot, direction.kind),
            )
        )
    return replace(target, directions=tuple(directions))


def along_fixed_lines(target: TargetTrajectory, robot: mp.Arm) -> TargetTrajectory:
    """Return targets with eight lines that are fixed in the base frame in place of the person's."""
    lines = half_sphere(8)
    weight = mp.pipeline.Config().capability_weight / len(lines)
    directions = []
    for direction in target.directions:
        directions.append(
            DirectionTarget(
                kind=direction.kind,
                lines=np.tile(lines, (len(direction), 1, 1)),
                weights=np.full((len(direction), len(lines)), weight),
                reference=extent_reference(robot, direction.kind),
                follows_path=False,
            )
        )
    return replace(target, directions=tuple(directions))


@dataclass(frozen=True, eq=False)
class DifferenceCost:
    """A cost whose derivatives are central differences."""

    residuals: Callable[[Array, Array], Array]  # of joint positions (n, dof) and times (n,); (n, r)

    def residual(self, at: Configurations) -> Array:
        """Return residuals, shape (n, r)."""
        return self.residuals(at.joint_positions, at.time)

    def jacobian(self, at: Configurations) -> Array:
        """Return their derivatives, shape (n, r, dof)."""
        q = at.joint_positions
        columns = []
        for step in STEP * np.eye(q.shape[1]):
            change = self.residuals(q + step, at.time) - self.residuals(q - step, at.time)
            columns.append(change / (2.0 * STEP))
        return np.stack(columns, axis=2)


def index_cost(arm: mp.Arm) -> DifferenceCost:
    """Return the cost of a small manipulability index, the volume of the velocity ellipsoid (Yoshikawa 1985).

    As the extents along lines, it is compared with its 99th percentile over configurations.
    """

    def logarithms(q: Array) -> Array:
        return np.asarray(0.5 * np.maximum(np.linalg.slogdet(arm.ellipsoids(q))[1], -50.0))

    reference = float(np.percentile(logarithms(arm.sample(1024, 0)), 99.0))

    def residuals(q: Array, _: Array) -> Array:
        return np.maximum(reference - logarithms(q), 0.0)[:, None]

    return DifferenceCost(residuals)


def elbow_cost(arm: mp.Arm, robot: str, fit: ArmFit, rotation: Array) -> DifferenceCost:
    """Return the cost of elbows that leave the line from shoulder to hand in other directions than the person's.

    `rotation` (3, 3) is that from the trunk frame to the base frame.
    """
    elbow_joint = ELBOWS[robot]
    points = fit.arm.point_positions(fit.joint_angles, ("shoulder", "elbow", "hand"))
    wanted = elbow_directions(*np.moveaxis(points, 1, 0)) @ rotation.T
    middles = 0.5 * (fit.time[1:] + fit.time[:-1])

    def residuals(q: Array, at: Array) -> Array:
        links = arm.link_poses(q)[..., :3, 3]
        hands = arm.forward(q)[:, :3, 3]
        own = elbow_directions(links[:, SHOULDER], links[:, elbow_joint], hands)
        return own - wanted[np.searchsorted(middles, at)]

    return DifferenceCost(residuals)


def elbow_directions(shoulder: Array, elbow: Array, hand: Array) -> Array:
    """Return unit vectors (n, 3) from the line between shoulder and hand to the elbow."""
    line = hand - shoulder
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    offset = elbow - shoulder
    offset = offset - np.sum(offset * line, axis=1, keepdims=True) * line
    return np.asarray(offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-9))


def strong_configuration(arm: mp.Arm, fit: ArmFit, rotation: Array) -> Array:
    """Return the configuration (dof,) of 256 that is strongest along the mean of the person's strongest lines."""
    lines = person_lines(fit, "force")[0][:, 0] @ rotation.T
    mean = np.linalg.eigh(lines.T @ lines)[1][:, -1]
    q = arm.sample(STRONG_SAMPLES, 0)
    return np.asarray(q[line_extent(arm, q, mean[None])[:, 0].argmax()])


class Moved(NamedTuple):
    """The motion of a method."""

    motion: RobotMotion
    placement: Placement
    seconds: float  # of the processor


@dataclass(frozen=True, eq=False)
class Case:
    """A clip and a robot whose map is fitted once for all methods."""

    human: Human
    fitted: FittedTransfer

    @classmethod
    def of(cls, run: Run) -> "Case":
        """Read the clip, and fit the map."""
        transfer = mp.Transfer(run.robot, options_of(run, None))
        human = transfer.read(shipped_recording(run.recording))
        return cls(human, transfer.fit(human))

    @property
    def fit(self) -> ArmFit:
        """The person's arm."""
        (fit,) = self.human.motion.arms
        return fit

    @property
    def arm(self) -> mp.Arm:
        """The robot's arm."""
        (arm,) = self.fitted.settings.arms
        return arm

    def moved(self, run: Run, scale: float | None) -> Moved:
        """Place and plan by a method."""
        settings = replace(self.fitted.settings, config=options_of(run, scale))
        fitted = replace(self.fitted, settings=settings)
        (adapter,) = fitted.adapters
        begin = time.process_time()
        mapped = fitted.map(self.human)
        targets = changed_targets(run, mapped, self.fit, adapter.map_rotation_, self.arm)
        robot = replace(fitted.robot, random=deepcopy(fitted.robot.random))
        rotation = mean_rotation(fitted.maps)
        if run.method in (YOSHIKAWA, ELBOW, STRONG):
            motion, placement = moved_by_cost(
                run, tuple(targets), robot, settings, self.fit, rotation
            )
        else:
            motion, placements = move(tuple(targets), robot, settings, rotation)
            assert placements is not None
            placement = placements[0]
        return Moved(motion, placement, time.process_time() - begin)

    def transferred(self, run: Run, scale: float | None) -> dict[str, float]:
        """Place and plan by a method; return what its motion is measured by."""
        moved = self.moved(run, scale)
        result = measured(self.fit, self.arm, moved.motion, moved.placement)
        return {**result, "scale": moved.placement.scale, "processor_s": moved.seconds}


def moved_by_cost(
    run: Run,
    targets: tuple[TargetTrajectory, ...],
    robot: SampledRobot,
    settings: Settings,
    fit: ArmFit,
    rotation: Array,
) -> tuple[RobotMotion, Placement]:
    """Place the path for its positions alone, and plan with a cost; a strong configuration determines the place."""
    (arm,) = settings.arms
    if run.method == STRONG:
        strong = strong_configuration(arm, fit, rotation)
        center = tuple(arm.forward(strong)[:3, 3].tolist())
        config = settings.config.changed(yaw=0.0, offset=center)
        settings = replace(settings, config=config)
    (placement,) = place(targets, robot, settings, rotation)[0]
    if run.method == STRONG:
        cost: mp.motion.Cost = PostureCost(strong, POSTURE_WEIGHT)
    elif run.method == ELBOW:
        turned = placement.rotation @ placement.map_rotation
        cost = elbow_cost(arm, run.robot, fit, turned)
    else:
        cost = index_cost(arm)
    assert settings.plan is not None
    settings = replace(settings, plan=replace(settings.plan, costs=(cost,)))
    placed = [placement.moved(target) for target in targets]
    return plan(placed, robot, settings, [placement.joint_positions]), placement


def measured(
    fit: ArmFit, arm: mp.Arm, motion: RobotMotion, placement: Placement
) -> dict[str, float]:
    """Return force and speed along the person's strongest and fastest lines, and other figures of a motion."""
    rotation = placement.rotation @ placement.map_rotation
    own = motion.arms[0]
    result = {}
    for kind in CAPABILITIES["both"]:
        if not is_limited(arm, kind):  # such as the speed of an iiwa
            continue
        lines = person_lines(fit, kind)[0][:, 0] @ rotation.T
        extents = line_extent(arm, own.joint_positions, lines[:, None], kind)[:, 0]
        result[kind] = float(np.median(extents))
        result[f"{kind}_5"] = float(np.percentile(extents, 5.0))
    assert own.position_error is not None
    result["distance"] = float(np.median(own.distance))
    result["position_error_95_mm"] = 1e3 * float(np.percentile(own.position_error, 95.0))
    result["duration_s"] = float(own.control_time[-1])
    result["colliding"] = float(motion.clearance.share)
    return result


def main() -> None:
    """Run what is missing, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.capability", description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--clips", type=int, default=len(CLIPS), help="number of clips")
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS))
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=METHODS)
    options = parser.parse_args()
    known: dict[Run, dict[str, float]] = {}
    if options.file.exists():
        for line in options.file.read_text(encoding="utf-8").splitlines():
            record = json.loads(line)
            known[Run(**record["run"])] = record["result"]
    methods = sorted({DEFAULT, *options.methods}, key=METHODS.index)
    cases = itertools.product(options.seeds, CLIPS[: options.clips], options.robots)
    for seed, clip, robot in cases:
        scale = None
        case = None
        for method in methods:
            run = Run(*clip, robot, seed, method)
            if run not in known:
                if case is None:
                    case = Case.of(run)
                known[run] = case.transferred(run, scale)
                line = json.dumps({"run": asdict(run), "result": known[run]})
                with options.file.open("a", encoding="utf-8") as file:
                    file.write(f"{line}\n")
            if method == DEFAULT:
                scale = known[run]["scale"]
    print_table(known, options.robots, methods)


def print_table(
    known: dict[Run, dict[str, float]], robots: Sequence[str], methods: Sequence[str]
) -> None:
    """Print medians over clips and seeds, relative to positions only, and their 5th percentiles."""
    print(
        "| robot | method | force × | speed × | force × of 5th | speed × of 5th | distance | duration × | mm |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for robot, method in itertools.product(robots, methods):
        rows = []
        for run, result in known.items():
            reference = known.get(replace(run, method=POSITIONS))
            if run.robot == robot and run.method == method and reference is not None:
                rows.append((result, reference))
        if not rows:
            continue
        cells = []
        for name in ("force", "velocity", "force_5", "velocity_5"):
            ratios = [own[name] / other[name] for own, other in rows if name in own]
            cells.append(spread(ratios) if ratios else "–")
        cells.append(f"{np.median([own['distance'] for own, _ in rows]):.2f}")
        cells.append(spread([own["duration_s"] / other["duration_s"] for own, other in rows]))
        cells.append(f"{np.median([own['position_error_95_mm'] for own, _ in rows]):.1f}")
        print(f"| {robot} | {method} ({len(rows)}) | {' | '.join(cells)} |")


def spread(ratios: Sequence[float]) -> str:
    """Write the median, and in brackets the 5th percentile."""
    return f"{np.median(ratios):.2f} ({np.percentile(ratios, 5.0):.2f})"


if __name__ == "__main__":
    main()
