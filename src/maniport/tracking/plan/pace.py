"""The time of a motion that was planned in slow time, of one arm or of several together."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maniport.tracking.motion_limits import MotionLimits
from maniport.tracking.plan.giving_way import given_way
from maniport.tracking.plan.refinement import (
    ENOUGH,
    Asked,
    KeptApart,
    PosturesOnPaths,
    Smoothness,
    durations_of,
    refine,
)
from maniport.tracking.plan.retiming import Timed, retime
from maniport.validation import Array

QUICK = Smoothness(3e-3, 1e-6)
"""Of motions that have got their time."""
SHARE_OF_SPEED = 0.9
WEIGHTS = (30.0, 50.0, 100.0, 200.0, 400.0, 1000.0)
"""What a metre beside the path counts for, in turn, until the tip is as near as it shall be [1/m]."""
CAUTION = 0.7
"""Of the weight that should be enough so much is tried next."""
STILLER = (0.1, 0.01)
"""Shares of the smoothness that are tried, when the last weight does not bring the tip near enough."""
PERCENT = 95.0


@dataclass(frozen=True)
class Paced:
    """A motion that has its time.

    Attributes
    ----------
    q : ndarray, shape (n, dof)
        At the points.
    timed : Timed
        How it passes them.
    """

    q: Array
    timed: Timed


def paced(
    limits: MotionLimits,
    collisions: KeptApart | None,
    targets: PosturesOnPaths,
    time: Array,
    q: Array,
    tolerance: float,
    rate: float,
    fineness: float = 1.0,
    enough: float = ENOUGH,
    gives_way: bool = True,
) -> Paced:
    """Find the time of a motion, smooth it where that makes it quick and no more than that, and time it again."""
    at = retime(limits, time, q, rate=rate, fineness=fineness).at
    near = near_enough(targets, at, q, in_time(limits, collisions, time, at, enough), tolerance)
    found = Paced(near.q, retime(limits, time, near.q, rate=rate, fineness=fineness))
    q = given_way(targets, at, near.q, near.asked, near.weight, tolerance) if gives_way else near.q
    if q is near.q:
        return found
    other = Paced(q, retime(limits, time, q, rate=rate, fineness=fineness))
    return found if touching(collisions, other.timed) > touching(collisions, found.timed) else other


def in_time(
    limits: MotionLimits, collisions: KeptApart | None, time: Array, at: Array, enough: float = ENOUGH
) -> Asked:
    """What is asked of a motion that passes its points at `at` (n,), the person at `time` (n,) [s]."""
    return Asked(
        QUICK,
        durations_of(time) * (at[-1] - at[0]) / (time[-1] - time[0]),
        SHARE_OF_SPEED * limits.velocity,
        SHARE_OF_SPEED * limits.acceleration,
        collisions,
        enough,
    )


def touching(collisions: KeptApart | None, timed: Timed) -> float:
    """Share of the samples at which something collides."""
    return 0.0 if collisions is None else float(collisions.collides(timed.positions).mean())


class Near(NamedTuple):
    """A motion whose tip is as near to its path as it shall be, or as it can be, by what was asked and the weight."""

    q: Array
    asked: Asked
    weight: float


def near_enough(targets: PosturesOnPaths, time: Array, q: Array, asked: Asked, tolerance: float) -> Near:
    """Refine a motion with ever more weight on its path, until the tip is near enough."""
    tries = [(weight, 1.0) for weight in WEIGHTS] + [(WEIGHTS[-1], share) for share in STILLER]
    needed = 0.0
    for weight, share in tries:
        if weight < min(needed, WEIGHTS[-1]):
            continue
        less = replace(asked, smoothness=asked.smoothness.times(share))
        q = refine(targets, time, q, less, (weight,))
        error = targets.tip_error(q)
        if error is None or (far := float(np.percentile(error, PERCENT, axis=0).max())) <= tolerance:
            break
        needed = CAUTION * weight * np.sqrt(far / tolerance)  # what pulls beside the path pulls by 1 / weight²
    return Near(q, less, weight)
