"""The start competes with what the search made of it, by the rules in section 6 of `docs/method.md`.

A search always finds something that suits its matches better than the start, for it chooses the matches itself: the
Panda's own domain was turned by 2 to 12° between two draws of it.
"""

import numpy as np

from maniport.transfer.cloud_pair import CloudPair
from maniport.transfer.icp.search import SearchResult
from maniport.transfer.rotation_group import rotation_angle

CERTAIN = 3.0
"""Standard errors by which the mean distance between the clouds must fall, or more ellipsoids coincide.

Measured for the latter, 30 draws each of 8 to 1000 ellipsoids of arms, where the start is right: at most 2.5.
"""

WORTH_WHILE = 0.1
"""Share of the energy distance between the clouds that must be gained.

Measured on ten draws each, 4096 and 16384 ellipsoids: where the start was right, −0.6 to 0.4 standard errors (Panda to
Panda); where the domains differ in shape, −1.9 to 3.8 and at most 4 % (human to Panda), and the rotation found was
another one for every draw; where the start was 30° off, 3.9 to 5.9 and more than half.
"""

EXACT = 0.5
"""Share of the start's cost below which the matches are so good that no chance explains them.

Measured: 0.62 at least between independent draws of 12 ellipsoids and 0.89 of 400 (human to Panda).
"""

STILL = 1e-6
"""Rotations closer than this are the same [rad]."""


def compete(pair: CloudPair, result: SearchResult) -> tuple[bool, str]:
    """Ask whether the rotation that was found clearly brings the clouds nearer than the start.

    Returns whether the start is kept, against what was found or because it was found again, and how the search ended.
    """
    start, found = result.plain, result.best
    angle = rotation_angle(start.start, found.rotation)
    if angle < STILL:
        return True, found.reason
    if found.cost <= EXACT * start.history[0]:
        return False, found.reason
    gain = pair.gain(start.start, found.rotation)
    share = 2.0 * gain.mean / pair.energy_distance(start.start)
    if gain.certainty >= CERTAIN and share >= WORTH_WHILE:
        return False, found.reason
    if pair.coincidence(pair.nearest(start.start), pair.nearest(found.rotation)).certainty >= CERTAIN:
        return False, found.reason
    off = f"the start is kept: the rotation found ({found.reason}), {np.rad2deg(angle):.1f}° away,"
    if gain.mean <= 0.0:
        return True, f"{off} does not bring the clouds nearer"
    return True, f"{off} brings the clouds nearer by {share:.1%} ± {share / gain.certainty:.1%} only"
