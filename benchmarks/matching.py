"""Matching two large domains by the paper's score, against trying every pair."""

from collections.abc import Iterator

import numpy as np

from maniport.transfer.icp.score import EllipsoidFeatures, ScoreMatcher

from .inputs import recentred_domains
from .measure import Row, duration, faster, race
from .peers import brute_force


def rows(quick: bool) -> Iterator[Row]:
    """Recentred domains of human and Panda; both sides get the measured ellipsoids."""
    n = 10_000 if quick else 100_000
    teacher, student = (EllipsoidFeatures.of(points) for points in recentred_domains(n))
    index, score = ScoreMatcher(teacher, student).query()
    peer_index, peer_score = brute_force.match(teacher, student)
    error = float(np.abs(score - peer_score).max())
    others = int((index != peer_index).sum())
    times = race(
        lambda: ScoreMatcher(teacher, student).query(),
        lambda: brute_force.match(teacher, student),
        seconds=1.0 if quick else 0.0,
    )
    yield faster(
        f"matching {n:,} × {n:,}, exact arg-max of the paper's score",
        times,
        "brute force",
        8,
        f"brute force {duration(times.peer / n**2)} a pair; different partners: {others}; "
        f"largest difference of scores {error:.1g}",
        error < 1e-12,
    )
