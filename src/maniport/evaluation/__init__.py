"""Evaluation of a transfer: metrics, comparison with baselines, and model selection."""

from maniport.evaluation.comparison import evaluate
from maniport.evaluation.metrics import (
    RMSE,
    Smoothness,
    Stability,
    Structure,
    identity_test,
    rmse,
    smoothness,
    stability,
    structure,
)
from maniport.evaluation.selection import Choice, choose
from maniport.evaluation.summary import Evaluation, Gaps, Row, Verdict, Weakness

__all__ = [
    "RMSE",
    "Choice",
    "Evaluation",
    "Gaps",
    "Row",
    "Smoothness",
    "Stability",
    "Structure",
    "Verdict",
    "Weakness",
    "choose",
    "evaluate",
    "identity_test",
    "rmse",
    "smoothness",
    "stability",
    "structure",
]
