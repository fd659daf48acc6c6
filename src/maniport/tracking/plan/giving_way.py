"""Where the tip is far from its path, the room to collisions and the time give way: the tip comes first.

A motion keeps farther from collisions than it must, and within its limits in the time that it was given. Where a path
leads through little room, or from one branch of postures to another, that alone keeps the tip beside it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from maniport.tracking.plan.refinement import CLEAR, Asked, Motion, PosturesOnPaths, refine
from maniport.validation import Array

FAR = 3.0
"""So many times what is allowed at 95 % of the points is far at any."""
ROUNDS = 6
LESS_ROOM, LEAST_ROOM, TIGHT = 0.5, 0.003, 0.002
"""Of the room so much is left by each round, and no less than the second [m]; where there is less than the third [m]
all of it is asked for: nothing shall touch."""
MORE_TIME, BESIDE = 1.5, 2
"""So many times longer becomes, in each round, the way to and from so many points on either side of a far one."""
FINER = 0.1
"""Few points are a small share of the cost: so much of the usual share must be gained for another step to follow."""


def given_way(targets: PosturesOnPaths, time: Array, q: Array, asked: Asked, weight: float, tolerance: float) -> Array:
    """Bring the tip nearer where it is far from its path and room or time are what keeps it there."""
    asked = replace(asked, clear=np.full(len(time), CLEAR), enough=FINER * asked.enough)
    kept = np.zeros(len(time), bool)
    """Where all of the room stays."""
    for _ in range(ROUNDS):
        error = targets.tip_error(q)
        if error is None:
            break
        far = error.reshape(len(q), -1).max(axis=1) > FAR * tolerance
        motion = Motion(targets.arm, targets, time, asked)
        room = motion.room(q)
        kept |= _beside(room < TIGHT)
        crowded, hurried = far & np.isfinite(room) & ~kept, far & _beside(motion.hurried(q))
        if not (crowded | hurried).any():
            break
        clear = np.where(crowded, np.maximum(LESS_ROOM * motion.clear, LEAST_ROOM), motion.clear)
        longer = np.where(_beside(hurried)[:-1] & _beside(hurried)[1:], MORE_TIME, 1.0)
        time = np.append(time[0], time[0] + np.cumsum(longer * np.diff(time)))
        found = refine(targets, time, q, replace(asked, clear=clear), (weight,))
        if (tight := crowded & (motion.room(found) < TIGHT)).any():
            kept |= _beside(tight)
        else:
            q = found
        asked = replace(asked, clear=np.where(kept, CLEAR, clear))
    return q


def _beside(points: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """These points and those beside them, shape (n,)."""
    return np.asarray(maximum_filter1d(points, 2 * BESIDE + 1))
