"""The main job: a recording in, the motion of a robot out; before it, several demonstrations become one."""

from maniport.pipeline.both import transfer_both
from maniport.pipeline.both_result import BothResult
from maniport.pipeline.job import transfer_recording
from maniport.pipeline.learn import learn
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.result import TransferResult

__all__ = [
    "BothResult", "LearnedProfile", "TransferResult", "learn", "transfer_both", "transfer_recording",
]  # fmt: skip
