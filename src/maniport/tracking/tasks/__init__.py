"""Tasks for Pink, beside its own."""

from maniport.tracking.tasks.ellipsoid_task import ManipulabilityEllipsoidTask
from maniport.tracking.tasks.orientation_task import OrientationTask
from maniport.tracking.tasks.position_task import PositionTask

__all__ = ["ManipulabilityEllipsoidTask", "OrientationTask", "PositionTask"]
