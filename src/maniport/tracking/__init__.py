"""The student follows: joint positions whose ellipsoids, and hand, are the wanted ones.

The wanted ellipsoids and positions are plain arrays, in the arm's base frame.
"""

import importlib
from typing import TYPE_CHECKING, Any

from maniport.tracking.search.feasible import FeasibleEllipsoids, nearest_feasible
from maniport.tracking.search.start_bank import StartBank

if TYPE_CHECKING:
    from maniport.tracking.arm_model import robot_model
    from maniport.tracking.follow.track_result import TrackResult
    from maniport.tracking.follow.tracker import track
    from maniport.tracking.limits.braking_limit import BrakingLimit
    from maniport.tracking.offline.offline import optimize_trajectory
    from maniport.tracking.offline.offline_result import OfflineResult
    from maniport.tracking.placement.placed_path import PlacedPath
    from maniport.tracking.placement.placement import place_path
    from maniport.tracking.search.feasibility import feasibility_gap
    from maniport.tracking.tasks.ellipsoid_task import ManipulabilityEllipsoidTask
    from maniport.tracking.tasks.position_task import PositionTask

_HOMES = {
    "BrakingLimit": "limits.braking_limit",
    "ManipulabilityEllipsoidTask": "tasks.ellipsoid_task",
    "OfflineResult": "offline.offline_result",
    "PlacedPath": "placement.placed_path",
    "PositionTask": "tasks.position_task",
    "TrackResult": "follow.track_result",
    "feasibility_gap": "search.feasibility",
    "optimize_trajectory": "offline.offline",
    "place_path": "placement.placement",
    "robot_model": "arm_model",
    "track": "follow.tracker",
}
"""Names that are loaded on first use, since Pink and its solvers take their time to import."""

__all__ = [
    "BrakingLimit",
    "FeasibleEllipsoids",
    "ManipulabilityEllipsoidTask",
    "OfflineResult",
    "PlacedPath",
    "PositionTask",
    "StartBank",
    "TrackResult",
    "feasibility_gap",
    "nearest_feasible",
    "optimize_trajectory",
    "place_path",
    "robot_model",
    "track",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'maniport.tracking' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"maniport.tracking.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
