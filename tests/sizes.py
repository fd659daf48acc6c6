"""Sizes of what tests work on."""

from contextlib import ExitStack
from dataclasses import replace
from unittest import mock

from maniport.tracking.effort import EFFORTS

SMALL = {"n_teacher": 128, "n_student": 256}
"""Sizes of domains for tests in which the way matters, and not how good the figures are."""


def few_places(**sizes):
    """A context in which few places are tried for a path; tests of placement and the examples try all."""
    return _with_effort(**({"candidates": 64, "placement_nodes": 24} | sizes))


def few_postures():
    """A context in which motions are planned over few postures of the robot; it holds in all tests but the examples."""
    stack = ExitStack()
    stack.enter_context(mock.patch("maniport.tracking.plan.reachability_map.SAMPLES", 5000))
    stack.enter_context(_with_effort(nodes=100))
    return stack


def _with_effort(**sizes):
    """A context in which every effort is so large."""
    return mock.patch.dict(EFFORTS, {name: replace(effort, **sizes) for name, effort in EFFORTS.items()})
