"""Scrambled Sobol sequences as SciPy draws them, without the second that `scipy.stats` takes to load.

Direction numbers: Joe and Kuo, Constructing Sobol sequences with better two-dimensional projections, SIAM J. Sci.
Comput. 30, 2008. Scrambling: Matoušek, On the L2-discrepancy for anchored boxes, J. Complexity 14, 1998.
"""

import numpy as np
from numpy.typing import NDArray

from maniport.util.validation import Array

BITS = 30  # of each coordinate
POLYNOMIALS = (1, 3, 7, 11, 13, 19, 25, 37, 41, 47, 55, 59, 61, 67, 91, 97)
FIRST_NUMBERS: tuple[tuple[int, ...], ...] = (
    (),
    (1,),
    (1, 3),
    (1, 3, 1),
    (1, 1, 1),
    (1, 1, 3, 3),
    (1, 3, 5, 13),
    (1, 1, 5, 5, 17),
    (1, 1, 5, 5, 5),
    (1, 1, 7, 11, 19),
    (1, 1, 5, 1, 1),
    (1, 1, 1, 3, 11),
    (1, 3, 5, 5, 31),
    (1, 3, 3, 9, 7, 49),
    (1, 1, 1, 15, 21, 21),
    (1, 3, 1, 13, 27, 49),
)


def sobol(dimension: int, exponent: int, generator: np.random.Generator) -> Array:
    """Draw the first 2^exponent points of a scrambled Sobol sequence in [0, 1), shape (2^exponent, dimension)."""
    if dimension > len(POLYNOMIALS):
        from scipy.stats import qmc  # slow to load

        return np.asarray(qmc.Sobol(dimension, rng=generator).random_base2(exponent))

    generator = generator.spawn(1)[0]
    weights = 1 << np.arange(BITS)
    shift_bits = generator.integers(2, size=(dimension, BITS), dtype=np.uint32)
    shift = shift_bits @ weights
    scrambling = np.tril(generator.integers(2, size=(dimension, BITS, BITS), dtype=np.uint32))
    scrambling[:, range(BITS), range(BITS)] = 1

    # binary digits, the most significant first, are multiplied by a matrix modulo 2
    significance = weights[::-1]
    digits = (_direction_numbers(dimension)[:, None] & significance[:, None]) != 0
    scrambled_digits = scrambling.astype(np.int64) @ digits % 2
    directions = significance @ scrambled_digits

    index = np.arange(1 << exponent)
    gray_code = index ^ (index >> 1)
    points = np.tile(shift, (len(index), 1))
    for bit in range(exponent):
        chosen = (gray_code >> bit) & 1 == 1
        points[chosen] ^= directions[:, bit]
    return points / float(1 << BITS)


def _direction_numbers(dimension: int) -> NDArray[np.int64]:
    """Direction numbers of as many dimensions, shape (dimension, BITS), scaled to 2^BITS."""
    numbers = np.ones((dimension, BITS), dtype=np.int64)
    for row in range(1, dimension):
        polynomial = POLYNOMIALS[row]
        degree = polynomial.bit_length() - 1
        numbers[row, :degree] = FIRST_NUMBERS[row]
        for j in range(degree, BITS):
            number = numbers[row, j - degree]
            for k in range(1, degree + 1):
                if (polynomial >> (degree - k)) & 1:
                    number ^= numbers[row, j - k] << k
            numbers[row, j] = number
    return numbers << np.arange(BITS - 1, -1, -1)
