"""The best joint trajectory for a whole motion, computed before the arm moves.

Minimized is the mean over the times of d²(A + ε I, M(q) + ε I), or its weighted form in `maniport.tracking.objective`,
plus smoothness · (mean squared jerk), over cubic splines q(t) with a knot at each time. Limits of position, velocity
and acceleration are hard and hold between the times too; the tip is on the path at each time, or beside it by
`path_tolerance`, wherever the arm can have it there. CasADi's IPOPT solves it with exact derivatives; the solution is a
local one, near the start.
"""

from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.defaults import DAMPING
from maniport.optional import casadi
from maniport.steps import Part, Progress, Step, between, pieces
from maniport.tracking.arm_model import why_not_trackable
from maniport.tracking.follow.status import ENOUGH_METRES
from maniport.tracking.follow.track_result import TrackResult
from maniport.tracking.follow.tracker import track
from maniport.tracking.motion_limits import MotionLimits
from maniport.tracking.objective import Damping, Objective
from maniport.tracking.offline.trajectory_program import Program, Solution, solve
from maniport.tracking.plan.atlas import Atlas
from maniport.tracking.plan.planner import Planner
from maniport.tracking.schedule import Schedule, as_limits, require_rows, speed_limits
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array, as_count, as_number

SMOOTHNESS = 1e-4
JERK_SHARE = 0.1
"""What the jerk that the path itself demands may cost, in units of squared distance."""
STARTED = 0.4
"""The fraction done when the starts are there, where they have to be found."""
ON_PATH = 1e-4
"""How far beyond the tolerance the tip may be beside the path and still count as on it [m]."""
KEPT = 1e-6
"""How far beyond a limit counts as kept."""


@dataclass(frozen=True)
class OfflineControl:
    """How a motion is optimized as a whole; every value is checked at once.

    Attributes
    ----------
    path_tolerance : float
        How far the tip may be beside its path at no cost [m]. Recorded positions are noisy, and following the noise
        takes jerk.
    free_offset : bool
        Whether the whole path may be shifted to where it goes best.
    velocity_limits, acceleration_limits : array_like, shape (dof,) or one number, optional
        [rad/s], [rad/s²], or in metres. Default: the arm's own velocity limits, none of acceleration.
    smoothness : float, optional
        What the mean squared jerk counts for [s⁶/rad²]. Default: 1e-4, or less where the path is so jerky that its
        jerk alone would count for more than a squared distance of 0.1.
    rate : float
        Control steps a second of the result, at least; every time is one of them [Hz].
    tol, max_iter
        Of IPOPT.

    Raises
    ------
    InvalidInputError
        When a value is out of its range.

    See Also
    --------
    optimize_trajectory : takes its attributes as arguments.
    """

    path_tolerance: float = 0.0
    free_offset: bool = False
    velocity_limits: ArrayLike | None = None
    acceleration_limits: ArrayLike | None = None
    smoothness: float | None = None
    rate: float = 100.0
    tol: float = 1e-5
    max_iter: int = 200

    def __post_init__(self) -> None:
        as_number(self.path_tolerance, "path_tolerance", minimum=0.0)
        if self.smoothness is not None:
            as_number(self.smoothness, "smoothness", above=0.0)
        as_number(self.rate, "rate", above=0.0)
        as_number(self.tol, "tol", above=0.0)
        as_count(self.max_iter, "max_iter")

    def program(self, objective: Objective, asked: Schedule) -> Program:
        """What is asked for as a program."""
        return Program(
            objective=objective,
            schedule=asked,
            path_tolerance=self.path_tolerance,
            free_offset=bool(self.free_offset),
            speeds=speed_limits(objective.arm, self.velocity_limits),
            accelerations=as_limits(objective.arm, self.acceleration_limits, "acceleration_limits"),
            smoothness=_smoothness(asked) if self.smoothness is None else self.smoothness,
        )


@dataclass(frozen=True, repr=False)
class OfflineResult(TrackResult):
    """A `TrackResult` with how the solver ended.

    Attributes
    ----------
    solver_status : str
        How IPOPT ended, in words.
    converged : bool
    iterations : int
    offset : ndarray, shape (3,)
        What was added to the target positions [m]; `path` includes it. Zero unless it was free.
    violations : dict of str to float
        What does not hold, by how much at most: ``"path"`` [m], ``"joint limit"``, ``"velocity limit"`` and
        ``"acceleration limit"`` [rad or m, each second, each second squared]; empty where all holds.

    See Also
    --------
    optimize_trajectory : makes it.
    TrackResult : the other attributes.
    """

    solver_status: str = ""
    converged: bool = False
    iterations: int = 0
    offset: Array = field(default_factory=lambda: np.zeros(3))
    violations: dict[str, float] = field(default_factory=dict)


def optimize_trajectory(
    arm: Arm,
    profile: ArrayLike,
    time: ArrayLike,
    *,
    path: ArrayLike | None = None,
    start: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    weights: ArrayLike | None = None,
    bank: StartBank | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> OfflineResult:
    """Find the joint trajectory of a whole motion at once, whose velocity ellipsoids come nearest to the targets.

    What is minimized and how: `maniport.tracking.offline.offline`. Needs CasADi. A path or limits that cannot be kept
    are no error: the result comes as near to the path as the limits let it, and says where and by how much it does not
    hold.

    Parameters
    ----------
    arm : Arm
    profile : array_like, shape (n, d, d)
        Target velocity ellipsoids in the arm's base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Increasing [s].
    path : array_like, shape (n, 3), optional
        Target positions of the tip in the base frame [m].
    start : array_like, shape (n, dof), optional
        Joint positions at all times to begin the search from, within the limits, such as the tracker's. Default: two
        searches, from a plan (`maniport.tracking.plan_motion`) and from the tracker's, and the better of their results.
    spec, damping, bank, random_state, progress
        As in `maniport.tracking.track`; the solver does not know how many iterations it will take.
    weights : array_like, shape (n, m, m), optional
        How much each direction counts: rᵀ weights r instead of d² = rᵀr, with the Mandel vector
        r = vec(log(A^-½ M A^-½)), A the target; positive semidefinite, see `maniport.profiles.tracking_weights`.
    **control
        How: path_tolerance, free_offset, velocity_limits, acceleration_limits, smoothness, rate, tol, max_iter; see
        `OfflineControl`.

    Raises
    ------
    MissingPackageError
        When CasADi is not installed.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.
    InvalidInputError
        When another argument has a wrong shape or value.

    See Also
    --------
    OfflineResult : what comes out.
    plan_motion : quicker, and within limits of jerk.
    """
    casadi()  # before any work
    settings, objective = OfflineControl(**control), Objective.of(arm, spec, damping, positive=True)
    program = settings.program(objective, Schedule.checked(objective, profile, time, path, weights))
    q = None if start is None else arm.require_within_limits(start, "start")
    require_rows(len(program.schedule), start=(q, (arm.dof,)))
    step, begun = Step(progress, "optimize the motion"), STARTED if q is None else 0.0
    if q is None:
        bank = StartBank.given_or_built(bank, arm, spec, random_state)
        starts = _starts(program, bank, between(step, 0.0, STARTED))
    else:
        starts = [np.clip(q, arm.lower, arm.upper)]
    tells = pieces(between(step, begun, 1.0), *[1.0] * len(starts))
    solutions = [
        solve(program, one, settings.tol, settings.max_iter, None if progress is None else tell)
        for one, tell in zip(starts, tells, strict=True)
    ]
    result = _judged(program, min(solutions, key=lambda found: found.cost), settings.rate)
    step.end(f"{result.solver_status} after {result.iterations} iterations")
    return result


def _smoothness(asked: Schedule) -> float:
    """1e-4, or what makes the jerk of joints that the path demands count for 0.1."""
    if asked.positions is None or len(asked) < 4:
        return SMOOTHNESS
    jerk, at, profile = asked.positions, asked.time, asked.ellipsoids
    for _ in range(3):
        jerk, at = np.diff(jerk, axis=0) / np.diff(at)[:, None], 0.5 * (at[1:] + at[:-1])
    for_each_rad = float(np.mean(np.trace(profile, axis1=1, axis2=2))) / profile.shape[-1]  # metres, squared
    return float(min(SMOOTHNESS, JERK_SHARE * for_each_rad / max(np.mean(np.sum(jerk**2, axis=1)), 1e-300)))


def _starts(program: Program, bank: StartBank, tell: Part) -> list[Array]:
    """Joint positions at all times: those of a plan, and the tracker's."""
    arm, objective, asked = program.arm, program.objective, program.schedule
    limits = MotionLimits.of(arm, margin=0.0)
    generator = np.random.default_rng(0)
    planner = Planner(limits, Atlas(arm, objective.spec, random_state=generator), bank)
    near = max(program.path_tolerance, ON_PATH)
    starts = [planner.motion(asked.targets(objective), asked.time - asked.time[0], near, generator)]
    tell(0.1)
    if not why_not_trackable(arm, objective.spec):  # few or coupled joints, which the tracker cannot do and this can
        tracked = track(
            arm, asked.ellipsoids, time=asked.time, path=asked.positions, spec=objective.spec,
            damping=objective.damping, weights=asked.weights, bank=bank, velocity_limits=program.speeds,
            acceleration_limits=program.accelerations,
            progress=lambda step, fraction, found="": between(tell, 0.1, 1.0)(fraction),
        )  # fmt: skip
        starts.append(tracked.joint_positions)
    return starts


def _judged(program: Program, solution: Solution, rate: float) -> OfflineResult:
    """Sample the spline and compare it with what was asked."""
    arm, asked, spline = program.arm, program.schedule, solution.spline
    time = asked.time
    parts = [np.linspace(a, b, max(int(np.ceil((b - a) * rate - 1e-9)), 1), endpoint=False) for a, b in pairwise(time)]
    grid = np.concatenate([*parts, time[-1:]])
    path = None if asked.positions is None else asked.positions + solution.offset
    result = TrackResult.of_motion(
        arm, time, asked.ellipsoids, grid, spline(grid), spec=program.objective.spec,
        damping=program.objective.damping, path=path, velocity_limits=program.speeds,
        tip_tolerance=max(program.path_tolerance, ENOUGH_METRES),
    )  # fmt: skip
    over = {
        "joint limit": np.maximum(arm.lower - result.control_positions, result.control_positions - arm.upper),
        "velocity limit": np.abs(spline.derivative(1)(grid)) - program.speeds,
        "acceleration limit": np.abs(spline.derivative(2)(grid)) - program.accelerations,
    }
    violations = {name: float(value.max()) for name, value in over.items() if value.max() > KEPT}
    if result.position_error is not None and result.position_error.max() > program.path_tolerance + ON_PATH:
        violations["path"] = float(result.position_error.max())
    return OfflineResult(
        **{one.name: getattr(result, one.name) for one in fields(TrackResult)},
        solver_status=solution.status,
        converged=solution.converged,
        iterations=solution.iterations,
        offset=solution.offset,
        violations=violations,
    )
