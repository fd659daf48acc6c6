"""Evaluation of a transfer: metrics, comparison with baselines, and model selection."""

from maniport.evaluation.comparison import evaluate
from maniport.evaluation.metrics import (
    RMSE,
    DistancePreservation,
    Smoothness,
    distance_preservation,
    identity_test,
    rmse,
    smoothness,
)
from maniport.evaluation.selection import Choice, select_method
from maniport.evaluation.summary import Evaluation, Gaps, Row, Summary, Weakness

__all__ = [
    "RMSE",
    "Choice",
    "DistancePreservation",
    "Evaluation",
    "Gaps",
    "Row",
    "Smoothness",
    "Summary",
    "Weakness",
    "distance_preservation",
    "evaluate",
    "identity_test",
    "rmse",
    "select_method",
    "smoothness",
]
