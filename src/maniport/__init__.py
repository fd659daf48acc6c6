"""maniport: transfer manipulability from a human arm to a robot arm.

The public names are loaded on first use, so that ``import maniport`` stays light.
"""

import importlib
from typing import TYPE_CHECKING, Any

from maniport.version import __version__

__all__ = [
    "Arm", "ArmGroup", "Collisions", "EllipsoidSpec", "FeasibleProjector", "IdentityMap", "LearnedProfile",
    "LengthField", "Live", "MeanTransport", "MotionResult", "NearestNeighbor", "ParallelTransport", "ProfileGMM",
    "Recording", "RiemannianICP", "SeedBank", "TransferResult", "__version__", "align", "arms", "batch", "domain",
    "errors", "evaluate", "evaluation", "fit_arm", "fit_arms", "follow_profile", "learn", "learning", "live",
    "load_adapter", "load_arm", "load_arms", "mocap", "motion", "nearest_feasible", "pipeline", "progress",
    "read_recording", "report", "sample_domain", "spd", "track", "transfer", "transfer_batch", "transfer_recording",
    "write_figures", "write_results",
]  # fmt: skip

_NAMES = {
    "arms": ("Arm", "ArmGroup", "EllipsoidSpec", "load_arm", "load_arms"),
    "arms.collisions": ("Collisions",),
    "batch": ("transfer_batch",),
    "domain": ("sample_domain",),
    "evaluation": ("evaluate",),
    "learning": ("ProfileGMM", "align"),
    "live": ("Live",),
    "mocap": ("Recording", "fit_arm", "fit_arms", "read_recording"),
    "motion": ("FeasibleProjector", "SeedBank", "nearest_feasible", "track"),
    "pipeline": ("LearnedProfile", "MotionResult", "TransferResult", "follow_profile", "learn", "transfer_recording"),
    "report.console": ("progress",),
    "report.figures": ("write_figures",),
    "report.write": ("write_results",),
    "transfer": (
        *("IdentityMap", "LengthField", "MeanTransport", "NearestNeighbor", "ParallelTransport", "RiemannianICP"),
        "load_adapter",
    ),
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}

if TYPE_CHECKING:
    from maniport import (
        arms,
        batch,
        domain,
        errors,
        evaluation,
        learning,
        live,
        mocap,
        motion,
        pipeline,
        report,
        spd,
        transfer,
    )
    from maniport.arms import Arm, ArmGroup, EllipsoidSpec, load_arm, load_arms
    from maniport.arms.collisions import Collisions
    from maniport.batch import transfer_batch
    from maniport.domain import sample_domain
    from maniport.evaluation import evaluate
    from maniport.learning import ProfileGMM, align
    from maniport.live import Live
    from maniport.mocap import Recording, fit_arm, fit_arms, read_recording
    from maniport.motion import FeasibleProjector, SeedBank, nearest_feasible, track
    from maniport.pipeline import (
        LearnedProfile,
        MotionResult,
        TransferResult,
        follow_profile,
        learn,
        transfer_recording,
    )
    from maniport.report.console import progress
    from maniport.report.figures import write_figures
    from maniport.report.write import write_results
    from maniport.transfer import (  # fmt: skip
        IdentityMap,
        LengthField,
        MeanTransport,
        NearestNeighbor,
        ParallelTransport,
        RiemannianICP,
        load_adapter,
    )


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'maniport' has no attribute {name!r}")
    if name in _MODULE_OF:
        value = getattr(importlib.import_module(f"maniport.{_MODULE_OF[name]}"), name)
    else:
        value = importlib.import_module(f"maniport.{name}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
