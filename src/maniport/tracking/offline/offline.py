"""The best joint trajectory for a whole motion, computed before the arm moves."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm, EllipsoidSpec
from maniport.optional import casadi
from maniport.spd.matrix_functions import roots
from maniport.steps import Part, Progress, Step, between, pieces
from maniport.tracking.arm_model import why_not_trackable
from maniport.tracking.follow.tracker import default_floor, track
from maniport.tracking.inputs import as_limits, require_rows, size_of
from maniport.tracking.offline.offline_result import OfflineResult, judged
from maniport.tracking.offline.trajectory_program import Program, solve
from maniport.tracking.search.descent import Target
from maniport.tracking.search.feasible import BANK_SIZE, POSITION_WEIGHT
from maniport.tracking.search.postures import postures_along
from maniport.tracking.search.start_bank import StartBank, semidefinite
from maniport.validation import (
    Array,
    as_count,
    as_finite,
    as_number,
    as_points,
    as_positive_semidefinite,
    as_square,
    as_times,
)

SMOOTHNESS = 1e-4
JERK_SHARE = 0.1
"""What the jerk that the path itself demands may cost, in units of squared distance."""
STARTS = 32
STARTED = 0.4
"""The fraction done when the starts are there, where they have to be found."""


def optimize_trajectory(
    arm: Arm,
    profile: ArrayLike,
    time: ArrayLike,
    *,
    path: ArrayLike | None = None,
    path_tolerance: float = 0.0,
    free_offset: bool = False,
    start: ArrayLike | None = None,
    bank: StartBank | None = None,
    floor: float | None = None,
    part: str = "translation",
    joint_weights: ArrayLike | str | None = None,
    weights: ArrayLike | None = None,
    velocity_limits: ArrayLike | None = None,
    acceleration_limits: ArrayLike | None = None,
    smoothness: float | None = None,
    rate: float = 100.0,
    tol: float = 1e-5,
    max_iter: int = 200,
    random_state: Any = 0,
    progress: Progress | None = None,
) -> OfflineResult:
    """Find the joint trajectory of a whole motion at once, whose velocity ellipsoids come nearest to the wanted ones.

    Minimizes the mean over the times of d²(wanted + floor I, M(q) + floor I), plus smoothness · (mean squared jerk),
    over cubic splines q(t) with a knot at each time. Limits of position, velocity and acceleration are hard and hold
    between the times too; the hand is on the path at each time, or beside it by `path_tolerance`, wherever the arm can
    have it there. Needs CasADi, whose IPOPT solves it with exact derivatives; the solution is a local one, near the
    start.

    A path or limits that cannot be kept are no error: the result comes as near to the path as the limits let it, and
    says where and by how much it does not hold.

    Parameters
    ----------
    arm : Arm
    profile : array_like, shape (n, d, d)
        Wanted velocity ellipsoids in the arm's base frame, without floor, n ≥ 2.
    time : array_like, shape (n,)
        Increasing [s].
    path : array_like, shape (n, 3), optional
        Wanted hand positions in the base frame [m].
    path_tolerance : float
        How far the hand may be beside them at no cost [m]. Recorded positions are noisy, and following the noise
        takes jerk.
    free_offset : bool
        Whether the whole path may be shifted to where it goes best.
    start : array_like, shape (n, dof), optional
        Joint positions at all times to begin the search from, within the limits, such as the tracker's. Default: two
        searches, from the tracker's and from those found by moving along from the bank's samples, and the better of
        their results.
    bank : StartBank, optional
        For that; made for this arm and these options. Default: one of 16 384 samples.
    floor : float, optional
        Added to the eigenvalues of all ellipsoids before they are compared [unit of M]; positive. Default: as in
        `maniport.tracking.track`.
    part, joint_weights
        Which ellipsoids, as in `Arm.manipulability`.
    weights : array_like, shape (n, m, m), optional
        How much each direction counts: rᵀ weights r instead of d² = rᵀr, with the Mandel vector
        r = vec(log(A^-½ M A^-½)), A wanted; positive semidefinite, see `maniport.profiles.tracking_weights`.
    velocity_limits, acceleration_limits : array_like, shape (dof,) or one number, optional
        [rad/s], [rad/s²], or in metres. Default: the arm's own velocity limits, none of acceleration.
    smoothness : float, optional
        What the mean squared jerk counts for [s⁶/rad²]. Default: 1e-4, or less where the path is so jerky that its
        jerk alone would count for more than a squared distance of 0.1.
    rate : float
        Control steps a second of the result, at least; every time is one of them [Hz].
    tol, max_iter
        Of IPOPT.
    random_state : None, int or numpy.random.Generator
        Seed of the bank.
    progress : callable, optional
        Called with the name of a step and the fraction done; the solver does not know how many iterations it will
        take.

    Returns
    -------
    OfflineResult

    Raises
    ------
    MissingPackageError
        When CasADi is not installed.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.
    InvalidInputError
        When another argument has a wrong shape or value.
    """
    casadi()  # before any work
    d = size_of(part)
    meant = arm.resolved(EllipsoidSpec(part=part, joint_weights=joint_weights))
    options: dict[str, Any] = {"part": part, "joint_weights": meant.joint_weights}
    times = as_times(time, fewest=2)
    lift = default_floor(arm, options) if floor is None else as_number(floor, "floor", above=0.0)
    wanted = as_square(profile, "profile", d)
    raised = as_points(wanted + lift * np.eye(d), "profile plus floor", d)
    m = d * (d + 1) // 2
    hands = None if path is None else as_finite(path, "path")
    metric = None if weights is None else as_positive_semidefinite(weights, "weights", m)
    q = None if start is None else arm.require_within_limits(start, "start")
    require_rows(
        len(times), profile=(wanted, (d, d)), path=(hands, (3,)), weights=(metric, (m, m)), start=(q, (arm.dof,))
    )
    program = Program(
        arm=arm,
        floor=lift,
        time=times,
        whitening=roots(raised)[1],
        weights=metric,
        path=hands,
        path_tolerance=as_number(path_tolerance, "path_tolerance", minimum=0.0),
        free_offset=bool(free_offset),
        speeds=as_limits(arm, arm.velocity_limits if velocity_limits is None else velocity_limits, "velocity_limits"),
        accelerations=as_limits(arm, acceleration_limits, "acceleration_limits"),
        smoothness=_smoothness(times, hands, wanted)
        if smoothness is None
        else as_number(smoothness, "smoothness", above=0.0),
        **options,
    )
    tolerance, iterations = as_number(tol, "tol", above=0.0), as_count(max_iter, "max_iter")
    frequency = as_number(rate, "rate", above=0.0)
    step, begun = Step(progress, "optimize the motion"), STARTED if q is None else 0.0
    if q is None:
        bank = StartBank.build(arm, BANK_SIZE, random_state, **options) if bank is None else bank
        bank.require_fits(arm, **options)
        starts = _starts(program, wanted, bank, between(step, 0.0, STARTED))
    else:
        starts = [np.clip(q, arm.lower, arm.upper)]
    tells = pieces(between(step, begun, 1.0), *[1.0] * len(starts))
    solutions = [
        solve(program, one, tolerance, iterations, None if progress is None else tell)
        for one, tell in zip(starts, tells, strict=True)
    ]
    result = judged(program, wanted, min(solutions, key=lambda found: found.cost), frequency)
    step.end(f"{result.solver_status} after {result.iterations} iterations")
    return result


def _smoothness(time: Array, path: Array | None, profile: Array) -> float:
    """1e-4, or what makes the jerk of joints that the path demands count for 0.1."""
    if path is None or len(time) < 4:
        return SMOOTHNESS
    jerk, at = path, time
    for _ in range(3):
        jerk, at = np.diff(jerk, axis=0) / np.diff(at)[:, None], 0.5 * (at[1:] + at[:-1])
    for_each_rad = float(np.mean(np.trace(profile, axis1=1, axis2=2))) / profile.shape[-1]  # metres, squared
    return float(min(SMOOTHNESS, JERK_SHARE * for_each_rad / max(np.mean(np.sum(jerk**2, axis=1)), 1e-300)))


def _starts(program: Program, profile: Array, bank: StartBank, tell: Part) -> list[Array]:
    """Joint positions at all times: those that follow one another from the bank's best start, and the tracker's."""
    arm, options = program.arm, {"part": program.part, "joint_weights": program.joint_weights}
    target = Target(arm, options, False, program.floor, program.whitening, program.path, POSITION_WEIGHT)
    hand = None if program.path is None else program.path[:1]
    starts = [postures_along(target, bank.query(semidefinite(profile[:1]), hand, STARTS))[0][0]]
    tell(0.1)
    if not why_not_trackable(arm, profile.shape[-1]):  # few or coupled joints, which the tracker cannot do and this can
        tracked = track(
            arm, profile, time=program.time, path=program.path, bank=bank, floor=program.floor,
            weights=program.weights, velocity_limits=program.speeds, acceleration_limits=program.accelerations,
            part=program.part, joint_weights=program.joint_weights,
            progress=lambda step, fraction, found="": between(tell, 0.1, 1.0)(fraction),
        )  # fmt: skip
        starts.append(tracked.joint_positions)
    return starts
