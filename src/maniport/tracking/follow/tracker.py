"""An arm follows a profile of ellipsoids, and a hand path where there is one."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, make_interp_spline

from maniport.bodies import Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import geodesic
from maniport.spd.matrix_functions import apply, congruence, roots, symmetrize
from maniport.steps import Part, Progress, Step, pieces
from maniport.tracking.arm_model import require_trackable
from maniport.tracking.follow.follower import POSITION_COST, Follower, Schedule
from maniport.tracking.follow.starts import follow_from_best_start, follow_more_briskly, search_steps
from maniport.tracking.follow.track_result import TrackResult
from maniport.tracking.inputs import as_limits, require_rows, size_of
from maniport.tracking.search.start_bank import StartBank
from maniport.tracking.tasks.ellipsoid_task import ManipulabilityEllipsoidTask
from maniport.validation import Array, as_choice, as_finite, as_number, as_points, as_square, as_times

BANK_SIZE = 16_384
FLOOR_SAMPLES = 4096
RELATIVE_FLOOR = 0.01


def track(
    arm: Arm,
    profile: ArrayLike,
    *,
    time: ArrayLike,
    path: ArrayLike | None = None,
    start: ArrayLike | None = None,
    bank: StartBank | None = None,
    floor: float | None = None,
    part: str = "translation",
    joint_weights: ArrayLike | str | None = None,
    weights: ArrayLike | None = None,
    rate: float = 100.0,
    interpolation: str = "cubic",
    velocity_limits: ArrayLike | None = None,
    acceleration_limits: ArrayLike | None = None,
    gain: float = 1.0,
    lm_damping: float | None = None,
    position_cost: float = POSITION_COST,
    random_state: Any = 0,
    progress: Progress | None = None,
) -> TrackResult:
    """Move an arm so that its velocity ellipsoids follow wanted ones, and its hand a wanted path.

    A loop over control steps: in each, Pink's inverse kinematics weighs a `ManipulabilityEllipsoidTask`, a
    `PositionTask` and a weak pull to the starting posture, within limits of position, velocity and acceleration. The
    hand goes before the ellipsoid, as the costs have it. A profile or path that the arm cannot follow is no error: the
    result says where and by how much. Where a step has no answer, the arm is brought to rest and tries again.

    On one core of a shared 2-core machine the loop ran at 6 kHz for the Panda with path and limits, BLAS restricted to
    one thread while it runs (by threadpoolctl); the search for a start took about two seconds for six seconds of
    motion.

    Parameters
    ----------
    arm : Arm
        With at least three joints, and a joint for each degree of freedom.
    profile : array_like, shape (n, d, d)
        Wanted velocity ellipsoids in the arm's base frame, without floor, n ≥ 2.
    time : array_like, shape (n,)
        Increasing [s].
    path : array_like, shape (n, 3), optional
        Wanted hand positions in the base frame [m].
    start : array_like, shape (dof,), optional
        First configuration. Default: the best of several, found as `maniport.tracking.follow.starts` says.
    bank : StartBank, optional
        To find the start with, made for this arm and these options. Default: one of 16 384 samples (0.1 s).
    floor : float, optional
        Added to the eigenvalues of all ellipsoids before they are compared [unit of M]; positive, since an arm passes
        singular configurations. Default: a hundredth of the arm's mean eigenvalue, over 4096 samples.
    part, joint_weights
        Which ellipsoids, as in `Arm.manipulability`.
    weights : array_like, shape (n, m, m), optional
        How much each direction of the ellipsoids counts, see `ManipulabilityEllipsoidTask`; m = d (d + 1) / 2.
    rate : float
        Control steps a second, at least one for each time [Hz].
    interpolation : {"cubic", "linear"}
        Between the times, splines (of logarithms for ellipsoids), or geodesics and straight lines, which make the arm
        jerk at each time.
    velocity_limits, acceleration_limits : array_like, shape (dof,) or one number, optional
        [rad/s], [rad/s²], or in metres. Default: the arm's own velocity limits where it knows them (the result's
        summary names the joints that have none), and no limits of acceleration.
    gain : float
        Of the ellipsoid task.
    lm_damping : float, optional
        Of the ellipsoid task. Default: 10, and also 3, of which the one that comes clearly nearer is kept.
    position_cost : float
        What a metre beside the path counts for, in units of distance between ellipsoids.
    random_state : None, int or numpy.random.Generator
        Seed of the bank.
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Returns
    -------
    TrackResult

    Raises
    ------
    InvalidInputError
        When an argument has a wrong shape or value, the start lies outside the limits, the arm has fewer than three
        joints or coupled ones, or the bank was made for another arm.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.
    """
    meant = arm.resolved(EllipsoidSpec(part=part, joint_weights=joint_weights))
    options: dict[str, Any] = {"part": part, "joint_weights": meant.joint_weights}
    d = size_of(part)
    require_trackable(arm, d)
    times = as_times(time, fewest=2)
    lift = default_floor(arm, options) if floor is None else as_number(floor, "floor", above=0.0)
    wanted = as_square(profile, "profile", d)
    raised = as_points(wanted + lift * np.eye(d), "profile plus floor", d)
    hands = None if path is None else as_finite(path, "path")
    metric = None if weights is None else as_finite(weights, "weights")
    m = d * (d + 1) // 2
    require_rows(len(times), profile=(wanted, (d, d)), path=(hands, (3,)), weights=(metric, (m, m)))
    damping: dict[str, Any] = {} if lm_damping is None else {"lm_damping": lm_damping}
    task = ManipulabilityEllipsoidTask(arm.frame, gain=gain, floor=lift, **damping, **options)
    for matrix in [] if metric is None else metric:
        task.set_weights(matrix)  # looks at each before anything moves
    speeds = as_limits(arm, arm.velocity_limits if velocity_limits is None else velocity_limits, "velocity_limits")
    accelerations = as_limits(arm, acceleration_limits, "acceleration_limits")
    follower = Follower(arm, task, speeds, accelerations, as_number(position_cost, "position_cost", above=0.0))
    as_choice(interpolation, "interpolation", ("cubic", "linear"))
    schedule = _schedule(times, raised, lift, hands, metric, as_number(rate, "rate", above=0.0), interpolation)
    begin = None if start is None else _as_start(arm, start)
    step = Step(progress, "move the robot")
    first, again = _shares(schedule, step, begin is None, lm_damping is None)
    if begin is None:
        bank = StartBank.build(arm, BANK_SIZE, random_state, **options) if bank is None else bank
        bank.require_fits(arm, kind="velocity", **options)
        followed = follow_from_best_start(follower, bank, schedule, lift, first)
    else:
        followed = follower.follow(begin, schedule, first)
    joints, held = follow_more_briskly(follower, followed, schedule, lift, again) if lm_damping is None else followed
    result = TrackResult.of_motion(
        arm, times, wanted, schedule.time, joints, floor=lift, path=hands, velocity_limits=speeds, held=held, **options
    )
    step.end(_in_words(result))
    return result


def _as_start(arm: Arm, start: ArrayLike) -> Array:
    q = arm.require_within_limits(start, "start")
    if q.ndim != 1:
        raise InvalidInputError(f"start must be one configuration, shape ({arm.dof},); found shape {q.shape}")
    return np.clip(q, arm.lower, arm.upper)


def _shares(schedule: Schedule, step: Part, searches: bool, follows_again: bool) -> tuple[Part, Part]:
    """Whom to tell about the first motion, with the search for its start, and about the brisker one."""
    steps = len(schedule.time)
    first, again = pieces(step, steps + searches * search_steps(schedule), follows_again * steps)
    return first, again


def _in_words(result: TrackResult) -> str:
    """How near the arm came."""
    found = f"distance of the ellipsoids {np.median(result.distance):.2f} (median)"
    if result.position_error is not None:
        found += f", hand {1e3 * np.percentile(result.position_error, 95):.2f} mm beside its path (95 %)"
    return found


def _schedule(
    time: Array, raised: Array, floor: float, hands: Array | None, weights: Array | None, rate: float, kind: str
) -> Schedule:
    """What is wanted at evenly spaced times."""
    steps = max(int(np.ceil((time[-1] - time[0]) * rate - 1e-9)), len(time) - 1)
    grid = np.linspace(time[0], time[-1], steps + 1)

    def between(values: Array, smooth: bool) -> Array:
        spline = CubicSpline(time, values) if smooth else make_interp_spline(time, values, k=1)
        return np.asarray(spline(grid))

    if kind == "cubic":
        # In logarithms about the middle of the profile, where straight lines are geodesics nearly.
        root, whitening = roots(apply(apply(raised, np.log).mean(axis=0), np.exp))
        logs = apply(congruence(whitening, raised), np.log)
        wanted = congruence(root, apply(symmetrize(between(logs, True)), np.exp))
    else:
        before = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, len(time) - 2)
        share = (grid - time[before]) / (time[before + 1] - time[before])
        wanted = geodesic(raised[before], raised[before + 1], share)
    return Schedule(
        grid,
        symmetrize(wanted) - floor * np.eye(raised.shape[-1]),
        None if hands is None else between(hands, kind == "cubic"),
        None if weights is None else between(weights, False),  # a spline might leave the semi-definite ones
    )


def default_floor(arm: Arm, options: dict[str, Any]) -> float:
    """Return a hundredth of the mean eigenvalue of an arm's ellipsoids, over 4096 samples [unit of M]."""
    mean = arm.manipulability(arm.sample(FLOOR_SAMPLES, 0), **options).mean(axis=0)
    return float(RELATIVE_FLOOR * np.trace(mean) / len(mean))
