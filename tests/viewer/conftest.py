import contextlib
import threading
from concurrent.futures import Future

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from headless_chromium import browser  # noqa: F401 - a fixture
from maniport import load_arm
from maniport.arms import VELOCITY
from maniport.motion import Placement
from maniport.pipeline.config import Config
from maniport.pipeline.transfer import Transfer
from maniport.transfer import METHODS
from maniport.viewer.state import Fits, Side, ViewState


@pytest.fixture(scope="session")
def arms():
    return load_arm("rhuman"), load_arm("panda")


@pytest.fixture(scope="session")
def transfer():
    return Transfer.of(Config(robot=("panda",), n_teacher=256, n_student=512))


@pytest.fixture(scope="session")
def place():
    zeros = np.zeros(1)
    turn = np.eye(3)
    return Placement(
        path=np.zeros((1, 3)),
        profile=turn[None],
        spec=VELOCITY,
        distance=zeros,
        position_error=zeros,
        joint_positions=np.zeros((1, 7)),
        scale=0.5,
        yaw=0.0,
        tilt=0.0,
        heading=0.0,
        base_orientation=turn,
        map_rotation=turn,
        offset=np.array([0.4, 0.0, 0.4]),
        center=np.zeros(3),
    )


@pytest.fixture(scope="session")
def make_state(arms, transfer, place):
    first = Fits(transfer, arms[:1])
    for name in METHODS:
        first.get(name, np.eye(3))
    for fit in first.fits.values():
        fit.result(600.0)
    bank = transfer.robot.bank(0, VELOCITY)

    def make(recorded=False):
        playback = None
        if recorded:
            path = np.linspace(arms[0].sample(1, 1)[0], arms[0].sample(1, 2)[0], 5)
            playback = make_interp_spline(np.linspace(0.0, 2.0, 5), path, k=1)
        fits = Fits(transfer, arms[:1])
        fits.fits |= first.fits
        state = ViewState(arms[1], [Side(*arms, bank, np.zeros(3))], fits, playback)
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
