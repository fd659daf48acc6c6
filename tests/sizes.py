"""Sizes for tests that look at the way and not at how good the figures are."""

from dataclasses import replace
from unittest import mock

from maniport.motion.effort import EFFORTS

SMALL = {"n_teacher": 128, "n_student": 256}
"""Sizes of domains."""


def few_places(**sizes):
    """Patch every effort so that few placements are tried; prefer ``effort="quick"``."""
    few = {"candidates": 64, "placement_nodes": 24} | sizes
    return mock.patch.dict(EFFORTS, {name: replace(effort, **few) for name, effort in EFFORTS.items()})
