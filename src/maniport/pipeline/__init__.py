"""The main job: a recording in, the motion of a robot out; before it, several demonstrations become one.

The names are loaded on first use, since the command line needs the configuration alone.
"""

import importlib
from typing import TYPE_CHECKING, Any

_MODULE_OF = {
    "BothResult": "both_result",
    "Config": "config",
    "LearnedProfile": "learned",
    "TransferResult": "result",
    "learn": "learn",
    "transfer_both": "both",
    "transfer_recording": "job",
}

__all__ = [
    "BothResult", "Config", "LearnedProfile", "TransferResult", "learn", "transfer_both", "transfer_recording",
]  # fmt: skip

if TYPE_CHECKING:
    from maniport.pipeline.both import transfer_both
    from maniport.pipeline.both_result import BothResult
    from maniport.pipeline.config import Config
    from maniport.pipeline.job import transfer_recording
    from maniport.pipeline.learn import learn
    from maniport.pipeline.learned import LearnedProfile
    from maniport.pipeline.result import TransferResult


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value
