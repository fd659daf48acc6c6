"""Random matrices and domains for the tests of transfer."""

import numpy as np
import pytest
from scipy.stats import special_ortho_group

from maniport import spd


def _spd(rng, n, d, condition=1e2):
    basis = np.linalg.qr(rng.standard_normal((n, d, d)))[0]
    exponent = rng.uniform(-0.5, 0.5, (n, d))
    exponent[:, 0], exponent[:, -1] = -0.5, 0.5
    matrices = (basis * condition ** exponent[:, None, :]) @ np.swapaxes(basis, -1, -2)
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


def _singular(rng, n, d):
    factor = rng.standard_normal((n, d, d - 1)) * np.linspace(1.0, 2.0, d)[:, None]
    return factor @ np.swapaxes(factor, -1, -2)


def _rotation(rng, d):
    return special_ortho_group.rvs(d, random_state=rng)


@pytest.fixture(scope="session")
def random_spd():
    """Make n SPD matrices with a given condition number and random axes."""
    return _spd


@pytest.fixture(scope="session")
def random_singular():
    """Make n positive semidefinite matrices of rank d - 1."""
    return _singular


@pytest.fixture(scope="session")
def random_rotation():
    """Make one rotation matrix."""
    return _rotation


@pytest.fixture(scope="session")
def random_map():
    """Make a map of the model's class from a teacher's domain: its own mean, a random rotation, ratio and new mean."""
    from maniport.transfer.rigid_adapter import RigidMap

    def make(rng, teacher, ratio=None):
        d = teacher.shape[-1]
        chosen = rng.uniform(0.5, 2.0) if ratio is None else ratio
        return RigidMap(spd.mean(teacher), _spd(rng, 1, d)[0], _rotation(rng, d), chosen)

    return make
