"""The main job: a recording in, the motion of a robot out; before it, several demonstrations become one.

The names are loaded on first use, since the command line needs the configuration alone.
"""

import importlib
from typing import TYPE_CHECKING, Any

_MODULE_OF = {
    "Config": "config",
    "LearnedProfile": "demonstrations",
    "MotionResult": "results",
    "TransferResult": "results",
    "follow_profile": "following",
    "learn": "demonstrations",
    "transfer_recording": "stages",
}

__all__ = [
    "Config", "LearnedProfile", "MotionResult", "TransferResult", "follow_profile", "learn", "transfer_recording",
]  # fmt: skip

if TYPE_CHECKING:
    from maniport.pipeline.config import Config
    from maniport.pipeline.demonstrations import LearnedProfile, learn
    from maniport.pipeline.following import follow_profile
    from maniport.pipeline.results import MotionResult, TransferResult
    from maniport.pipeline.stages import transfer_recording


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value
