import contextlib
import threading
from concurrent.futures import Future

import numpy as np
import pytest

from headless_chromium import browser  # noqa: F401 - a fixture
from maniport import load_arm
from maniport.arms import VELOCITY
from maniport.domain import sample_domain
from maniport.motion import Placement, SeedBank
from maniport.viewer.state import Maps, Playback, Side, ViewState


@pytest.fixture(scope="session")
def arms():
    return load_arm("rhuman"), load_arm("panda")


@pytest.fixture(scope="session")
def domains(arms):
    return sample_domain(arms[0], 256, 0), sample_domain(arms[1], 512, 1)


@pytest.fixture(scope="session")
def place():
    point = {"path": np.zeros((1, 3)), "profile": np.eye(3)[None], "pointwise_best": np.zeros(1), "spec": VELOCITY}
    point |= {"planned_distance": np.zeros(1)}
    point |= {"position_error": np.zeros(1), "joint_positions": np.zeros((1, 7))}
    point |= {
        "scale": 0.5,
        "yaw": 0.0,
        "tilt": 0.0,
        "heading": 0.0,
        "base_orientation": np.eye(3),
        "map_rotation": np.eye(3),
    }
    return Placement(**point, offset=np.array([0.4, 0.0, 0.4]), center=np.zeros(3))


@pytest.fixture(scope="session")
def make_state(arms, domains, place):
    first = Maps(*domains)
    fitted = {(name, np.eye(3).tobytes()): first.fit(name, np.eye(3)) for name in first.names}
    bank = SeedBank(arms[1], 2048, 0)

    def make(maps=None, recorded=False):
        playback = None
        if recorded:
            path = np.linspace(arms[0].sample(1, 1)[0], arms[0].sample(1, 2)[0], 5)
            playback = Playback(np.linspace(3.0, 5.0, 5), path)
        if maps is None:
            maps = Maps(*domains)
            maps._fitted |= fitted
            maps._last = next(iter(fitted.values()))
        state = ViewState(arms[1], [Side(*arms, maps, bank)], playback)
        state.places = Future()
        state.places.set_result([place])
        return state

    return make


@pytest.fixture
def running():
    @contextlib.contextmanager
    def run(view):
        stop = threading.Event()
        loop = threading.Thread(target=view.run, args=(stop,))
        loop.start()
        try:
            yield
        finally:
            stop.set()
            loop.join(60.0)
        assert not loop.is_alive()

    return run
