"""The main job: a recording in, the motion of a robot out; before it, several demonstrations become one."""

from maniport.pipeline.learn import learn
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.results import MotionResult, TransferResult
from maniport.pipeline.transfer import follow_profile, transfer_recording

__all__ = ["LearnedProfile", "MotionResult", "TransferResult", "follow_profile", "learn", "transfer_recording"]
