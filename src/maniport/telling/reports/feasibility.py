"""How far what is wanted is from what the robot can make at all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from maniport.errors import ManiportError
from maniport.telling.page import Fact, Line
from maniport.tracking import feasibility_gap
from maniport.tracking.objective import DAMPING
from maniport.validation import Array

if TYPE_CHECKING:
    from maniport.pipeline.result import TransferResult

NAME = "Feasibility gap"
MEANING = (
    "From what is wanted to the nearest ellipsoid that was found for the robot anywhere within its joint limits. The "
    "search may miss a nearer one, so it is an upper bound; between at most 250 points it is drawn as a line."
)
FOLLOWED = 0.1
"""A smaller distance counts as followed; see `maniport.tracking.follow.track_status`."""


def gap_of_transfer(result: TransferResult) -> Array:
    """Feasibility gap at each time, shape (n,); nan where it cannot be searched for."""
    if result.execution is not None:
        return result.execution.gap
    # as for a motion: inverses are as far from one another, and a damping of forces is none of velocities
    force, own = result.spec.kind == "force", result.adapter.student_regularization
    wanted = np.asarray(np.linalg.inv(result.target_profile)) if force else result.target_profile
    damping = own if own.epsilon > 0.0 and not force else DAMPING
    try:
        return feasibility_gap(result.robot, wanted, damping=damping, spec=result.spec.velocity)
    except ManiportError:  # ellipsoids that are always flat: the report shows what else there is
        return np.full(len(wanted), np.nan)


def gap_facts(gap: Array) -> tuple[Fact, ...]:
    """Tell the gap in one line."""
    if np.isnan(gap).any():
        return ()
    value = f"{np.median(gap):.2f} (median), {np.percentile(gap, 95):.2f} (95 %)"
    return (Fact(NAME, value, MEANING),)


def gap_lines(gap: Array) -> tuple[Line, ...]:
    """The gap over time, where it is known."""
    return () if np.isnan(gap).any() else (Line(NAME.lower(), gap, "wanted", 2),)


def gap_warnings(gap: Array) -> Sequence[str]:
    """Say when most of what is wanted cannot be made."""
    median = float(np.median(gap))
    if not median > FOLLOWED:
        return ()
    return (
        f"{NAME}: nothing nearer to what is wanted than a distance of {median:.2f} (median) was found for the robot.",
    )
