"""Progress of long functions."""

import numpy as np
import pytest

from maniport.spd.regularization import Regularization
from maniport.tracking import StartBank, nearest_feasible, place_path, track
from sizes import few_places

TIME = np.linspace(0.0, 2.0, 9)


@pytest.fixture(scope="module")
def calls(panda):
    """One call of each function."""
    joints = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5]) + 0.2 * np.sin(TIME)[:, None]
    profile, path = panda.manipulability(joints), panda.forward(joints)[:, :3, 3]
    common = {"damping": Regularization.absolute(0.003), "bank": StartBank.build(panda, 1024)}
    return {
        "track": lambda progress: track(
            panda, profile, time=TIME, path=path, start=joints[0], progress=progress, **common
        ),
        "place": lambda progress: place_path(path, profile, panda, progress=progress, **common),
        "search": lambda progress: nearest_feasible(panda, profile, progress=progress, **common),
    }


@pytest.mark.parametrize("name", ["track", "place", "search"])
def test_progress_moves_from_0_to_1_and_ends_with_a_fact(calls, name):
    """One step that never runs backwards; what the listener raises ends the work."""
    reports = []
    with few_places():
        calls[name](lambda step, fraction, fact="": reports.append((step, fraction, fact)))
    steps, fractions, facts = zip(*reports, strict=True)
    assert len(set(steps)) == 1
    assert fractions[0] == 0.0
    assert list(fractions) == sorted(fractions)
    assert fractions.count(1.0) == 1
    assert facts[-1]

    def interrupt(step, fraction, fact=""):
        if fraction > 0.0:
            raise KeyboardInterrupt

    with few_places(), pytest.raises(KeyboardInterrupt):
        calls[name](interrupt)
