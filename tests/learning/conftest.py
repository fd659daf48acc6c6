import numpy as np
import pytest

from maniport import spd


def _truth(time):
    parts = [
        np.sin(2 * time),
        np.cos(3 * time),
        0.5 * time,
        0.4 * np.sin(5 * time),
        0.3 * np.cos(4 * time),
        0.2 * time,
    ]
    return spd.expm(spd.from_vector(np.stack(parts, axis=-1)))


def _scatter(centers, deviations):
    """Ellipsoids at whitened Mandel coordinates `deviations` (..., n, m) about centers (n, d, d)."""
    root = spd.powm(centers, 0.5)
    return root @ spd.expm(spd.from_vector(deviations)) @ root


@pytest.fixture(scope="session")
def truth():
    return _truth


@pytest.fixture(scope="session")
def scatter():
    return _scatter


@pytest.fixture(scope="session")
def demonstrate():
    """Make k demonstrations (k, n, 3, 3) of the profile with a standard deviation that may depend on time."""

    def make(rng, k, time, amplitude, smooth=False):
        noise = rng.standard_normal((k, len(time), 6))
        if smooth:
            kernel = np.exp(-0.5 * ((time[:, None] - time) / 0.2) ** 2) + 1e-8 * np.eye(len(time))
            noise = np.linalg.cholesky(kernel) @ noise
        return _scatter(_truth(time), noise * np.broadcast_to(amplitude, time.shape)[:, None])

    return make
