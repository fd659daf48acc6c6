"""How well a robot follows a person at the person's pace: position error, ellipsoid distance and use of limits.

    python -m benchmarks.live_following [CASE ...] [--options real_time=false ...] [--delay 0.1] [--cache FOLDER] ...

Each case transfers a recording, and plays it (or another one of the same motion) to `maniport.Live` in simulated time.
Webcam cases have 30 frames a second, Gaussian noise of 12 mm (7 mm in each direction) and missing frames and points.
`--delay` is that of `Live`. Two columns are distances to the hand path without noise, with the delay and at present.
`--inputs` measures lag, errors and smoothness with sensors of different rates and noise, jumps of points, and a person
who leaves and returns.
`--optimum` computes the smallest maximum position error of a robot that knows the whole motion (minutes a case): each
arm by itself, within the limits, regardless of collisions, a local optimum from the live motion.
With a cache, calibrations are read from a folder where they are there; delete it when placement or options change.
"""

import argparse
import pickle
import warnings
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import yaml
from scipy.interpolate import make_interp_spline
from scipy.optimize import linprog

import maniport as mp
from maniport.errors import ManiportWarning
from maniport.live.state import LiveState
from maniport.mocap import Recording, shipped_recording

from .inputs import Array

# [m], [Hz]
NOISE = 0.012
FRAME_RATE = 30.0
OPTIONS: dict[str, Any] = {
    "real_time": True,
    "method": "scaled-transport",
    "n_teacher": 1024,
    "n_student": 2048,
}


@dataclass(frozen=True)
class Case:
    """A recording that is followed, and the one that is the calibration."""

    recording: str
    start: float = 0.0  # [s]
    stop: float = 1000.0
    seed: int | None = None  # of the noise of a webcam; None: as recorded
    calibration: tuple[float, float] | None = (
        None  # part of the recording [s]; None: the same frames
    )


CASES = {
    "freeform": Case("freeform"),
    "ladder": Case("ladder"),
    "both-arms": Case("both-arms"),
    "webcam 1": Case("freeform", seed=1),
    "webcam 2": Case("freeform", seed=2),
    "webcam 3": Case("ladder", 0.0, 12.0, seed=3),
    "webcam 4": Case("ladder", 12.0, 24.0, seed=4),
    "webcam 5": Case("ladder", 24.0, 37.0, seed=5),
    "freeform, first half as calibration": Case("freeform", calibration=(0.0, 4.5)),
    "ladder, first third as calibration": Case("ladder", calibration=(0.0, 12.0)),
}


def sampled(recording: Recording, rate: float, noise: float, degree: int, random: Any) -> Recording:
    """Sample splines of a degree at a rate [Hz], with Gaussian noise [m]; points are missing where they were."""
    time = np.arange(recording.time[0], recording.time[-1], 1.0 / rate)
    rows = np.abs(recording.time[:, None] - time).argmin(axis=0)
    positions = np.full((len(time), *recording.positions.shape[1:]), np.nan)
    for i in range(len(recording.names)):
        seen = ~np.isnan(recording.positions[:, i, 0])
        if not seen.any():
            continue
        spline = make_interp_spline(recording.time[seen], recording.positions[seen, i], k=degree)
        positions[:, i] = spline(np.clip(time, *recording.time[seen][[0, -1]]))
        positions[~seen[rows], i] = np.nan
    positions += random.normal(0.0, noise / np.sqrt(3.0), positions.shape)
    return replace(recording, positions=positions, time=time)


def webcam(recording: Recording, seed: int, bursts: float = 0.007) -> Recording:
    """Sample at 30 Hz, with noise, a share of `bursts` of 1 to 5 missing frames, and 2 % of points missing."""
    random = np.random.default_rng(seed)
    seen = sampled(recording, FRAME_RATE, NOISE, 1, random)
    positions = seen.positions.copy()
    positions[random.random(positions.shape[:2]) < 0.02] = np.nan
    for first in np.flatnonzero(random.random(len(positions)) < bursts):
        positions[first : first + random.integers(1, 6)] = np.nan
    return replace(seen, positions=positions, source=f"{recording.source} seed {seed}")


def mocap(recording: Recording, rate: float) -> Recording:
    """Sample at a rate [Hz], with noise of 0.5 mm."""
    return sampled(recording, rate, 0.0005, 3, np.random.default_rng(0))


def jumping(recording: Recording) -> Recording:
    """Displace 1 % of points by 0.3 m, for 1 to 3 frames each."""
    random = np.random.default_rng(0)
    positions = recording.positions.copy()
    for first, point in np.argwhere(random.random(positions.shape[:2]) < 0.005):
        direction = random.normal(size=3)
        positions[first : first + random.integers(1, 4), point] += (
            0.3 * direction / np.linalg.norm(direction)
        )
    return replace(recording, positions=positions)


def leaving(recording: Recording) -> Recording:
    """Omit 2 s of each 4 s."""
    gone = (recording.time - recording.time[0]) % 4.0 > 2.0
    return replace(recording, positions=np.where(gone[:, None, None], np.nan, recording.positions))


def transferred(
    case: Case, options: dict[str, Any], cache: Path | None
) -> tuple[Recording, Recording, Any]:
    """Return the recording as it is followed, the same without noise, and the result of the calibration."""
    clean = mp.read_recording(shipped_recording(case.recording)).crop(case.start, case.stop)
    followed = clean if case.seed is None else webcam(clean, case.seed)
    calibration = followed if case.calibration is None else followed.crop(*case.calibration)
    if case.recording == "both-arms":
        options = {
            **options,
            "robot": mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)]),
        }
    file = None if cache is None else cache / f"{case!r}.pickle"
    if file is not None and file.exists():
        return followed, clean, pickle.loads(file.read_bytes())
    result = mp.transfer_recording(calibration, **{**OPTIONS, **options})
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(pickle.dumps(result))
    return followed, clean, result


def follower(result: Any, delay: float) -> mp.Live:
    """Return a robot in simulated time that follows whenever the person is visible."""
    return mp.Live.of(result, clock=None, delay=delay, auto_engage=True)


def played(live: mp.Live, recording: Recording) -> list[LiveState]:
    """Follow a recording in simulated time; frames of which no point is seen do not arrive."""
    points = np.stack([recording.point(name) for name in live.points], axis=1)
    return [
        live.step(None if np.isnan(frame).all() else frame, t)
        for frame, t in zip(points, recording.time, strict=True)
    ]


def use_of_limits(limits: Any, time: Array, q: Array) -> tuple[float, float]:
    """Largest share of the limits of velocity and acceleration of commands, from rest."""
    steps = np.diff(time)[:, None]
    velocity = np.diff(q, axis=0) / steps
    acceleration = np.diff(velocity, axis=0) / (0.5 * (steps[1:] + steps[:-1]))
    return float((np.abs(velocity) / limits.velocity).max()), float(
        (np.abs(acceleration) / limits.acceleration).max()
    )


def measured(
    case: Case, options: dict[str, Any], cache: Path | None, delay: float
) -> dict[str, Any]:
    """Follow, and return position errors [mm], ellipsoid distances and shares of limits."""
    followed, clean, result = transferred(case, options, cache)
    states = played(follower(result, delay), followed)
    first = next(
        (i for i, state in enumerate(states) if state.state in ("following", "lagging")),
        len(states) - 1,
    )
    late = [state for state in states[first:] if state.position_error is not None]
    errors = 1e3 * np.array([state.position_error for state in late])
    distance = np.array([[arm.distance for arm in state.arms] for state in late])
    planned = np.stack([arm.motion.distance for arm in result.arms], axis=1)
    hands = [placed_hand(arm, clean) for arm in result.arms]
    delayed, present = (
        1e3
        * np.concatenate([_offsets(states[first:], hand, i, lag) for i, hand in enumerate(hands)])
        for lag in (delay, 0.0)
    )
    limits = result.motion.trajectory.limits
    q = np.array([state.joint_positions for state in states])
    return {
        "scale": result.arms[0].placement.scale,
        "duration": float(result.motion.trajectory.control_time[-1]),
        "person": float(np.ptp(result.arms[0].time)),
        "errors": [np.percentile(own, (50.0, 95.0, 100.0)) for own in (errors, delayed, present)],
        "distance": (rms(distance), rms(planned)),
        "limits": use_of_limits(limits, followed.time, q),
        "following": float(np.mean([state.state == "following" for state in states])),
    }


def optimum(
    case: Case, options: dict[str, Any], cache: Path | None, iterations: int = 12
) -> list[Array]:
    """Minimize the largest position error by sequential linear programs; return percentiles [mm] of each arm."""
    followed, _, result = transferred(case, options, cache)
    states = played(follower(result, 0.0), followed)
    errors = []
    states = [
        state for state in states if all(arm.position_error is not None for arm in state.arms)
    ]
    dt = float(np.median(np.diff(followed.time)))
    limits = result.motion.trajectory.limits
    signs = np.array(np.meshgrid(*[(-1.0, 0.0, 1.0)] * 3)).reshape(3, -1).T
    sides = signs[signs.any(axis=1)] / np.linalg.norm(
        signs[signs.any(axis=1)], axis=1, keepdims=True
    )  # 26 directions
    for i, arm in enumerate(own.robot for own in result.arms):
        columns = slice(arm.dof * i, arm.dof * (i + 1))
        q = np.array([state.joint_positions[columns] for state in states])
        path = np.array([state.arms[i].target_position for state in states])
        n, dof = q.shape
        change = sp.diags([-1.0, 1.0], [0, 1], (n - 1, n))
        second = sp.diags([1.0, -2.0, 1.0], [0, 1, 2], (n - 2, n))
        rows = sp.vstack([sp.kron(change, np.eye(dof)) / dt, sp.kron(second, np.eye(dof)) / dt**2])
        most = np.append(
            np.tile(limits.velocity[columns], n - 1), np.tile(limits.acceleration[columns], n - 2)
        )
        # [rad]
        error = np.linalg.norm(arm.forward(q)[:, :3, 3] - path, axis=1)
        trust = 0.15
        for _ in range(iterations):
            off = arm.forward(q)[:, :3, 3] - path
            jacobian = arm.jacobian(q)[:, :3]
            speeds = rows @ q.ravel()
            ends = sp.block_diag([sides @ own for own in jacobian])
            bound = np.ones((ends.shape[0], 1))
            none = sp.csr_matrix((len(speeds), 1))
            matrix = sp.vstack(
                [sp.hstack([ends, -bound]), sp.hstack([rows, none]), sp.hstack([-rows, none])]
            )
            right = np.concatenate([-(off @ sides.T).ravel(), most - speeds, most + speeds])
            step = (
                np.maximum(limits.arm.lower[columns] - q, -trust),
                np.minimum(limits.arm.upper[columns] - q, trust),
            )
            bounds = [*zip(step[0].ravel(), step[1].ravel(), strict=True), (0.0, None)]
            solution = linprog(
                np.eye(n * dof + 1)[-1], matrix.tocsr(), right, bounds=bounds, method="highs-ipm"
            ).x
            trial = q if solution is None else q + solution[:-1].reshape(n, dof)
            trial_error = np.linalg.norm(arm.forward(trial)[:, :3, 3] - path, axis=1)
            if trial_error.max() < error.max():
                q = trial
                error = trial_error
            else:
                trust *= 0.4
        errors.append(1e3 * np.percentile(error, (50.0, 95.0, 100.0)))
    return errors


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def placed_hand(arm: Any, clean: Recording) -> Any:
    """Return the placed hand path of a recording without noise as a spline."""
    fit = mp.fit_arm(clean, side=arm.fit.arm.side)
    hand = arm.placement.apply(fit.arm.forward(fit.joint_angles)[:, :3, 3] + arm.person_base)
    return make_interp_spline(fit.time, hand, k=3)


def _offsets(states: list[LiveState], hand: Any, index: int = 0, lag: float = 0.0) -> Array:
    """Distances of an end effector from a hand path that is shifted by a lag [m]."""
    time = np.array([state.time for state in states]) - lag
    inside = (time >= hand.t[0]) & (time <= hand.t[-1])
    reached = np.array([state.arms[index].position for state in states])
    return np.asarray(np.linalg.norm((reached - hand(time))[inside], axis=1))


def inputs(recording: str, options: dict[str, Any], cache: Path | None) -> dict[str, list[str]]:
    """Follow a recording as different sensors measure it; return the cells of a table.

    The lag is the time shift of the hand path without noise that fits the motion of the end effector best, and the
    smoothness the rms acceleration of the end effector divided by that of the hand path.
    """
    table = {}
    clean, _, precise = transferred(Case(recording), options, cache)
    noisy, _, coarse = transferred(Case(recording, seed=1), options, cache)
    for name, followed, result, delay in (
        ("mocap, 60 Hz", mocap(clean, 60.0), precise, 0.15),
        ("mocap, 120 Hz", mocap(clean, 120.0), precise, 0.15),
        ("mocap, 240 Hz", mocap(clean, 240.0), precise, 0.15),
        ("mocap, 120 Hz, no delay", mocap(clean, 120.0), precise, 0.0),
        ("webcam", noisy, coarse, 0.15),
        ("webcam, no delay", noisy, coarse, 0.0),
        ("webcam, 10 % of frames missing", webcam(clean, 1, 0.033), coarse, 0.15),
        ("mocap, 60 Hz, jumps", jumping(mocap(clean, 60.0)), precise, 0.15),
        ("mocap, 120 Hz, leaving", leaving(mocap(clean, 120.0)), precise, 0.15),
    ):
        states = played(follower(result, delay), followed)
        hand = placed_hand(result.arm, clean)
        late = [state for state in states if state.state in ("following", "lagging")]
        lags = np.arange(0.0, 0.4, 0.002)
        lag = lags[np.argmin([rms(_offsets(late, hand, lag=own)) for own in lags])]
        errors = 1e3 * np.array([state.position_error for state in late])
        limits = result.motion.trajectory.limits
        q = np.array([state.joint_positions for state in states])
        time = followed.time
        reached = np.array([state.arm.position for state in states])
        is_late = (time <= hand.t[-1]) & np.isin(
            [state.state for state in states], ("following", "lagging")
        )
        rows = is_late[2:] & is_late[1:-1] & is_late[:-2]
        acceleration = [rms(np.diff(path, n=2, axis=0)[rows]) for path in (reached, hand(time))]
        values = errors, 1e3 * _offsets(late, hand, lag=lag)
        table[name] = [
            f"{lag:.2f}",
            *(
                ", ".join(f"{value:.0f}" for value in np.percentile(own, (95.0, 100.0)))
                for own in values
            ),
            f"{acceleration[0] / acceleration[1]:.2f}",
            ", ".join(f"{value:.2f}" for value in use_of_limits(limits, time, q)),
            ", ".join(f"{value:.2f}" for value in returns(states, limits.velocity)),
        ]
    return table


def returns(states: list[LiveState], velocity: Array) -> tuple[float, float]:
    """Longest time from the return of a person until `following` [s], and largest share of speed limits in it."""
    longest = 0.0
    fastest = 0.0
    began = None
    for before, state in pairwise(states):
        if state.state == "approaching":
            began = before.time if began is None else began
            longest = max(longest, state.time - began)
            fastest = max(fastest, float((np.abs(state.joint_velocities) / velocity).max()))
        else:
            began = None
    return longest, fastest


def row(name: str, own: dict[str, Any]) -> str:
    """Return a row of the table."""
    errors = (", ".join(f"{value:.0f}" for value in values) for values in own["errors"])
    live, planned = own["distance"]
    cells = (
        name,
        f"{own['scale']:.2f}",
        *errors,
        f"{live:.2f}",
        f"{planned:.2f}",
        f"{live / planned:.2f}",
        f"{own['duration'] / own['person']:.2f}",
        ", ".join(f"{value:.2f}" for value in own["limits"]),
        f"{100 * own['following']:.0f} %",
    )
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.live_following", description=__doc__
    )
    parser.add_argument(
        "cases", nargs="*", metavar="CASE", help=f"default: all of {', '.join(CASES)}"
    )
    parser.add_argument(
        "--options", nargs="*", default=[], help="options of transfer_recording, NAME=VALUE"
    )
    parser.add_argument("--delay", type=float, default=0.15, help="delay of the robot [s]")
    parser.add_argument("--cache", type=Path, help="folder of calibrations")
    parser.add_argument(
        "--optimum", action="store_true", help="print the optimum with known motion, too"
    )
    parser.add_argument(
        "--inputs", action="store_true", help="compare sensors, with freeform and ladder"
    )
    parsed = parser.parse_args()
    options = {
        name: yaml.safe_load(value)
        for name, _, value in (text.partition("=") for text in parsed.options)
    }
    warnings.simplefilter("ignore", ManiportWarning)
    if parsed.inputs:
        print(
            "| input | lag [s] | position error [mm] | to the shifted path | smoothness | v, a | return [s], v |"
        )
        print("|---" * 7 + "|")
        tables = [inputs(recording, options, parsed.cache) for recording in ("freeform", "ladder")]
        for name in tables[0]:
            cells = ("; ".join(own) for own in zip(*(table[name] for table in tables), strict=True))
            print(f"| {name} | " + " | ".join(cells) + " |")
        return
    columns = "position error [mm] | hand path, delayed | present hand | distance | plan | ratio | time | v, a | near |"
    print(f"| recording | scale | {columns}\n" + "|---" * 11 + "|")
    for name in parsed.cases or CASES:
        print(row(name, measured(CASES[name], options, parsed.cache, parsed.delay)), flush=True)
        if parsed.optimum:
            print("optimum [mm]:", *optimum(CASES[name], options, parsed.cache), flush=True)


if __name__ == "__main__":
    main()
