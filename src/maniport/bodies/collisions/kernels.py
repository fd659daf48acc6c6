"""What is compiled: poses of links, and how far pairs of hulls are certainly apart."""

import numpy as np

from maniport.jit import kernel, part


@kernel
def poses_of(all_positions, parents, placements, axes, slides, all_turns, all_origins):  # type: ignore[no-untyped-def]
    """Write the poses of the base and of the link after each joint, which hangs on the link `parents` says."""
    turn = np.empty((3, 3))
    for n in range(len(all_positions)):
        positions, turns, origins = all_positions[n], all_turns[n], all_origins[n]
        for i in range(3):
            origins[0, i] = 0.0
            for j in range(3):
                turns[0, i, j] = 1.0 if i == j else 0.0
        for k in range(len(positions)):
            x, y, z, angle, above = axes[k, 0], axes[k, 1], axes[k, 2], positions[k], parents[k]
            sine, cosine = (0.0, 1.0) if slides[k] else (np.sin(angle), np.cos(angle))
            rest = 1.0 - cosine  # Rodrigues
            turn[0, 0], turn[0, 1], turn[0, 2] = cosine + x * x * rest, x * y * rest - z * sine, x * z * rest + y * sine
            turn[1, 0], turn[1, 1], turn[1, 2] = x * y * rest + z * sine, cosine + y * y * rest, y * z * rest - x * sine
            turn[2, 0], turn[2, 1], turn[2, 2] = x * z * rest - y * sine, y * z * rest + x * sine, cosine + z * z * rest
            for i in range(3):
                total = origins[above, i]
                a, b, c = 0.0, 0.0, 0.0
                for m in range(3):
                    total += turns[above, i, m] * placements[k, m, 3]
                    a += turns[above, i, m] * placements[k, m, 0]
                    b += turns[above, i, m] * placements[k, m, 1]
                    c += turns[above, i, m] * placements[k, m, 2]
                origins[k + 1, i] = total
                for j in range(3):
                    turns[k + 1, i, j] = a * turn[0, j] + b * turn[1, j] + c * turn[2, j]
                if slides[k]:
                    origins[k + 1, i] += angle * (a * x + b * y + c * z)


@kernel
def fill_room(  # type: ignore[no-untyped-def]
    all_turns, all_origins, corners, starts, joints, centres, sides, pairs, enough, table, asked, room
):
    """Write how far pairs are apart at least; what is more than enough is not looked at any closer."""
    middles, radii = np.empty((len(joints), 3)), np.empty(len(joints))
    for h in range(len(joints)):  # by entry: a sum along an axis costs Numba 1.6 s of compiling, for its messages
        radii[h] = np.sqrt(sides[h, 0] * sides[h, 0] + sides[h, 1] * sides[h, 1] + sides[h, 2] * sides[h, 2])
    for n in range(len(all_turns)):
        turns, origins = all_turns[n], all_origins[n]
        for h in range(len(joints)):
            j = joints[h]
            for i in range(3):
                middles[h, i] = origins[j, i] + (
                    turns[j, i, 0] * centres[h, 0] + turns[j, i, 1] * centres[h, 1] + turns[j, i, 2] * centres[h, 2]
                )
        for p in range(len(pairs)):
            if not asked[n, p]:
                continue
            a, b = pairs[p]
            j = joints[a]
            if b < 0:
                height = middles[a, 2] - radii[a] - table
                if height <= enough[p]:
                    up = turns[j, 2]
                    height = origins[j, 2] - table + _least(corners, starts[a], starts[a + 1], up[0], up[1], up[2])[0]
                room[n, p] = height
                continue
            x, y, z = middles[a, 0] - middles[b, 0], middles[a, 1] - middles[b, 1], middles[a, 2] - middles[b, 2]
            room[n, p] = np.sqrt(x * x + y * y + z * z) - radii[a] - radii[b]
            if room[n, p] <= enough[p]:
                room[n, p] = _apart(
                    turns[j], origins[j], turns[joints[b]], origins[joints[b]], corners, sides[a], sides[b],
                    starts[a], starts[a + 1], starts[b], starts[b + 1], x, y, z, enough[p],
                )  # fmt: skip


@part
def _least(corners, first, last, x, y, z):  # type: ignore[no-untyped-def]
    """Smallest product of a direction with corners, and whose it is."""
    least, where = np.inf, first
    for i in range(first, last):
        value = x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2]
        if value < least:
            least, where = value, i
    return least, where


@part
def _apart(  # type: ignore[no-untyped-def]
    turn_a, at_a, turn_b, at_b, corners, sides_a, sides_b, a0, a1, b0, b1, x, y, z, enough
):
    """How much a plane leaves between two hulls: the first one found that leaves more than enough, or the best."""
    from_middle, most = (x, y, z), -1.0
    for _ in range(12):  # a pair that so many directions do not separate is left to the exact test
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
        spread = abs(ax) * sides_a[0] + abs(ay) * sides_a[1] + abs(az) * sides_a[2]
        spread += abs(bx) * sides_b[0] + abs(by) * sides_b[1] + abs(bz) * sides_b[2]
        of_boxes = x * from_middle[0] + y * from_middle[1] + z * from_middle[2] - spread
        most = max(most, of_boxes / length - 1e-9)  # rounding
        if most > enough:
            break
        least_a, i = _least(corners, a0, a1, ax, ay, az)
        least_b, j = _least(corners, b0, b1, -bx, -by, -bz)
        between = x * (at_a[0] - at_b[0]) + y * (at_a[1] - at_b[1]) + z * (at_a[2] - at_b[2]) + least_a + least_b
        most = max(most, between / length - 1e-9)
        if most > enough:
            break
        w0 = at_a[0] - at_b[0]
        w1 = at_a[1] - at_b[1]
        w2 = at_a[2] - at_b[2]
        for m in range(3):
            w0 += turn_a[0, m] * corners[i, m] - turn_b[0, m] * corners[j, m]
            w1 += turn_a[1, m] * corners[i, m] - turn_b[1, m] * corners[j, m]
            w2 += turn_a[2, m] * corners[i, m] - turn_b[2, m] * corners[j, m]
        u0, u1, u2 = x - w0, y - w1, z - w2
        change = u0 * u0 + u1 * u1 + u2 * u2
        if not change > 0.0:
            break
        step = min(1.0, max(0.0, (x * u0 + y * u1 + z * u2) / change))
        x, y, z = x - step * u0, y - step * u1, z - step * u2
    return most
