"""Time-optimal speed along a path under linear constraints, by reachability analysis.

With x the squared speed at the start of a piece of the path and u its constant path acceleration, every constraint
|a u + b x| ≤ 1 holds at rest, so that the speeds from which the path's end can be reached are those below a largest
one. The largest speeds are found from the end backward, the acceleration is then as large as they allow from the start
forward (Pham & Pham, "A new approach to time-optimal path parameterization based on reachability analysis", IEEE
Transactions on Robotics, 2018).
"""

import numpy as np

from maniport.util.jit import kernel, part

FLAT = 1e-12  # Ratio of a to b below which a constraint bounds x alone


@kernel
def fill_speeds(a, b, steps, limits, speeds):  # type: ignore[no-untyped-def]
    """Fill the fastest speeds (k,) from rest to rest with |a u + b x| ≤ 1 and x ≤ limits (k,); zero where none is.

    `a` and `b`, shape (k - 1, m), are the constraints of each piece, of length `steps` (k - 1,).
    """
    last = len(steps)
    speeds[last] = 0.0
    for i in range(last - 1, -1, -1):
        speeds[i] = _largest_start(a[i], b[i], steps[i], limits[i], speeds[i + 1])
    speeds[0] = 0.0
    for i in range(last):
        upper = _accelerations(a[i], b[i], steps[i], speeds[i], speeds[i + 1])[2]
        speeds[i + 1] = max(0.0, min(speeds[i + 1], speeds[i] + 2.0 * steps[i] * upper))
    for i in range(last + 1):
        speeds[i] = np.sqrt(speeds[i])


@part
def _largest_start(a, b, step, limit, end):  # type: ignore[no-untyped-def]
    """Find the largest x up to a limit from which a piece can be passed and left with at most `end`."""
    x = limit
    for m in range(len(a)):
        if abs(b[m]) * x > 1.0 and abs(a[m]) <= FLAT * abs(b[m]):
            x = 1.0 / abs(b[m])
    for _ in range(2 * len(a) + 4):  # Newton's method on a convex function: each iteration leaves a line for good
        lower, lower_slope, upper, upper_slope = _accelerations(a, b, step, x, end)
        gap = lower - upper
        if gap <= 1e-12 * (abs(lower) + abs(upper)):
            return x
        if lower_slope <= upper_slope:
            break
        x = max(0.0, x - gap / (lower_slope - upper_slope))
    return x


@part
def _accelerations(a, b, step, x, end):  # type: ignore[no-untyped-def]
    """Return the largest lower and the smallest upper bound of u at x, both followed by their slopes."""
    lower, lower_slope = -0.5 * x / step, -0.5 / step
    upper, upper_slope = 0.5 * (end - x) / step, -0.5 / step
    for m in range(len(a)):
        if abs(a[m]) > FLAT * abs(b[m]):
            slope, half = -b[m] / a[m], 1.0 / abs(a[m])
            if slope * x - half > lower:
                lower, lower_slope = slope * x - half, slope
            if slope * x + half < upper:
                upper, upper_slope = slope * x + half, slope
    return lower, lower_slope, upper, upper_slope
