import numpy as np
import pytest
from scipy.spatial.transform import Rotation


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.fixture(scope="session")
def make_cloud():
    """Make n SPD matrices about a center that is not round, so that their rotation can be told."""

    def make(rng, n, d=3, spread=0.5):
        noise = spread * rng.standard_normal((n, d, d)) * np.linspace(0.5, 1.5, d)
        values, vectors = np.linalg.eigh(0.5 * (noise + np.swapaxes(noise, -1, -2)))
        root = np.diag(np.exp(np.linspace(-0.5, 1.0, d)))
        matrices = root @ ((vectors * np.exp(values)[:, None, :]) @ np.swapaxes(vectors, -1, -2)) @ root
        return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))

    return make


@pytest.fixture(scope="session")
def turn_about():
    """Make the rotation by an angle [deg] about a coordinate axis."""
    return lambda angle, axis=2: Rotation.from_euler("xyz"[axis], angle, degrees=True).as_matrix()
