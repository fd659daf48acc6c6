"""Tasks for Pink, beside its own."""

from maniport.tracking.tasks.ellipsoid_task import ManipulabilityEllipsoidTask
from maniport.tracking.tasks.frame_tasks import OrientationTask, PositionTask

__all__ = ["ManipulabilityEllipsoidTask", "OrientationTask", "PositionTask"]
