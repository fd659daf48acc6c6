"""maniport: a robot arm takes over the way a person uses their arm.

The public names are loaded on first use, so that ``import maniport`` stays light.
"""

import importlib
from typing import TYPE_CHECKING, Any

from maniport.version import __version__

_NAMES = {
    "batch": ("transfer_batch",),
    "arms": ("Arm", "Arms", "EllipsoidSpec", "load_arm", "load_arms"),
    "arms.collisions": ("Collisions",),
    "mocap": ("Recording", "fit_arm", "fit_arms", "read_recording"),
    "domain": ("sample_domain",),
    "errors": (),
    "evaluation": ("evaluate",),
    "live": ("Live",),
    "pipeline": ("BothResult", "LearnedProfile", "TransferResult", "learn", "transfer_both", "transfer_recording"),
    "learning": ("ProfileGMM", "align"),
    "spd": (),
    "report": (),
    "report.figures": ("write_figures",),
    "report.console": ("progress",),
    "report.write": ("write_results",),
    "motion": ("FeasibleProjector", "StartBank", "nearest_feasible", "track"),
    "transfer": (
        "LengthsField",
        "NearestNeighbor",
        "ParallelTransport",
        "RawCopy",
        "Recentring",
        "RiemannianICP",
        "load_adapter",
    ),
}
_HOMES = {name: room for room, names in _NAMES.items() for name in names}
_ROOMS = [room for room in _NAMES if "." not in room]

__all__ = [
    "Arm", "Arms", "BothResult", "Collisions", "EllipsoidSpec", "FeasibleProjector", "LearnedProfile", "LengthsField",
    "Live", "NearestNeighbor", "ParallelTransport", "ProfileGMM", "RawCopy", "Recentring", "Recording",
    "RiemannianICP", "StartBank", "TransferResult", "__version__", "align", "batch", "batches", "bodies",
    "demonstrations", "domain", "errors", "evaluate", "evaluation", "fit_arm", "fit_arms", "learn", "live",
    "load_adapter", "load_arm", "load_arms", "nearest_feasible", "pipeline", "profiles", "progress", "read_recording",
    "sample_domain", "spd", "telling", "track", "tracking", "transfer", "transfer_both", "transfer_recording",
    "write_figures", "write_results",
]  # fmt: skip
"""Once more, for type checkers, which do not compute."""

if TYPE_CHECKING:
    from maniport import (
        batch,
        arms,
        mocap,
        domain,
        errors,
        evaluation,
        live,
        pipeline,
        learning,
        spd,
        report,
        motion,
        transfer,
    )
    from maniport.batch import batch
    from maniport.arms import Arm, Arms, EllipsoidSpec, load_arm, load_arms
    from maniport.arms.collisions import Collisions
    from maniport.mocap import Recording, fit_arm, fit_arms, read_recording
    from maniport.domain import sample_domain
    from maniport.evaluation import evaluate
    from maniport.live import Live
    from maniport.pipeline import BothResult, LearnedProfile, TransferResult, learn, transfer_both, transfer_recording
    from maniport.learning import ProfileGMM, align
    from maniport.report.console import progress
    from maniport.report.figures import write_figures
    from maniport.report.write import write_results
    from maniport.motion import FeasibleProjector, StartBank, nearest_feasible, track
    from maniport.transfer import (
        LengthsField,
        NearestNeighbor,
        ParallelTransport,
        RawCopy,
        Recentring,
        RiemannianICP,
        load_adapter,
    )


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        value = getattr(importlib.import_module(f"maniport.{_HOMES[name]}"), name)
    elif name in _ROOMS:
        value = importlib.import_module(f"maniport.{name}")
    else:
        raise AttributeError(f"module 'maniport' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
