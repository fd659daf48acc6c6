"""The student follows: joint positions whose ellipsoids, and hand, are the wanted ones.

The wanted ellipsoids and positions are plain arrays, in the arm's base frame.
"""

from maniport.tracking.feasible import FeasibleEllipsoids, nearest_feasible
from maniport.tracking.start_bank import StartBank

__all__ = ["FeasibleEllipsoids", "StartBank", "nearest_feasible"]
