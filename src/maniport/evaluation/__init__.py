"""The only judge: the measures of a transfer, the cheap alternatives beside it, and the verdict."""

from maniport.evaluation.choice import Choice, choose
from maniport.evaluation.measures import RMSE, Smoothness, Structure, rmse, smoothness, structure
from maniport.evaluation.reliability import Stability, identity_test, stability
from maniport.evaluation.report import Evaluation, evaluate
from maniport.evaluation.rows import Gaps, Row
from maniport.evaluation.rule import Weakness
from maniport.evaluation.verdict import Verdict

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
