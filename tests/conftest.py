"""Settings for every test, and results of the main job that tests of several packages share.

Property-based tests draw the same few examples on every machine and have no deadline; with
``HYPOTHESIS_PROFILE=long`` in the environment they draw ten times as many, other ones every time.
"""

import os
import sys

import pytest
from hypothesis import HealthCheck, settings

from sizes import SMALL, little_search

pytest_plugins = ("skipped_tests",)

no_clock = {
    "deadline": None,
    "suppress_health_check": [HealthCheck.too_slow],
}  # a machine may be busy
settings.register_profile("maniport", derandomize=True, max_examples=15, **no_clock)
settings.register_profile("long", derandomize=False, max_examples=150, **no_clock)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "maniport"))


@pytest.fixture(scope="session")
def panda():
    """The Panda to its flange."""
    from maniport import load_arm

    return load_arm("panda", frame="panda_link8")


@pytest.fixture(scope="session")
def second():
    """One second of the shipped ladder recording."""
    from maniport.mocap import read_recording, shipped_recording

    return read_recording(shipped_recording("ladder")).crop(10, 11)


@pytest.fixture(scope="session")
def small_result(second):
    """Result of a small transfer with a motion at half the speed; computed once."""
    from maniport.pipeline import transfer_recording

    with little_search():
        return transfer_recording(second, speed_scale=0.5, **SMALL)


@pytest.fixture(scope="session")
def two_arm_result():
    """Result of a third of a second for two Pandas side by side; computed once."""
    from maniport import load_arms, read_recording
    from maniport.pipeline import transfer_recording

    arms = load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])
    recording = read_recording("both-arms").crop(5.1, 5.4)
    with little_search():
        return transfer_recording(recording, robot=arms, method="parallel-transport", **SMALL)


@pytest.fixture(scope="session")
def repeated():
    """A person who reaches out at 1.0, 2.2, 4.0 and 6.5 s."""
    import numpy as np

    from maniport.arms.human import human_arm
    from maniport.mocap import synthetic_recording

    time = np.arange(0.0, 8.0, 1 / 30)
    way = np.exp(-(((time[:, None] - np.array([1.0, 2.2, 4.0, 6.5])) / 0.25) ** 2)).sum(axis=1)[
        :, None
    ]
    rest = np.radians([40.0, 40.0, -20.0, 60.0, 5.0, 2.0, 5.0])
    reach = np.radians([20.0, 30.0, 10.0, -20.0, 0, 0, 0])
    return synthetic_recording(human_arm("myoarm"), rest + way * reach, time)


@pytest.fixture(scope="session")
def random_spd():
    """Make SPD matrices of shape (*shape, d, d), or n of them, with a given condition number and random axes."""
    import numpy as np

    def make(rng, shape, d, condition=1e2):
        shape = np.atleast_1d(np.array(shape, dtype=int))
        basis = np.linalg.qr(rng.standard_normal((*shape, d, d)))[0]
        exponent = rng.uniform(-0.5, 0.5, (*shape, d))
        exponent[..., 0] = -0.5
        exponent[..., -1] = 0.5
        matrices = (basis * condition ** exponent[..., None, :]) @ np.swapaxes(basis, -1, -2)
        return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))

    return make


@pytest.fixture
def run(monkeypatch, capsys):
    """Call the command line in this process; return exit code, standard output and standard error."""
    from maniport import cli

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["maniport", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        return int(stop.value.code or 0), *capsys.readouterr()

    return call
