"""Compiled bounds of the distances of convex hulls; `maniport.arms.collisions.solids` calls them."""

import numpy as np

from maniport.util.jit import kernel, part


@kernel
def fill_distance_bounds(
    rotations,
    places,
    corners,
    starts,
    joints,
    skins,
    centers,
    radii,
    pairs,
    margins,
    table,
    bounds,
):
    """Fill lower bounds of the distances of pairs; bounds above `margins` (pairs,) are not refined."""
    middles = np.empty((len(joints), 3))
    for n in range(len(bounds)):
        turns = rotations[n]
        origins = places[n]
        for h in range(len(joints)):
            j = joints[h]
            for i in range(3):
                middles[h, i] = origins[j, i] + (
                    turns[j, i, 0] * centers[h, 0]
                    + turns[j, i, 1] * centers[h, 1]
                    + turns[j, i, 2] * centers[h, 2]
                )
        for p in range(len(pairs)):
            a, b = pairs[p]
            j = joints[a]
            skin = skins[a] + skins[b]
            sufficient = margins[p] + skin
            if b < 0:
                height = middles[a, 2] - radii[a] - table
                if height <= sufficient:
                    up = turns[j, 2]
                    height = (
                        origins[j, 2]
                        - table
                        + _least(corners, starts[a], starts[a + 1], up[0], up[1], up[2])[0]
                    )
                bounds[n, p] = height - skin
                continue
            x = middles[a, 0] - middles[b, 0]
            y = middles[a, 1] - middles[b, 1]
            z = middles[a, 2] - middles[b, 2]
            distance = np.sqrt(x * x + y * y + z * z) - radii[a] - radii[b]
            if distance <= sufficient:
                distance = _apart(
                    turns[j],
                    origins[j],
                    turns[joints[b]],
                    origins[joints[b]],
                    corners,
                    starts[a],
                    starts[a + 1],
                    starts[b],
                    starts[b + 1],
                    x,
                    y,
                    z,
                    sufficient,
                )
            bounds[n, p] = distance - skin


@part
def _least(corners, first, last, x, y, z):
    """Smallest product of a direction with corners, and the index of the corner."""
    least = np.inf
    where = first
    for i in range(first, last):
        value = x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2]
        if value < least:
            least = value
            where = i
    return least, where


@part
def _apart(turn_a, at_a, turn_b, at_b, corners, a0, a1, b0, b1, x, y, z, sufficient):
    """Distance of two hulls along separating directions: the first above `sufficient`, or the largest."""
    most = -1.0
    for _ in range(12):  # after 12 directions the exact test decides
        square = x * x + y * y + z * z
        length = np.sqrt(square)
        if length <= 1e-12:
            break
        ax = turn_a[0, 0] * x + turn_a[1, 0] * y + turn_a[2, 0] * z
        ay = turn_a[0, 1] * x + turn_a[1, 1] * y + turn_a[2, 1] * z
        az = turn_a[0, 2] * x + turn_a[1, 2] * y + turn_a[2, 2] * z
        bx = turn_b[0, 0] * x + turn_b[1, 0] * y + turn_b[2, 0] * z
        by = turn_b[0, 1] * x + turn_b[1, 1] * y + turn_b[2, 1] * z
        bz = turn_b[0, 2] * x + turn_b[1, 2] * y + turn_b[2, 2] * z
        least_a, i = _least(corners, a0, a1, ax, ay, az)
        least_b, j = _least(corners, b0, b1, -bx, -by, -bz)
        between = (
            x * (at_a[0] - at_b[0])
            + y * (at_a[1] - at_b[1])
            + z * (at_a[2] - at_b[2])
            + least_a
            + least_b
        )
        most = max(most, between / length - 1e-9)  # rounding
        if most > sufficient:
            break
        w0 = at_a[0] - at_b[0]
        w1 = at_a[1] - at_b[1]
        w2 = at_a[2] - at_b[2]
        for m in range(3):
            w0 += turn_a[0, m] * corners[i, m] - turn_b[0, m] * corners[j, m]
            w1 += turn_a[1, m] * corners[i, m] - turn_b[1, m] * corners[j, m]
            w2 += turn_a[2, m] * corners[i, m] - turn_b[2, m] * corners[j, m]
        u0 = x - w0
        u1 = y - w1
        u2 = z - w2
        change = u0 * u0 + u1 * u1 + u2 * u2
        if not change > 0.0:
            break
        step = min(1.0, max(0.0, (x * u0 + y * u1 + z * u2) / change))
        x = x - step * u0
        y = y - step * u1
        z = z - step * u2
    return most
