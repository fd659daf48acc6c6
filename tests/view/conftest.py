"""A small live state that is made in a moment."""

import numpy as np
import pytest

from headless_chromium import browser  # noqa: F401 - a fixture
from maniport import load_arm
from maniport.bodies import VELOCITY
from maniport.domain import sample_domain
from maniport.tracking import PlacedPath, StartBank
from maniport.view.maps import Methods, Refitting
from maniport.view.state import LiveState, Playback


@pytest.fixture(scope="session")
def arms():
    """A person's arm and a robot's."""
    return load_arm("rhuman"), load_arm("panda")


@pytest.fixture(scope="session")
def bank(arms):
    """Starts of the robot."""
    return StartBank.build(arms[1], 2048, 0)


@pytest.fixture(scope="session")
def methods(arms, bank):
    """All methods, on small domains."""
    teacher, student = arms
    return Methods(sample_domain(teacher, 256, 0), sample_domain(student, 512, 1))


@pytest.fixture(scope="session")
def place():
    """A place in front of the robot, where half as large a path lies."""
    point = {"path": np.zeros((1, 3)), "profile": np.eye(3)[None], "distance": np.zeros(1), "spec": VELOCITY}
    point |= {"position_error": np.zeros(1), "reachable": np.ones(1, dtype=bool), "joint_positions": np.zeros((1, 7))}
    point |= {"scale": 0.5, "yaw": 0.0, "tilt": 0.0, "heading": 0.0, "mount": np.eye(3), "turn": np.eye(3)}
    return PlacedPath(**point, offset=np.array([0.4, 0.0, 0.4]), centre=np.zeros(3))


@pytest.fixture
def make_state(arms, bank, methods, place):
    """Make a live state, of other methods or with a recording where wanted; their threads end with the test."""
    made = []

    def make(methods=methods, recorded=False):
        playback = None
        if recorded:
            path = np.linspace(arms[0].sample(1, 1)[0], arms[0].sample(1, 2)[0], 5)
            playback = Playback(np.linspace(3.0, 5.0, 5), path)
        made.append(LiveState(*arms, Refitting(methods, np.eye(3)), place, bank, playback))
        return made[-1]

    yield make
    for state in made:
        state.refitting.close()
