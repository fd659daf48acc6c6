"""Sizes of what tests work on."""

from contextlib import ExitStack
from unittest import mock

SMALL = {"n_teacher": 128, "n_student": 256}
"""Sizes of domains for tests in which the way matters, and not how good the figures are."""


def few_places(**sizes):
    """A context in which few places are tried for a path; tests of placement and the examples try all."""
    few = {"CANDIDATES": 64, "SIEVE": 4, "PLANNED": 1, "STAGES": 8, "NODES": 24, "TRIED": 2, "EVALUATIONS": 2}
    few |= sizes
    return mock.patch.multiple("maniport.tracking.placement.placement_search", **few)


def few_postures():
    """A context in which motions are planned over few postures of the robot; it holds in all tests but the examples."""
    stack = ExitStack()
    stack.enter_context(mock.patch("maniport.tracking.plan.atlas.SAMPLES", 5000))
    stack.enter_context(mock.patch("maniport.tracking.plan.planner.NODES", 100))
    stack.enter_context(mock.patch("maniport.tracking.plan.planner.MOST_NODES", 100))
    return stack
