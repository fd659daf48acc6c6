"""The only judge: the measures of a transfer, the cheap alternatives beside it, and the verdict."""

from maniport.evaluation.measures import RMSE, Smoothness, Structure, rmse, smoothness, structure
from maniport.evaluation.reliability import Stability, identity_test, stability
from maniport.evaluation.report import Evaluation, evaluate
from maniport.evaluation.verdict import Gaps, Row, Verdict, Weakness

__all__ = [
    "RMSE",
    "Evaluation",
    "Gaps",
    "Row",
    "Smoothness",
    "Stability",
    "Structure",
    "Verdict",
    "Weakness",
    "evaluate",
    "identity_test",
    "rmse",
    "smoothness",
    "stability",
    "structure",
]
