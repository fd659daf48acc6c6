"""Random matrices for the tests of the space of SPD matrices."""

import numpy as np
import pytest


@pytest.fixture(scope="session")
def random_spd():
    """Make SPD matrices of shape (*shape, d, d) with a given condition number and random axes."""

    def make(rng, shape, d, condition=1e3):
        basis = np.linalg.qr(rng.standard_normal((*shape, d, d)))[0]
        exponent = rng.uniform(-0.5, 0.5, (*shape, d))
        exponent[..., 0], exponent[..., -1] = -0.5, 0.5
        matrices = (basis * condition ** exponent[..., None, :]) @ np.swapaxes(basis, -1, -2)
        return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))

    return make


@pytest.fixture(scope="session")
def random_symmetric():
    """Make symmetric matrices of shape (*shape, d, d) with normal entries."""

    def make(rng, shape, d):
        matrices = rng.standard_normal((*shape, d, d))
        return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))

    return make
