"""The paper's matching by trying every pair, as fast as a plain loop goes.

The exponentials are pulled out of the loop, exp(−|a − b|) = min(eᵃ e⁻ᵇ, e⁻ᵃ eᵇ), and the student's features are worked
on in blocks that stay in the fastest cache, so that the loop runs in vector instructions.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from maniport.transfer.icp.score import EllipsoidFeatures

Array = NDArray[np.float64]

BLOCK = 512
LANES = 8
EXPONENT_RANGE = 700.0
"""Beyond it the exponentials of shape features overflow."""


def match(teacher: EllipsoidFeatures, student: EllipsoidFeatures) -> tuple[NDArray[np.intp], Array]:
    """For every teacher ellipsoid the student ellipsoid with the largest score, and the score; shapes (n,)."""
    shapes = [one.shapes.T for one in (teacher, student)]
    both = np.concatenate(shapes, axis=1)
    middle = (both.min(axis=1, keepdims=True) + both.max(axis=1, keepdims=True)) / 2.0
    if np.abs(both - middle).max() > EXPONENT_RANGE:
        raise ValueError("the ellipsoids' conditions are too far apart for this peer")
    table_t, table_s = (
        np.concatenate([*one.directions.transpose(1, 2, 0), np.exp(shape - middle), np.exp(middle - shape)])
        for one, shape in zip((teacher, student), shapes, strict=True)
    )
    padded = np.zeros((10, -(-table_s.shape[1] // BLOCK) * BLOCK))
    padded[:, : table_s.shape[1]] = table_s
    index, score = np.zeros(table_t.shape[1], np.intp), np.full(table_t.shape[1], -1.0)
    _scan(table_t, padded, index, score)
    return index, score


@njit(cache=True, error_model="numpy", fastmath={"contract", "nnan", "nsz", "reassoc"})
def _scan(teacher, student, index, score):  # type: ignore[no-untyped-def]  # Numba infers the types
    block, value, lanes = np.empty((10, BLOCK)), np.empty(BLOCK), np.empty(LANES)
    for first in range(0, student.shape[1], BLOCK):
        block[:] = student[:, first : first + BLOCK]
        for i in range(teacher.shape[1]):
            a0, a1, a2 = teacher[0, i], teacher[1, i], teacher[2, i]
            b0, b1, b2 = teacher[3, i], teacher[4, i], teacher[5, i]
            up_p, up_v, down_p, down_v = teacher[6, i], teacher[7, i], teacher[8, i], teacher[9, i]
            for j in range(BLOCK):
                minor = a0 * block[0, j] + a1 * block[1, j] + a2 * block[2, j]
                major = b0 * block[3, j] + b1 * block[4, j] + b2 * block[5, j]
                condition = min(up_p * block[8, j], down_p * block[6, j])
                volume = min(up_v * block[9, j], down_v * block[7, j])
                value[j] = abs(minor) + abs(major) + (condition + volume)
            lanes[:] = -1.0
            for j in range(0, BLOCK, LANES):
                for lane in range(LANES):
                    lanes[lane] = max(lanes[lane], value[j + lane])
            if lanes.max() > score[i]:
                for j in range(BLOCK):
                    if value[j] > score[i]:
                        score[i], index[i] = value[j], first + j
