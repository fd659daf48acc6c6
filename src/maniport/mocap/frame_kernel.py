"""Compiled residuals of one frame and their derivatives, for the live view."""

import numpy as np

from maniport.util.jit import kernel, part


@kernel
def frame_terms(  # type: ignore[no-untyped-def]
    q, coupling, offset, products, places, slides, joints, vectors, ends, targets, weights, gradient, hessian
):
    """Add Jᵀr and JᵀJ of the residuals of `maniport.mocap.directions` to gradient and hessian; return |r|²."""
    dof, last, count, points = len(q), len(offset), len(joints), len(joints) - len(targets) + len(ends)
    turns, origins = np.zeros((last + 1, 3, 3)), np.zeros((last + 1, 3))
    along, places_of = np.zeros((last, 3)), np.zeros((last, 3))
    for i in range(3):
        turns[0, i, i] = 1.0
    for j in range(last):
        angle = offset[j]
        for k in range(dof):
            angle += coupling[j, k] * q[k]
        sine, versed = (0.0, 0.0) if slides[j] else (np.sin(angle), 1.0 - np.cos(angle))
        for a in range(3):
            for b in range(3):
                places_of[j, a] += turns[j, a, b] * places[j, 0, b]
                along[j, a] += turns[j, a, b] * places[j, 1, b]
            places_of[j, a] += origins[j, a]
            origins[j + 1, a] = places_of[j, a] + (angle * along[j, a] if slides[j] else 0.0)
            for b in range(3):
                for c in range(3):
                    part = products[j, 0, c, b] + sine * products[j, 1, c, b] + versed * products[j, 2, c, b]
                    turns[j + 1, a, b] += turns[j, a, c] * part
    values, slopes = np.zeros((count, 3)), np.zeros((count, 3, dof))
    for n in range(count):
        for a in range(3):
            for b in range(3):
                values[n, a] += turns[joints[n], a, b] * vectors[n, b]
            if n < points:
                values[n, a] += origins[joints[n], a]
        for j in range(joints[n]):
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                if slides[j]:
                    moved = along[j, a] if n < points else 0.0
                else:
                    at_b, at_c = (places_of[j, b], places_of[j, c]) if n < points else (0.0, 0.0)
                    moved = along[j, b] * (values[n, c] - at_c) - along[j, c] * (values[n, b] - at_b)
                for k in range(dof):
                    slopes[n, a, k] += moved * coupling[j, k]
    return add_residuals(values, slopes, points, ends, targets, weights, gradient, hessian)


@part
def add_residuals(values, slopes, points, ends, targets, weights, gradient, hessian):  # type: ignore[no-untyped-def]
    """The same for points (the first of the values) and directions whose derivatives are known."""
    dof = len(gradient)
    cost, slope = 0.0, np.empty((3, dof))
    for n in range(len(targets)):
        if weights[n] == 0.0:
            continue
        if n < len(ends):
            a, b = ends[n]
            unit = values[b] - values[a]
            length = np.sqrt(unit[0] * unit[0] + unit[1] * unit[1] + unit[2] * unit[2])
            unit /= length
            for k in range(dof):
                stretch = 0.0
                for i in range(3):
                    slope[i, k] = slopes[b, i, k] - slopes[a, i, k]
                    stretch += unit[i] * slope[i, k]
                for i in range(3):
                    slope[i, k] = (slope[i, k] - unit[i] * stretch) / length
        else:
            unit = values[points + n - len(ends)]
            slope[:] = slopes[points + n - len(ends)]
        square = weights[n] * weights[n]
        for i in range(3):
            off = unit[i] - targets[n, i]
            cost += square * off * off
            for k in range(dof):
                gradient[k] += square * off * slope[i, k]
                for m in range(dof):
                    hessian[k, m] += square * slope[i, k] * slope[i, m]
    return cost
