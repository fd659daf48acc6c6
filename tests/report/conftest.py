"""A motion to draw."""

import numpy as np
import pytest

from headless_chromium import axe, browser  # noqa: F401 - fixtures
from maniport import spd


@pytest.fixture(scope="session")
def motion():
    """Make times with a pause in the recording, and a smooth profile of d×d ellipsoids."""

    def make(d=3, count=60):
        time = np.linspace(0.0, 4.0, count)
        time[count // 2 :] += 1.5
        swing = np.sin(np.linspace(0, 3, count))[:, None, None] * np.arange(d * d).reshape(d, d) / d**2
        shear = np.cos(np.linspace(0, 2, count))[:, None, None] * np.eye(d)[::-1]
        tangents = 0.5 * (swing + np.swapaxes(swing, 1, 2)) + 0.4 * shear
        return time, spd.expm(tangents + np.diag(np.linspace(-2.0, -0.5, d)))

    return make
