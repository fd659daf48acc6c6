"""Motions that a robot could run: two recordings as a whole with a Panda, and two motions with other robots."""

from collections.abc import Iterator

from . import tracking_plan, tracking_robots
from .measure import Row
from .tracking_motions import motions


def rows(quick: bool) -> Iterator[Row]:
    """A row for each recording, tip, place and pace, and for each robot."""
    yield from tracking_plan.rows(quick)
    yield from tracking_robots.rows(list(motions()), quick)
