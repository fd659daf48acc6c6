"""The logarithm of a symmetric positive-definite matrix as a CasADi expression that is smooth everywhere.

Eigenvalues have no derivative where two of them meet, and their closed forms lose digits there. Instead, the integral

    log X = ∫₀¹ (X − I) (I + t (X − I))⁻¹ dt = ∫₀¹ (I − (I + t (X − I))⁻¹) / t dt

is taken by a sum over fixed nodes (tanh-sinh rule: Takahasi & Mori, Publ. RIMS 9, 1974), a rational function of X.
"""

from typing import Any

import numpy as np

from maniport.optional import casadi
from maniport.validation import Array

NODES = 12
"""Nodes on either side of the middle: errors of 1e-7, 3e-5 and 1e-4 up to eigenvalues of 10, 100 and 1000, and their
inverses. X is the arm's ellipsoid seen from the wanted one: eigenvalues near one matter most."""
SPAN = 3.2


def log_vector(x: Any) -> Any:
    """Mandel vector of log X for a symmetric positive-definite expression X, 3×3 or 6×6; shape (m, 1)."""
    ca = casadi()

    d = x.shape[0]
    total, eye = ca.SX.zeros(d, d), ca.DM.eye(d)
    for t, weight in zip(*_rule(), strict=True):
        total += (weight / t) * (eye - _inverse(eye + t * (x - eye)))
    rows, columns = np.triu_indices(d, 1)
    off = [np.sqrt(2.0) * total[int(i), int(j)] for i, j in zip(rows, columns, strict=True)]
    return ca.vertcat(*(total[i, i] for i in range(d)), *off)


def _rule() -> tuple[Array, Array]:
    """Nodes in (0, 1) and weights."""
    steps = np.arange(-NODES, NODES + 1) * SPAN / NODES
    bent = 0.5 * np.pi * np.sinh(steps)
    weights = SPAN / NODES * 0.25 * np.pi * np.cosh(steps) / np.cosh(bent) ** 2
    return 1.0 / (1.0 + np.exp(-2.0 * bent)), weights


def _inverse(x: Any) -> Any:
    """Inverse of a symmetric 3×3 or 6×6 matrix: by cofactors, and by blocks of 3."""
    ca = casadi()

    if x.shape[0] == 3:
        a, b, c, d, e, f = x[0, 0], x[0, 1], x[0, 2], x[1, 1], x[1, 2], x[2, 2]
        first = ca.vertcat(d * f - e * e, c * e - b * f, b * e - c * d)
        det = a * first[0] + b * first[1] + c * first[2]
        other = ca.vertcat(a * f - c * c, b * c - a * e, a * d - b * b)
        rows = [[first[0], first[1], first[2]], [first[1], other[0], other[1]], [first[2], other[1], other[2]]]
        return ca.vertcat(*(ca.horzcat(*row) for row in rows)) / det
    top, side, bottom = x[:3, :3], x[:3, 3:], x[3:, 3:]
    inverse = _inverse(top)
    carried = ca.mtimes(inverse, side)
    corner = _inverse(bottom - ca.mtimes(side.T, carried))
    beside = -ca.mtimes(carried, corner)
    return ca.vertcat(ca.horzcat(inverse - ca.mtimes(beside, carried.T), beside), ca.horzcat(beside.T, corner))
