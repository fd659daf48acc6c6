"""Limits for Pink, beside its own."""

from maniport.tracking.limits.braking import BrakingLimit
from maniport.tracking.limits.collision import CollisionLimit

__all__ = ["BrakingLimit", "CollisionLimit"]
