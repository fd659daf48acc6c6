"""The truth about a transfer: measures, the cheap alternatives beside them, and the paper's experiments."""

from maniport.evaluation.report import evaluate
from maniport.evaluation.result import Evaluation, Row

__all__ = ["Evaluation", "Row", "evaluate"]
