"""Live: one frame of a person in, joint positions of a robot out."""

from maniport.live.live import Live
from maniport.live.state import STATES, LiveArm, LiveState

__all__ = ["STATES", "Live", "LiveArm", "LiveState"]
