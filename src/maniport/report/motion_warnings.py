"""Warnings about a robot's motion, with their thresholds."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.errors import argument
from maniport.motion import ArmMotion
from maniport.motion.plan.refinement import FAR
from maniport.motion.status import NEAR_DISTANCE, REACHED, VELOCITY_LIMIT
from maniport.motion.trajectory import Clearance
from maniport.pipeline.results import ArmResult
from maniport.report.metrics import listed, warns
from maniport.report.values import RED, at_time
from maniport.util.validation import Array


@dataclass(frozen=True)
class Run:
    """A motion, the times of its waypoints in the report [s], and the result that it belongs to."""

    motion: ArmMotion
    time: Array
    result: ArmResult | None = None

    @property
    def plan(self) -> ArmMotion | None:
        """The motion, if it was planned."""
        return None if self.motion.limits is None else self.motion

    def at(self, time: float) -> float:
        """Return the reported time at a time of the robot [s]."""
        return float(np.interp(time, self.motion.time, self.time))


def missed_points(motion: ArmMotion) -> int:
    """Count the waypoints that are neither followed nor nearly followed."""
    return sum(status not in REACHED for status in motion.status)


def far_points(motion: ArmMotion) -> NDArray[np.bool_]:
    """Return at which waypoints the position error is more than `FAR` times the tolerance."""
    error = np.zeros(len(motion.time)) if motion.position_error is None else motion.position_error
    return np.asarray(error > FAR * motion.position_tolerance)


def exceeded_limits(plan: ArmMotion, excess: float = 1e-3) -> dict[str, tuple[str, float]]:
    """Return the limits that are exceeded by a relative excess: joint, and the value as a multiple of the limit."""
    used = {} if plan.limits is None else plan.limits.use(plan.control_time, plan.control_positions).largest
    return {name: (joint, share) for name, (joint, share, _) in used.items() if share > 1.0 + excess}


@warns("targets-missed")
def _targets_missed(run: Run) -> Iterator[str]:
    missed, total = missed_points(run.motion), len(run.motion.time)
    if 2 * missed > total:
        count = Counter(status for status in run.motion.status if status not in REACHED)
        reasons = listed([f"{number} {status}" for status, number in count.items()])
        yield f"{missed} of {total} waypoints are missed: {reasons}"


@warns("too-fast")
def _too_fast(run: Run) -> Iterator[str]:
    if VELOCITY_LIMIT in run.motion.status and run.plan is None:
        yield "the motion is too fast for the robot in places: give it more time"


@warns("position-error")
def _position(run: Run) -> Iterator[str]:
    motion = run.motion
    if motion.position_error is not None and far_points(motion).any():
        worst = int(np.argmax(motion.position_error))
        error, tolerance = 1e3 * motion.position_error[worst], 1e3 * motion.position_tolerance
        place = at_time(run.time[worst])
        yield f"the position error is up to {error:.1f} mm ({place}); the tolerance is {tolerance:g} mm"


@warns("longest-axis")
def _longest_axis(run: Run, threshold: float = 30.0) -> Iterator[str]:
    angle = np.degrees(run.motion.major_axis_angle)
    median = float(np.nanmedian(angle)) if np.isfinite(angle).any() else 0.0
    if median > threshold:
        yield f"the longest axis of the ellipsoid is {median:.0f}° (median) from that of the target"


@warns("held", RED)
def _held(run: Run) -> Iterator[str]:
    if run.motion.held.any():
        yield f"the solver failed at {run.motion.held.sum()} control steps, where the robot was held"


@warns("unchecked-velocity-limits")
def _velocity_limits(run: Run) -> Iterator[str]:
    pairs = zip(run.motion.joint_names, run.motion.velocity_limits, strict=True)
    if free := [name for name, limit in pairs if np.isinf(limit)]:
        yield f"no velocity limit is available for {listed(free)}"


@warns("limits-exceeded", RED)
def _exceeded(run: Run) -> Iterator[str]:
    if run.plan is not None and (broken := exceeded_limits(run.plan)):
        texts = [f"{joint} at {share:.2f} times its {name}" for name, (joint, share) in broken.items()]
        yield f"the motion exceeds limits of the robot: {listed(texts)}"


@warns("below-base-plane")
def _below(run: Run) -> Iterator[str]:
    lowest = None if run.result is None else run.result.lowest
    table = None if run.result is None or run.result.collisions is None else run.result.collisions.table
    if lowest is not None and lowest.height < 0.0 and table is None:
        place = f"{-1e3 * lowest.height:.0f} mm below the base plane ({at_time(run.at(lowest.time))})"
        yield f"{lowest.link} is up to {place}. {argument('table', 0)} keeps the robot above it"


@warns("unchecked-floor")
def _unchecked_floor(run: Run) -> Iterator[str]:
    if run.result is not None and run.result.lowest is None:
        yield "the height above the base plane is unknown: no link has a shape"


@warns("infeasible-targets")
def _infeasible(run: Run) -> Iterator[str]:
    if run.result is not None and run.result.gap is not None:
        yield from infeasible_targets(float(np.median(run.result.gap)))


def infeasible_targets(median: float) -> Iterator[str]:
    """Warn where most targets are far from the feasible set."""
    if median > NEAR_DISTANCE:
        yield f"the targets are infeasible: median distance to the feasible set {median:.2f}"


@warns("collision", RED)
def _collision(run: Run) -> Iterator[str]:
    return iter(()) if run.plan is None else collision_texts(run.plan.clearance, run.at(run.plan.clearance.time))


def collision_texts(clearance: Clearance, at: float) -> Iterator[str]:
    """Warn of a collision; `at`: time of the smallest clearance [s]."""
    if clearance.known and clearance.share:
        yield f"the robot collides in {clearance.share:.1%} of the time: {' and '.join(clearance.pair)} {at_time(at)}"
