"""The maps of the live view, and their fits after changes of the base orientation."""

import threading

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import ParallelTransport
from maniport.arms import EllipsoidSpec
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError
from maniport.viewer.maps import LOADED, Maps, require_drawable

FEW = ("parallel-transport", "identity")


def test_an_adapter_file_keeps_its_base_orientation(arms, domains):
    adapter = ParallelTransport(damping=0.05).fit(*domains)
    maps, ellipsoid = Maps(*domains, loaded=adapter), domains[0][0]
    assert maps.names[0] == LOADED
    chosen = maps.fit(LOADED, Rotation.from_euler("xyz", [20, -40, 70], degrees=True).as_matrix())
    assert "base orientation" in chosen.notes[0]
    assert chosen.transform(ellipsoid.copy()) == pytest.approx(adapter.transform(ellipsoid), abs=1e-12)
    full = [sample_domain(arm, 64, 0, spec=EllipsoidSpec(part="full")) for arm in arms]
    with pytest.raises(InvalidInputError, match="6×6"):
        require_drawable(ParallelTransport(damping=0.1).fit(*full))


def test_all_methods_are_fitted_at_a_new_base_orientation(domains):
    maps = Maps(*domains, first=FEW)
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


def test_errors_of_fits_are_raised_by_the_maps(domains, monkeypatch):
    maps, gate = Maps(*domains, first=("identity",)), threading.Event()

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
