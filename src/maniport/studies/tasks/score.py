"""The five tasks, scored from joint positions alone, within the torque limits of the robot and against gravity.

Larger scores are better, except for the time of `react` and the displacement of `resist`.
"""

import os
from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from maniport.arms import Arm
from maniport.errors import FileFormatError, InvalidInputError
from maniport.evaluation.capability import FORCE, VELOCITY, half_sphere, line_extent, polytope_extent, resemblance
from maniport.motion import MotionLimits
from maniport.motion.plan.roadmap import moved_to_positions
from maniport.studies.tasks.simulation import STEP, SimulatedArm
from maniport.studies.tasks.task import MOST_BYTES, Task
from maniport.util.input_limits import read_whole
from maniport.util.validation import Array, as_finite, as_times, require_shape

Scores = Mapping[str, float]
"""By the names of `SCORES`, and the largest ``position_error`` [mm] and shares of velocity and position limits."""

SCORES = {
    "push": "N", "speed": "m/s", "react": "s", "resist": "mm", "carry": "kg",
    "resemblance_force": "", "resemblance_speed": "",
}  # fmt: skip
"""Scores and their units."""

LESS_IS_BETTER = ("react", "resist")
YIELD = 5e-3  # displacement at which the end effector has yielded, and largest position error of the path [m]


def score(task: Task, q: Array) -> Scores:
    """Score a motion.

    Parameters
    ----------
    task : Task
    q : ndarray, shape (n, dof)
        Joint positions at the waypoints [rad] or [m].

    Returns
    -------
    mapping of str to float
        ``push`` [N], ``speed`` [m/s], ``react`` [s], ``resist`` [mm]: medians over the instants; ``carry`` [kg];
        ``resemblance_force``, ``resemblance_speed``. A task that a robot cannot do at all scores 0, or infinity where
        less is better.

    Raises
    ------
    InvalidInputError
        When shapes do not fit, or limits or masses of the robot are missing.
    """
    arm, positions = task.arm, as_finite(q, "q")
    require_shape(positions, "q", (len(task.time), arm.dof))
    simulated, own = task.simulated, positions[task.instants]
    errors = np.linalg.norm(arm.forward(positions)[:, :3, 3] - task.path, axis=1)
    middle, half = 0.5 * (arm.upper + arm.lower), 0.5 * (arm.upper - arm.lower)
    return {
        "push": float(np.median(push(simulated, own, task.force_directions))),
        "speed": float(np.median(fastest(arm, own, task.speed_directions))),
        "react": float(np.median(react(simulated, own, task.speed_directions))),
        "resist": float(np.median(resist(simulated, own, task.force_directions))),
        "carry": carry(simulated, task.time, positions),
        "resemblance_force": resemblance(line_extent(arm, own, half_sphere(), FORCE), task.person_force),
        "resemblance_speed": resemblance(line_extent(arm, own, half_sphere(), VELOCITY), task.person_speed),
        "position_error": 1e3 * float(errors.max()),
        "velocity_share": velocity_share(arm, task.time, positions),
        "position_share": float((np.abs(positions - middle) / half).max()),
    }


def is_valid(scores: Scores) -> bool:
    """Return whether a motion follows the path within the limits of its joints."""
    return (
        scores["position_error"] <= 1e3 * YIELD
        and scores["velocity_share"] <= 1.0 + 1e-9
        and scores["position_share"] <= 1.0 + 1e-9
    )


def push(simulated: SimulatedArm, q: Array, directions: Array) -> Array:
    """Push along lines until a motor saturates or the end effector yields; the weaker sense counts, (n,) [N].

    The force grows by that of the linear program in 0.4 s, at most by half of it more.
    """
    n, ramp, weaker = len(q), np.arange(0.0, 1.5, STEP / 0.4), np.full(len(q), np.inf)
    for u in (directions, -directions):
        largest = np.array([polytope_extent(simulated.arm, q[i], u[i : i + 1])[0, 0] for i in range(n)])
        forces = np.where(np.isfinite(largest), largest, 0.0)[:, None] * ramp
        torques, moved = simulated.pushed(q, -forces[..., None] * u[:, None])  # the reaction acts on the arm
        ended = np.any(np.abs(torques) >= 0.999 * simulated.limits, axis=2) | (np.linalg.norm(moved, axis=2) > YIELD)
        last = np.where(ended.any(axis=1), ended.argmax(axis=1), len(ramp) - 1)
        weaker = np.minimum(weaker, forces[np.arange(n), last])
    return weaker


def fastest(arm: Arm, q: Array, directions: Array) -> Array:
    """Largest speed along directions within the velocity limits, (n,) [m/s]."""
    return np.array([polytope_extent(arm, q[i], directions[i : i + 1], VELOCITY)[0, 0] for i in range(len(q))])


def resist(simulated: SimulatedArm, q: Array, directions: Array, impulse: float = 5.0, duration: float = 0.01) -> Array:
    """Hold configurations against an impulse [N s]; the larger peak displacement of both senses counts, (n,) [mm]."""
    forces, peaks = np.zeros((len(q), 300, 3)), np.zeros(len(q))
    for u in (directions, -directions):
        forces[:, : round(duration / STEP)] = impulse / duration * u[:, None]
        peaks = np.maximum(peaks, np.linalg.norm(simulated.pushed(q, forces)[1], axis=2).max(axis=1))
    return 1e3 * peaks


def react(simulated: SimulatedArm, q: Array, directions: Array, distance: float = 0.1, steps: int = 20) -> Array:
    """Move along a line from rest to rest within velocity, acceleration and torque limits; the slower sense, (n,) [s].

    The line is followed by the pseudoinverse with a minimum-jerk profile. In T times the time, velocities are 1 / T,
    and accelerations and torques without gravity 1 / T² times as large: the limits determine the shortest time.
    """
    arm, limits, slower = simulated.arm, MotionLimits.of(simulated.arm, joint_limit_margin=0.0), np.zeros(len(q))
    share = np.linspace(0.0, 1.0, steps + 1)  # of the line
    s = np.linspace(0.0, 1.0, 2 * steps + 1)  # of the time
    profile = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5
    first, second = 30.0 * (s * (1.0 - s)) ** 2, 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
    start = arm.forward(q)[:, :3, 3]
    for u in (directions, -directions):
        line, reached = [q], np.ones(len(q), dtype=bool)
        for part in share[1:]:
            moved, error = moved_to_positions(arm, line[-1], start + part * distance * u)
            line.append(moved)
            reached &= error < 1e-3
        path = CubicSpline(share, np.stack(line, axis=1), axis=1)
        at, slope, curvature = (path(profile, order) for order in range(3))
        motion = at, slope * first[:, None], curvature * first[:, None] ** 2 + slope * second[:, None]
        states = [values.reshape(-1, arm.dof) for values in motion]
        held = simulated.torques(states[0], 0.0 * states[1], 0.0 * states[2])
        moving = simulated.torques(*states) - held
        left = np.maximum(limits.effort - np.sign(moving) * held, 1e-9)
        squares = np.maximum(np.abs(moving) / left, np.abs(states[2]) / limits.acceleration)
        times = np.maximum(np.abs(states[1]) / limits.velocity, np.sqrt(squares)).reshape(len(q), -1).max(axis=1)
        slower = np.maximum(slower, np.where(reached, times, np.inf))
    return slower


def carry(simulated: SimulatedArm, time: Array, q: Array, per_waypoint: int = 4) -> float:
    """Compute the largest payload along the whole path [kg], a point mass at the end effector.

    Torques are linear in the payload, so that two evaluations determine it.
    """
    motion = CubicSpline(time, q)
    finer = np.interp(np.arange(per_waypoint * (len(time) - 1) + 1) / per_waypoint, np.arange(len(time)), time)
    states = [motion(finer, order) for order in range(3)]
    empty = simulated.torques(*states)
    per_mass = simulated.with_payload.torques(*states) - empty
    left = simulated.limits - np.sign(per_mass) * empty
    return max(0.0, float((left / np.maximum(np.abs(per_mass), 1e-9)).min()))


def velocity_share(arm: Arm, time: Array, q: Array) -> float:
    """Largest share of a velocity limit between waypoints (n, dof) at times (n,)."""
    assert arm.velocity_limits is not None
    return float((np.abs(np.diff(q, axis=0)) / np.diff(time)[:, None] / arm.velocity_limits).max())


def read_motion(path: str | os.PathLike[str], task: Task) -> Array:
    """Read a CSV file of joint positions, and interpolate them linearly at the times of a task.

    The first line has names: ``time_s`` and ``NAME_rad`` (or ``NAME_m``) for each joint of the robot, as in files that
    `maniport` writes; other columns are ignored.

    Returns
    -------
    ndarray, shape (n, dof)

    Raises
    ------
    FileFormatError
        When a column is missing, a value is no number, or the times do not cover those of the task.
    """
    head, *lines = read_whole(path, (".csv",), MOST_BYTES).decode("utf-8", "replace").splitlines() or [""]
    names, arm = [name.strip() for name in head.split(",")], task.arm
    wanted = ["time_s", *(f"{n}_{unit}" for n, unit in zip(arm.joint_names, arm.joint_units, strict=True))]
    if missing := [name for name in wanted if name not in names]:
        raise FileFormatError(f"{path}: missing columns: {', '.join(missing)}")
    try:
        table = np.array([[float(cell) for cell in line.split(",")] for line in lines if line.strip()])
        columns = as_finite(table, "values")[:, [names.index(name) for name in wanted]]
        time = as_times(columns[:, 0], "time_s", fewest=2)
        if time[0] > task.time[0] + 1e-6 or time[-1] < task.time[-1] - 1e-6:
            span = f"{task.time[0]:g} to {task.time[-1]:g} s"
            raise InvalidInputError(f"time_s must cover {span}; found {time[0]:g} to {time[-1]:g} s")
    except (ValueError, IndexError) as error:
        raise FileFormatError(f"{path}: {error}") from None
    return np.stack([np.interp(task.time, time, column) for column in columns[:, 1:].T], axis=1)
