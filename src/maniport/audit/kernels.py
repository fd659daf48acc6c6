"""Compiled loops of audits."""

from maniport.util.jit import kernel


@kernel
def fill_speed_extents(generators, directions, extents):
    """Fill the extents (n,) of zonotopes along unit directions (n, 3).

    The generators (n, 3, k) are velocities of an end effector by each joint at its limit. By duality the extent along u
    is the minimum of Σ_i |wᵀ c_i| / |wᵀ u| over the normals w = c_i × c_j of the faces; zero where the zonotope is flat
    and u leaves its plane.
    """
    count = generators.shape[2]
    for n in range(len(generators)):
        c = generators[n]
        u = directions[n]
        largest = 0.0
        for i in range(count):
            for axis in range(3):
                largest = max(largest, abs(c[axis, i]))
        least = largest * largest * 1e-12
        smallest = 1e300
        for i in range(count):
            for j in range(i + 1, count):
                x = c[1, i] * c[2, j] - c[2, i] * c[1, j]
                y = c[2, i] * c[0, j] - c[0, i] * c[2, j]
                z = c[0, i] * c[1, j] - c[1, i] * c[0, j]
                if abs(x) + abs(y) + abs(z) <= least:
                    continue
                along = abs(x * u[0] + y * u[1] + z * u[2])
                if along <= least:
                    continue
                across = 0.0
                for k in range(count):
                    across += abs(x * c[0, k] + y * c[1, k] + z * c[2, k])
                smallest = min(smallest, across / along)
        extents[n] = smallest
