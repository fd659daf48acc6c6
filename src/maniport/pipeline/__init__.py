"""The main job: a recording in, the motion of a robot out."""

from maniport.pipeline.job import identity_test, make_adapter, mounting_for, transfer_recording
from maniport.pipeline.result import TransferResult

__all__ = ["TransferResult", "identity_test", "make_adapter", "mounting_for", "transfer_recording"]
