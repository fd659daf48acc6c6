"""The measures of a transfer, each a function: accuracy, feasibility, faithfulness, reliability.

All take SPD matrices that carry the same regularisation on both sides; distances at different ones are not comparable.
`maniport.evaluation.evaluate` computes them together for a fitted adapter and for the cheap alternatives.
"""

from maniport.evaluation.accuracy import RMSE, rmse
from maniport.evaluation.faithfulness import Smoothness, Structure, smoothness, structure
from maniport.evaluation.reliability import Stability, identity_test, stability
from maniport.spd.cloud import energy_distance

__all__ = [
    "RMSE",
    "Smoothness",
    "Stability",
    "Structure",
    "energy_distance",
    "identity_test",
    "rmse",
    "smoothness",
    "stability",
    "structure",
]
