"""The maps of the live view, and their fits when the base orientation is dragged."""

import threading

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import ParallelTransport
from maniport.arms import EllipsoidSpec
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError
from maniport.viewer.maps import GIVEN, require_drawable

TURN = Rotation.from_euler("xyz", [20, -40, 70], degrees=True).as_matrix()
FEW = ("parallel-transport", "identity")


def test_a_given_adapter_keeps_its_base_orientation(arms, make_maps):
    """An adapter from a file maps alike at any base rotation, and says so; it must map 3×3 ellipsoids."""
    teacher, student, some = (
        sample_domain(arms[0], 256, 0),
        sample_domain(arms[1], 512, 1),
        sample_domain(arms[0], 8, 5),
    )
    adapter = ParallelTransport(damping=0.05).fit(teacher, student)
    maps = make_maps(given=adapter)
    assert maps.names[0] == GIVEN
    chosen = maps.fit(GIVEN, TURN)
    assert "base orientation" in chosen.notes[0]
    assert chosen.transform(some[0].copy()) == pytest.approx(adapter.transform(some[0]), abs=1e-12)
    full = [sample_domain(arm, 64, 0, spec=EllipsoidSpec(part="full")) for arm in arms]
    with pytest.raises(InvalidInputError, match="6×6"):
        require_drawable(ParallelTransport(damping=0.1).fit(*full))


def test_dragging_the_base_orientation_fits_all_methods(make_maps):
    """Every method's map then belongs to the last base rotation; an equal one is not fitted again."""
    maps = make_maps(first=FEW)
    maps.names = maps._order = FEW
    try:
        before = maps.fitted
        maps.want(np.eye(3), "identity")
        assert maps._next() is None
        for angle in (10, 20, 30):
            wanted = Rotation.from_euler("z", angle, degrees=True).as_matrix()
            maps.want(wanted, "identity")
        assert maps.settle()
        for name, chosen in maps.fitted.items():
            assert chosen is not before[name]
            assert chosen.base_rotation == pytest.approx(wanted)
    finally:
        maps.close()


def test_errors_of_fits_are_raised_by_the_maps(make_maps, monkeypatch):
    """Those of the thread, too."""
    maps, gate = make_maps(first=("identity",)), threading.Event()

    def fail(name, base_rotation):
        assert gate.wait(60.0)
        raise InvalidInputError("no such thing")

    monkeypatch.setattr(maps, "fit", fail)
    maps.begin()
    assert set(maps.fitted) == {"identity"}
    gate.set()
    maps.settle()
    with pytest.raises(InvalidInputError, match="no such thing"):
        _ = maps.fitted
    maps.close()
