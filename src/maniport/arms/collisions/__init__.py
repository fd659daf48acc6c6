"""Collisions of arms with themselves, a table and obstacles."""

from maniport.arms.collisions.checker import Collisions, Nearest, as_collisions, free_configurations
from maniport.arms.collisions.hulls import Lowest
from maniport.arms.collisions.obstacles import Box, read_boxes

__all__ = ["Box", "Collisions", "Lowest", "Nearest", "as_collisions", "free_configurations", "read_boxes"]
