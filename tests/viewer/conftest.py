"""A small live view that is made in a moment."""

import contextlib
import threading

import numpy as np
import pytest

from headless_chromium import browser  # noqa: F401 - a fixture
from maniport import load_arm
from maniport.arms import VELOCITY
from maniport.domain import sample_domain
from maniport.motion import Placement, SeedBank
from maniport.viewer.maps import Methods, Refitting
from maniport.viewer.playback import Playback
from maniport.viewer.state import Side, ViewState


@pytest.fixture(scope="session")
def arms():
    """A person's arm and a robot's."""
    return load_arm("rhuman"), load_arm("panda")


@pytest.fixture(scope="session")
def bank(arms):
    """Starts of the robot."""
    return SeedBank.build(arms[1], 2048, 0)


@pytest.fixture(scope="session")
def methods(arms):
    """All methods, on small domains."""
    return Methods(sample_domain(arms[0], 256, 0), sample_domain(arms[1], 512, 1))


@pytest.fixture(scope="session")
def place():
    """A placement in front of the robot, where half as large a path lies."""
    point = {"path": np.zeros((1, 3)), "profile": np.eye(3)[None], "distance": np.zeros(1), "spec": VELOCITY}
    point |= {"position_error": np.zeros(1), "reachable": np.ones(1, dtype=bool), "joint_positions": np.zeros((1, 7))}
    point |= {"scale": 0.5, "yaw": 0.0, "tilt": 0.0, "heading": 0.0, "mount": np.eye(3), "turn": np.eye(3)}
    return Placement(**point, offset=np.array([0.4, 0.0, 0.4]), centre=np.zeros(3))


@pytest.fixture(scope="session")
def all_maps(methods):
    """Maps of all methods at the identity, fitted once."""
    return {name: methods.fit(name, np.eye(3)) for name in methods.names}


@pytest.fixture(scope="module")
def make_state(arms, bank, methods, all_maps, place):
    """Make a state, of other methods or with a recording; its threads end with the module."""
    made = []

    def make(methods=methods, recorded=False):
        playback = None
        if recorded:
            path = np.linspace(arms[0].sample(1, 1)[0], arms[0].sample(1, 2)[0], 5)
            playback = Playback(np.linspace(3.0, 5.0, 5), path)
        known = all_maps if methods.names == tuple(all_maps) else None
        refitting = Refitting(methods, np.eye(3), None if known is None else ())
        if known is not None:
            refitting._maps, refitting._todo = dict(known), []
        side = Side(*arms, refitting, bank, place)
        made.append(ViewState(arms[1], [side], playback))
        return made[-1]

    yield make
    for state in made:
        state.sides[0].refitting.close()


@pytest.fixture
def running():
    """A context that runs the loop of a view."""

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
