"""maniport: transfer manipulability from a human arm to a robot arm.

The public names are loaded on first use, so that ``import maniport`` stays light.
"""

import importlib
from typing import TYPE_CHECKING, Any

from maniport.version import __version__

_NAMES = {
    "batch": ("transfer_batch",),
    "arms": ("Arm", "ArmGroup", "EllipsoidSpec", "load_arm", "load_arms"),
    "arms.collisions": ("Collisions",),
    "mocap": ("Recording", "fit_arm", "fit_arms", "read_recording"),
    "domain": ("sample_domain",),
    "errors": (),
    "evaluation": ("evaluate",),
    "live": ("Live",),
    "pipeline": ("LearnedProfile", "MotionResult", "TransferResult", "follow_profile", "learn", "transfer_recording"),
    "learning": ("ProfileGMM", "align"),
    "spd": (),
    "report": (),
    "report.figures": ("write_figures",),
    "report.console": ("progress",),
    "report.write": ("write_results",),
    "motion": ("FeasibleProjector", "SeedBank", "nearest_feasible", "track"),
    "transfer": (
        "LengthField",
        "NearestNeighbor",
        "ParallelTransport",
        "IdentityMap",
        "MeanTransport",
        "RiemannianICP",
        "load_adapter",
    ),
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}
_PACKAGES = [module for module in _NAMES if "." not in module]

__all__ = sorted([*_MODULE_OF, *_PACKAGES, "__version__"])

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
    from maniport.transfer import (
        IdentityMap,
        LengthField,
        MeanTransport,
        NearestNeighbor,
        ParallelTransport,
        RiemannianICP,
        load_adapter,
    )


def __getattr__(name: str) -> Any:
    if name in _MODULE_OF:
        value = getattr(importlib.import_module(f"maniport.{_MODULE_OF[name]}"), name)
    elif name in _PACKAGES:
        value = importlib.import_module(f"maniport.{name}")
    else:
        raise AttributeError(f"module 'maniport' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
