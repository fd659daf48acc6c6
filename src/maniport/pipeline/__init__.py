"""The main job: a recording in, the motion of a robot out."""

from maniport.pipeline.job import transfer_recording
from maniport.pipeline.result import TransferResult

__all__ = ["TransferResult", "transfer_recording"]
