"""Limits for Pink, beside its own."""

from maniport.tracking.limits.braking_limit import BrakingLimit

__all__ = ["BrakingLimit"]
