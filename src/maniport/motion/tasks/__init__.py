"""Tasks for Pink, beside its own."""

from maniport.motion.tasks.ellipsoid_task import ManipulabilityEllipsoidTask
from maniport.motion.tasks.frame_tasks import OrientationTask, PositionTask

__all__ = ["ManipulabilityEllipsoidTask", "OrientationTask", "PositionTask"]
