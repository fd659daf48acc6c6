"""How fast one step of the tracker is and how evenly it comes; derivatives of ellipsoids; collisions; the gap."""

import time as clock
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from maniport.arms import Arm
from maniport.arms.collisions import Collisions
from maniport.motion import BrakingLimit, Controller, ControlProblem, ControlState, Objective, nearest_feasible
from maniport.motion.objective import FOLLOWING_WEIGHT
from maniport.motion.schedule import Schedule, speed_limits
from maniport.motion.tracker import follow
from maniport.spd.regularization import Regularization
from maniport.studies.paper.trajectories import robot_arm

from .inputs import Array
from .measure import Row, duration, within
from .tracking_runs import Outcome

CONTROL_RATE, ASKED_RATE = 1000.0, 5000.0  # Hz
PERIOD = 1.0 / CONTROL_RATE
PERCENTILE = 99.9
PASSES = 5
GAP_RATE, DERIVATIVE = 200.0, 6e-6
"""Ellipsoids a second, and seconds each, that are asked for."""
FREE, COLLIDING = 2e-6, 30e-6
"""Seconds for each posture that are asked for."""


class ClockedController(Controller):
    """Records the beginning of each control step, by wall clock and by processor time."""

    def __init__(self, robot: Arm):
        infinite = np.full(robot.dof, np.inf)
        super().__init__(robot, BrakingLimit(robot.lower, robot.upper, speed_limits(robot, None), infinite))
        self.began: list[tuple[float, float]] = []

    def step(self, problem: ControlProblem, state: ControlState, dt: float, speed_share: float = 1.0) -> ControlState:
        """As a controller does."""
        self.began.append((clock.perf_counter(), clock.thread_time()))
        return super().step(problem, state, dt, speed_share)


def rows(outcome: Outcome, adapted: Array, quick: bool) -> Iterator[Row]:
    """Speed of control along one motion with path and limits, of derivatives, and of the gap of adapted ellipsoids."""
    passes = _steps(outcome, 1 if quick else PASSES)
    wall, busy = ([one[:, i] for one in passes] for i in (0, 1))
    rates = [1.0 / float(one.mean()) for one in wall]
    yield Row(
        "control loop: ellipsoid, position, posture and limits of 7 joints",
        f"{max(rates):,.0f} Hz",
        "",
        f"{max(rates):,.0f} Hz",
        f"≥ {ASKED_RATE:,.0f} Hz",
        max(rates) >= ASKED_RATE,
        f"one Python thread; the quickest of {len(wall)} passes of {len(wall[0]):,} steps, the slowest "
        f"{min(rates):,.0f} Hz",
    )
    spread = [float(np.percentile(one, PERCENTILE)) for one in wall]
    calm = int(np.argmin(spread))
    yield within(
        f"control loop: time of a step, {PERCENTILE} %",
        spread[calm],
        PERIOD,
        duration,
        f"of the calmest pass, for other work on the machine disturbs: {duration(max(spread))} in the worst; by the "
        f"time that the processor worked on it {duration(min(float(np.percentile(one, PERCENTILE)) for one in busy))}; "
        f"longest step {duration(float(wall[calm].max()))}",
    )
    yield _derivatives(10_000 if quick else 100_000)
    yield from _collisions(8192 if quick else 65_536)
    yield _gap(adapted[: 100 if quick else 600], outcome.tracked.damping)


def _steps(outcome: Outcome, passes: int) -> list[Array]:
    """Durations of the control steps (m, 2) in each of several passes along a motion, by both clocks [s]."""
    robot, placed, result = robot_arm(), outcome.placed, outcome.tracked
    time = result.time
    grid = np.arange(time[0], time[-1], PERIOD)
    schedule = Schedule(
        Objective(robot, result.spec, result.damping, FOLLOWING_WEIGHT),
        grid,
        make_interp_spline(time, placed.profile, k=1)(grid),
        make_interp_spline(time, placed.path, k=1)(grid),
    )
    durations = []
    for _ in range(1 + passes):
        controller = ClockedController(robot)
        follow(controller, result.joint_positions[0], [schedule])
        durations.append(np.diff(controller.began, axis=0))
    return durations[1:]  # the first pass compiles and fills caches


def _derivatives(count: int) -> Row:
    robot = robot_arm()
    best = _each(robot.manipulability_jacobian, robot.sample(count, 0))
    return within(f"derivatives of ellipsoids in 7 joints, batch of {count:,}: each", best, DERIVATIVE, duration)


def _collisions(count: int) -> Iterator[Row]:
    robot = robot_arm()
    collisions, q = Collisions.of(robot), robot.sample(count, 0)
    hit = collisions.collides(q)
    note = f"{len(collisions.pairs)} pairs of links; {hit.mean():.1%} of {count:,} postures collide"
    for kind, postures, most in (("free", q[~hit], FREE), ("colliding", q[hit], COLLIDING)):
        yield within(
            f"collisions of 7 joints with themselves: each {kind} posture",
            _each(collisions.collides, postures),
            most,
            duration,
            note,
        )


def _each(work: Callable[[Array], Any], joints: Array) -> float:
    """Seconds for each configuration of a batch, in the quickest of five passes."""
    work(joints[:100])
    best = np.inf
    for _ in range(5):
        begin = clock.perf_counter()
        work(joints)
        best = min(best, (clock.perf_counter() - begin) / len(joints))
    return best


def _gap(ellipsoids: Array, damping: Regularization) -> Row:
    robot = robot_arm()
    nearest_feasible(robot, ellipsoids[:8], damping=damping)
    begin = clock.perf_counter()
    nearest_feasible(robot, ellipsoids, damping=damping)
    rate = len(ellipsoids) / (clock.perf_counter() - begin)
    return Row(
        "feasibility gap, Panda: smallest distance to what the arm can make",
        f"{rate:.0f} /s",
        "",
        f"{rate:.0f} /s",
        f"≥ {GAP_RATE:.0f} /s",
        rate >= GAP_RATE,
        f"{len(ellipsoids)} adapted ellipsoids of the human arm, 48 starts each, the bank included, one process",
    )
