"""Local minima, in which a controller stops because it descends from the present configuration.

A controller has stopped in a local minimum where it hardly moves, or a descent from its configuration reduces the
distance no further, and descents from a seed bank do.
"""

import numpy as np
from numpy.typing import NDArray

from maniport.motion.problem import ArmProblem
from maniport.motion.search import SeedBank, search_from_starts
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

EXCESS = 0.05  # distance by which a local minimum is larger than the least one: visible, and above rounding of searches
STOPPED = 0.01  # Largest joint velocity that counts as rest [rad/s or m/s]
MOST_ROWS = 16  # waypoints that are searched, evenly spread over the distant ones
STARTS = 48  # seed configurations for each of them


def local_minima(problem: ArmProblem, q: Array, random_state: int = 0) -> NDArray[np.bool_]:
    """Return at which of the configurations q (n, dof) of a motion, n ≥ 2, it is in a local minimum, shape (n,).

    Distant waypoints that are not searched have the result of the nearest one that is. With target positions or
    orientations nothing is searched: the distance then is mostly that of the pose.
    """
    flags = np.zeros(len(q), dtype=np.bool_)
    distance = problem.distance(q)
    distant = np.flatnonzero(distance > EXCESS)
    if problem.pose_costs or len(distant) == 0:
        return flags

    rows = distant[evenly_spaced(len(distant), MOST_ROWS)]
    searched = problem[rows]
    ends = searched.distance(search_from_starts(searched, q[rows][:, None]))
    bank = SeedBank(problem.arm, random_state=random_state, spec=problem.target.spec)
    starts = bank.starts_for(searched.target, STARTS)
    best = search_from_starts(searched, starts)
    changes = np.abs(np.diff(q, axis=0)).max(axis=1) / np.diff(problem.target.time)
    speeds = np.append(changes, changes[-1])
    has_stopped = (speeds[rows] < STOPPED) | (distance[rows] - ends < EXCESS)
    is_local = has_stopped & (distance[rows] - searched.distance(best) > EXCESS)

    places = np.abs(distant[:, None] - rows).argmin(axis=1)
    flags[distant] = is_local[places]
    return flags
