"""Limits for Pink, beside its own."""

from maniport.tracking.limits.braking import BrakingLimit
from maniport.tracking.limits.collision import CollisionLimit
from maniport.tracking.limits.uneven import UnevenLimit

__all__ = ["BrakingLimit", "CollisionLimit", "UnevenLimit"]
