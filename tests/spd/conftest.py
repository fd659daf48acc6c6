import pytest


@pytest.fixture(scope="session")
def random_symmetric():
    """Make symmetric matrices of shape (*shape, d, d) with normal entries."""

    def make(rng, shape, d):
        matrices = rng.standard_normal((*shape, d, d))
        return 0.5 * (matrices + matrices.swapaxes(-1, -2))

    return make
