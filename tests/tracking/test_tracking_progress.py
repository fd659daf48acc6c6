"""Long work tells how far it is: every function that takes a while, and without changing what it finds."""

import numpy as np
import pytest
from joblib import parallel_config
from numpy.testing import assert_array_equal

from maniport.spd.regularization import Regularization
from maniport.tracking import StartBank, nearest_feasible, place_path, track
from maniport.tracking.follow import follower
from maniport.tracking.search import feasible, node_floor
from sizes import few_places

DAMPING = Regularization.absolute(0.003)
TIME = np.linspace(0.0, 1.0, 9)


@pytest.fixture(scope="module")
def works(panda):
    """One call of each function, by what it is about, and what to compare of its result."""
    joints = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5]) + 0.2 * np.sin(TIME)[:, None]
    profile, path = panda.manipulability(joints), panda.forward(joints)[:, :3, 3]
    common = {"damping": DAMPING, "bank": StartBank.build(panda, 1024)}
    along = {"path": path, **common}
    return {
        "track": lambda tell: track(panda, profile, time=TIME, progress=tell, **along).control_positions,
        "track, calmly": lambda tell: track(
            panda, profile, time=TIME, lm_damping=5.0, progress=tell, **along
        ).control_positions,
        "track from a start": lambda tell: track(
            panda, profile, time=TIME, start=joints[0], progress=tell, **along
        ).control_positions,
        "place": lambda tell: place_path(path, profile, panda, progress=tell, **common).joint_positions,
        "place as given": lambda tell: place_path(
            path, profile, panda, scale=1.0, yaw=0.0, offset=path.mean(axis=0), progress=tell, **common
        ).joint_positions,
        "search": lambda tell: nearest_feasible(panda, profile, progress=tell, **common).joint_positions,
    }  # fmt: skip


@pytest.fixture
def brief(monkeypatch):
    """Tell often, and search little: how good the results are does not matter here."""
    monkeypatch.setattr(follower, "TOLD_EACH", 20)
    for module in (feasible, node_floor):
        monkeypatch.setattr(module, "BLOCK", 3)
    with few_places():
        yield


@pytest.mark.parametrize(
    "name",
    ["track", "track, calmly", "track from a start", "place", "place as given", "search"],
)
def test_progress_moves_to_its_end_and_changes_nothing(works, brief, name):
    """One step from 0 to 1 that never runs backwards, moves on the way, ends with a fact; the result is the same."""
    told = []
    found = works[name](lambda step, fraction, fact="": told.append((step, fraction, fact)))
    fractions = [fraction for _, fraction, _ in told]
    assert len({step for step, _, _ in told}) == 1
    assert fractions[0] == 0.0
    assert fractions == sorted(fractions)
    assert sum(0.0 < fraction < 1.0 for fraction in fractions) >= 3
    assert fractions.count(1.0) == 1
    assert told[-1][2]
    assert_array_equal(found, works[name](None))


def test_progress_comes_back_from_other_workers(works, brief):
    """Blocks that two threads search for are told one by one."""
    told = []
    with parallel_config(backend="threading", n_jobs=2):
        works["search"](lambda step, fraction, fact="": told.append(fraction))
    assert told[1:-2] == pytest.approx([1 / 3, 2 / 3])


@pytest.mark.parametrize("name", ["track", "place", "search"])
def test_what_the_listener_raises_ends_the_work(works, brief, name):
    """An interruption from the one who is told is passed on, and nothing is told any more, from a solver neither."""
    told = []

    def interrupt(step, fraction, fact=""):
        told.append(fraction)
        if len(told) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        works[name](interrupt)
    assert len(told) == 3
