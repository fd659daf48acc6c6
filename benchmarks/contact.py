"""How often robots succeed at contact tasks along the person's strongest line: ``python -m benchmarks.contact FILE``.

Each clip is transferred to each robot by several methods at the same scale, as in `benchmarks.capability`. At up to
three moments of the clip, the hand then pulls a drawer, turns a lever, and is pushed, with loads that are fixed for
each robot; see `benchmarks.contact_tasks`. The results are appended to FILE, one JSON object a line; runs that it has
already are not repeated.
"""

import argparse
import itertools
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import maniport as mp
from benchmarks.capability import (
    DEFAULT,
    FOREARM,
    POSITIONS,
    Case,
    Moved,
    Run,
    measured,
)
from benchmarks.contact_tasks import TASKS, TRAVEL, Contact, require_simulated
from maniport.arms import Arm
from maniport.arms.directional import line_extent
from maniport.mocap import ArmFit
from maniport.motion.trajectory import interpolated
from maniport.pipeline.capability import person_lines
from maniport.util.validation import Array

ROBOTS = (
    "panda",
    "tiago_pro_right_arm",
    "z1",
)  # the weights of maniport were chosen without the last two
CLIPS = (  # that do not overlap
    ("freeform", "right", 0.5, 2.5),
    ("ladder", "right", 5.0, 9.0),
    ("both-arms", "left", 1.0, 4.0),
    ("ladder", "right", 10.0, 13.0),
    ("freeform", "right", 2.5, 5.0),
    ("ladder", "right", 14.0, 17.0),
    ("both-arms", "left", 5.0, 7.0),
    ("ladder", "right", 20.0, 21.5),
    ("freeform", "right", 5.0, 7.5),
    ("ladder", "right", 22.0, 26.0),
    ("ladder", "right", 28.0, 31.0),
    ("ladder", "right", 32.0, 36.0),
)
METHODS = (DEFAULT, "weight 1", "none", FOREARM, POSITIONS)
SEEDS = (0, 1)
LOADS = (30.0, 60.0, 90.0)  # percentiles of the forces of random configurations along random lines
CONFIGURATIONS = 2000  # of them
PARTS = 3  # of a clip, with one moment each
SAMPLES = 50  # of the joint path of a contact
DRAWS = 2000  # of the bootstrap


@dataclass(frozen=True)
class Trial:
    """One attempt at a task."""

    task: str
    frame: int
    load: float  # [N]
    success: bool
    error_mm: float
    saturation_s: float


Result = tuple[dict[str, float], list[Trial]]
"""What a motion is measured by, and the attempts with it."""


class Moment(NamedTuple):
    """A moment of a clip, and the travel of the hand from there on."""

    frame: int
    end: float  # in frames
    line: Array  # (3,) in the trunk frame, in the sense of the travel
    bend: Array  # (3,)


def loads_of(arm: Arm) -> list[float]:
    """Return the loads of a robot [N], which no motion and no person has a part in."""
    random = np.random.default_rng(0)
    lines = random.normal(size=(CONFIGURATIONS, 1, 3))
    forces = line_extent(arm, arm.sample(CONFIGURATIONS, 0), lines)
    return [round(float(force), 1) for force in np.percentile(forces, LOADS)]


def moments_of(fit: ArmFit, hand_path: Array, scale: float) -> list[Moment]:
    """Find the moment in each third of a clip at which the person pulls hardest in the sense of the hand's travel.

    The hand must then travel 4 cm along the person's strongest line, at the scale of the robot's path. Moments are the
    same for all methods; a third without such a moment has none.
    """
    strongest = person_lines(fit, "force")[0][:, :1]
    forces = line_extent(fit.arm, fit.joint_angles, strongest)[:, 0]
    found = []
    for frames in np.array_split(np.arange(len(hand_path) - 1), PARTS):
        candidates = []
        for frame in frames:
            moment = travel_from(int(frame), scale * hand_path, strongest[frame, 0])
            if moment is not None:
                ahead = interpolated_row(hand_path, moment.end) - hand_path[frame]
                pull = forces[frame] * moment.line @ ahead / np.linalg.norm(ahead)
                candidates.append((float(pull), moment))
        if candidates:
            found.append(max(candidates, key=lambda candidate: candidate[0])[1])
    return found


def travel_from(frame: int, path: Array, line: Array) -> Moment | None:
    """Return the travel along a line from a frame on, or None if the path ends or turns back before."""
    ahead = (path[frame:] - path[frame]) @ line
    sense = 1.0 if ahead[1] > 0.0 else -1.0
    ahead = sense * ahead
    reached = np.flatnonzero(ahead >= TRAVEL)
    if not len(reached):
        return None
    last = int(reached[0])
    if np.any(np.diff(ahead[: last + 1]) < 0.0):
        return None
    share = (TRAVEL - ahead[last - 1]) / (ahead[last] - ahead[last - 1])
    end = frame + last - 1 + float(share)
    across = interpolated_row(path, end) - path[frame]
    across = across - across @ line * line
    bend = across / np.linalg.norm(across)
    return Moment(frame, end, sense * line, bend)


def interpolated_row(rows: Array, index: float) -> Array:
    """Interpolate rows (n, d) linearly at an index, shape (d,)."""
    (row,) = interpolated(np.arange(len(rows), dtype=np.float64), rows, np.array([index]))
    return np.asarray(row)


def contact_at(moment: Moment, moved: Moved, arm: Arm) -> Contact:
    """Return the part of a robot's motion from a moment on."""
    motion = moved.motion.arms[0]
    frames = np.arange(len(motion.time))
    begin, end = np.interp([moment.frame, moment.end], frames, motion.time)
    time = np.linspace(begin, end, SAMPLES)
    positions = interpolated(motion.control_time, motion.control_positions, time)
    rotation = moved.placement.rotation @ moved.placement.map_rotation
    return Contact(arm, positions, rotation @ moment.line, rotation @ moment.bend)


def attempted(case: Case, moved: Moved, loads: Sequence[float]) -> list[Trial]:
    """Attempt all tasks with a motion."""
    trials = []
    for moment in moments_of(case.fit, case.human.hand_paths[0], moved.placement.scale):
        contact = contact_at(moment, moved, case.arm)
        for task, load in itertools.product(TASKS, loads):
            outcome = TASKS[task](contact, load)
            trial = Trial(
                task=task,
                frame=moment.frame,
                load=load,
                success=outcome.success,
                error_mm=1e3 * outcome.error,
                saturation_s=outcome.saturation,
            )
            trials.append(trial)
    return trials


def read_results(path: Path) -> dict[Run, Result]:
    """Read the runs of a file, if there is one."""
    known: dict[Run, Result] = {}
    if not path.exists():
        return known
    for line in path.read_text(encoding="utf-8").splitlines():
        record = json.loads(line)
        trials = [Trial(**trial) for trial in record["trials"]]
        known[Run(**record["run"])] = (record["result"], trials)
    return known


def run_missing(path: Path, runs: Sequence[Run], methods: Sequence[str]) -> dict[Run, Result]:
    """Attempt the tasks by all methods with each clip, robot and seed, unless the file has them."""
    known = read_results(path)
    loads = {}
    for robot in dict.fromkeys(run.robot for run in runs):
        arm = mp.load_arm(robot)
        require_simulated(arm)
        loads[robot] = loads_of(arm)
    for first in runs:
        scale = None
        case = None
        for method in methods:
            run = replace(first, method=method)
            if run not in known:
                if case is None:
                    case = Case.of(first)
                moved = case.moved(run, scale)
                result = measured(case.fit, case.arm, moved.motion, moved.placement)
                result["scale"] = moved.placement.scale
                result["processor_s"] = moved.seconds
                trials = attempted(case, moved, loads[run.robot])
                known[run] = (result, trials)
                append(path, run, known[run])
            if method == DEFAULT:
                scale = known[run][0]["scale"]
    return known


def append(path: Path, run: Run, result: Result) -> None:
    """Append a run to a file."""
    record = {
        "run": asdict(run),
        "result": result[0],
        "trials": [asdict(trial) for trial in result[1]],
    }
    with path.open("a", encoding="utf-8") as file:
        file.write(f"{json.dumps(record)}\n")


class Rate(NamedTuple):
    """A share with its interval of 95 %."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.0%} ({self.low:.0%}–{self.high:.0%})".replace("%", "")


def rate_of(values: Sequence[tuple[str, float]]) -> Rate:
    """Return the mean of values and its interval by bootstrap over clips; each value has the name of its clip."""
    clips = sorted({clip for clip, _ in values})
    sums = np.zeros(len(clips))
    counts = np.zeros(len(clips))
    for clip, value in values:
        sums[clips.index(clip)] += value
        counts[clips.index(clip)] += 1.0
    drawn = np.random.default_rng(0).integers(len(clips), size=(DRAWS, len(clips)))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return Rate(float(sums.sum() / counts.sum()), float(low), float(high))


def trials_of(
    known: dict[Run, Result], robot: str, method: str, task: str | None = None
) -> dict[tuple[Run, Trial], float]:
    """Return successes by what is common to all methods: the run by positions only, and the trial without outcome."""
    results = {}
    for run, (_, trials) in known.items():
        if run.robot != robot or run.method != method:
            continue
        for trial in trials:
            if task in (None, trial.task):
                same = replace(trial, success=False, error_mm=0.0, saturation_s=0.0)
                results[replace(run, method=POSITIONS), same] = float(trial.success)
    return results


def rate(successes: dict[tuple[Run, Trial], float]) -> str:
    """Write the share of successes and its interval."""
    values = [(clip_name(run), success) for (run, _), success in successes.items()]
    return str(rate_of(values)) if values else "–"


def difference(
    successes: dict[tuple[Run, Trial], float], reference: dict[tuple[Run, Trial], float]
) -> str:
    """Write the difference of the shares of two methods and its interval, over attempts that both have."""
    values = []
    for key, success in successes.items():
        if key in reference:
            values.append((clip_name(key[0]), success - reference[key]))
    if not values:
        return "–"
    own = rate_of(values)
    return f"{100 * own.value:+.0f} ({100 * own.low:+.0f} to {100 * own.high:+.0f})"


def clip_name(run: Run) -> str:
    """Return a name that all runs of a clip share."""
    return f"{run.recording} {run.side} {run.start:g} {run.stop:g}"


def print_tables(known: dict[Run, Result], robots: Sequence[str], methods: Sequence[str]) -> None:
    """Print the shares of successes in percent by task and by load, with intervals of 95 % over clips."""
    print(
        "| robot | method (motions) | drawer | lever | brace | all | default − method "
        "| force × | duration × | mm |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for robot, method in itertools.product(robots, methods):
        everything = trials_of(known, robot, method)
        if not everything:
            continue
        cells = [rate(trials_of(known, robot, method, task)) for task in TASKS]
        cells.append(rate(everything))
        cells.append(difference(trials_of(known, robot, DEFAULT), everything))
        cells.extend(losses(known, robot, method))
        motions = len({run for run, _ in everything})
        print(f"| {robot} | {method} ({motions}) | {' | '.join(cells)} |")
    print("\n| robot | load [N] |", " | ".join(methods), "|")
    print(f"|---|---|{'---|' * len(methods)}")
    for robot in robots:
        every = {}
        for method in methods:
            every[method] = trials_of(known, robot, method)
        loads = sorted({trial.load for trials in every.values() for _, trial in trials})
        for load in loads:
            cells = []
            for method in methods:
                kept = {key: value for key, value in every[method].items() if key[1].load == load}
                cells.append(rate(kept))
            print(f"| {robot} | {load:g} | {' | '.join(cells)} |")


def losses(known: dict[Run, Result], robot: str, method: str) -> list[str]:
    """Write medians over motions: force and duration relative to positions only, and the position error."""
    forces = []
    durations = []
    errors = []
    for run, (result, _) in known.items():
        reference = known.get(replace(run, method=POSITIONS))
        if run.robot == robot and run.method == method and reference is not None:
            forces.append(result["force"] / reference[0]["force"])
            durations.append(result["duration_s"] / reference[0]["duration_s"])
            errors.append(result["position_error_95_mm"])
    if not forces:
        return ["–", "–", "–"]
    return [f"{np.median(forces):.2f}", f"{np.median(durations):.2f}", f"{np.median(errors):.1f}"]


def main(words: Sequence[str] | None = None) -> None:
    """Run what is missing, and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.contact", description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--clips", type=int, default=len(CLIPS), help="number of clips")
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS))
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=METHODS)
    options = parser.parse_args(words)
    methods = sorted({DEFAULT, *options.methods}, key=METHODS.index)
    runs = []
    for seed, clip, robot in itertools.product(
        options.seeds, CLIPS[: options.clips], options.robots
    ):
        runs.append(Run(*clip, robot, seed, DEFAULT))
    known = run_missing(options.file, runs, methods)
    print_tables(known, options.robots, methods)


if __name__ == "__main__":
    main()
