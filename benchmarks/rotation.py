"""One optimisation of the rotation, against PyManOpt's trust regions with autograd."""

from collections.abc import Iterator

import numpy as np
from scipy.stats import special_ortho_group

from maniport.transfer.icp.rotation import RotationProblem
from maniport.transfer.icp.score import EllipsoidFeatures, ScoreMatcher

from .inputs import Array, recentred_domains
from .measure import Row, faster, race
from .peers.pymanopt_rotation import PymanoptRotation

WANTED_GRADIENT = 1e-9
STARTS = 4


def rows(quick: bool) -> Iterator[Row]:
    """Matched pairs of human and Panda, weighted as in the paper; the time for the same few starts."""
    for n, wanted in ((100, 80), (400, 40)):
        student, teacher, weights = matched_pairs(n)
        starts = [np.eye(3), *special_ortho_group.rvs(3, size=STARTS - 1, random_state=0)]
        ours = RotationProblem(student, teacher, weights)
        peer = PymanoptRotation(student, teacher, weights)
        ends = [[step.minimize(start) for start in starts] for step in (ours, peer)]
        norms = [
            max(float(np.linalg.norm(ours.derivatives(getattr(end, "rotation", end))[1])) for end in found)
            for found in ends
        ]
        times = race(
            lambda ours=ours, starts=starts: [ours.minimize(start) for start in starts],
            lambda peer=peer, starts=starts: [peer.minimize(start) for start in starts],
            0.5 if quick else 5.0,
        )
        yield faster(
            f"rotation optimised to gradient norm < 1e-9, N = {n}, {STARTS} starts",
            times,
            "PyManOpt",
            wanted,
            f"largest gradient norm: ours {norms[0]:.1g}, PyManOpt {norms[1]:.1g}",
            max(norms) < WANTED_GRADIENT,
        )


def matched_pairs(n: int, exponent: float = 3.0) -> tuple[Array, Array, Array]:
    """Pairs S_i, T_i that the paper's score finds before any rotation, and their weights w³."""
    teacher, student = recentred_domains(n)
    index, score = ScoreMatcher(EllipsoidFeatures.of(teacher), EllipsoidFeatures.of(student)).query()
    weights = score**exponent
    return student[index], teacher, weights / weights.sum()
