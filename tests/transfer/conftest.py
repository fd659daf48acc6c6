import numpy as np
import pytest
from scipy.stats import special_ortho_group

from maniport import spd
from maniport.transfer.rigid_adapter import RigidMap


@pytest.fixture(scope="session")
def random_singular():
    """Make n positive semidefinite matrices of rank d - 1."""

    def make(rng, n, d):
        factor = rng.standard_normal((n, d, d - 1)) * np.linspace(1.0, 2.0, d)[:, None]
        return factor @ np.swapaxes(factor, -1, -2)

    return make


@pytest.fixture(scope="session")
def random_rotation():
    return lambda rng, d: special_ortho_group.rvs(d, random_state=rng)


@pytest.fixture(scope="session")
def random_map(random_spd, random_rotation):
    """Make a map of the model's class from a teacher's domain: its own mean, a random rotation, ratio and new mean."""

    def make(rng, teacher):
        d = teacher.shape[-1]
        ratio = rng.uniform(0.5, 2.0)
        return RigidMap(spd.mean(teacher), random_spd(rng, 1, d)[0], random_rotation(rng, d), ratio)

    return make
