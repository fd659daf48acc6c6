"""Evaluation of a transfer: metrics, comparison with baselines, and model selection."""

from maniport.arms.directional import (
    ellipsoid_extent,
    half_sphere,
    line_extent,
    polytope_extent,
)
from maniport.evaluation.capability import Capability, compare_capability, resemblance
from maniport.evaluation.comparison import evaluate, select_method
from maniport.evaluation.metrics import (
    RMSE,
    DistancePreservation,
    Evaluation,
    Gaps,
    Row,
    distance_preservation,
    domain_distance,
    rmse,
    step_ratio,
)

__all__ = [
    "RMSE",
    "Capability",
    "DistancePreservation",
    "Evaluation",
    "Gaps",
    "Row",
    "compare_capability",
    "distance_preservation",
    "domain_distance",
    "ellipsoid_extent",
    "evaluate",
    "half_sphere",
    "line_extent",
    "polytope_extent",
    "resemblance",
    "rmse",
    "select_method",
    "step_ratio",
]
