"""Former names of the options, for the placement."""

from maniport.motion.plan.plan_options import PlanOptions as PlanSettings
from maniport.motion.plan.plan_options import SearchBudget

__all__ = ["PlanSettings", "SearchBudget"]
