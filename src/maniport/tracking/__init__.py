"""The student follows: joint positions whose ellipsoids, and hand, are the wanted ones.

The wanted ellipsoids and positions are plain arrays, in the arm's base frame.
"""

import importlib
from typing import TYPE_CHECKING, Any

from maniport.tracking.feasible import FeasibleEllipsoids, nearest_feasible
from maniport.tracking.start_bank import StartBank

if TYPE_CHECKING:
    from maniport.tracking.arm_model import robot_model
    from maniport.tracking.braking_limit import BrakingLimit
    from maniport.tracking.ellipsoid_task import ManipulabilityEllipsoidTask
    from maniport.tracking.feasibility import feasibility_gap
    from maniport.tracking.offline import optimize_trajectory
    from maniport.tracking.offline_result import OfflineResult
    from maniport.tracking.placed_path import PlacedPath
    from maniport.tracking.placement import place_path
    from maniport.tracking.position_task import PositionTask
    from maniport.tracking.track_result import TrackResult
    from maniport.tracking.tracker import track

_HOMES = {
    "BrakingLimit": "braking_limit",
    "ManipulabilityEllipsoidTask": "ellipsoid_task",
    "OfflineResult": "offline_result",
    "PlacedPath": "placed_path",
    "PositionTask": "position_task",
    "TrackResult": "track_result",
    "feasibility_gap": "feasibility",
    "optimize_trajectory": "offline",
    "place_path": "placement",
    "robot_model": "arm_model",
    "track": "tracker",
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
