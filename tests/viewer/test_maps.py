"""The maps of the live view, and their fits when the base orientation is dragged."""

import threading

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import ParallelTransport
from maniport.arms import EllipsoidSpec
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError
from maniport.viewer.maps import GIVEN, Methods, Refitting

TURN = Rotation.from_euler("xyz", [20, -40, 70], degrees=True).as_matrix()


@pytest.fixture(scope="module")
def domains(arms):
    """Small domains of both arms, and ellipsoids of the person that are not in them."""
    return sample_domain(arms[0], 256, 0), sample_domain(arms[1], 512, 1), sample_domain(arms[0], 8, 5)


def test_a_given_adapter_keeps_its_mounting(arms, domains):
    """An adapter from a file maps alike at any base_rotation, and says so; it must map 3×3 ellipsoids."""
    teacher, student, some = domains
    adapter = ParallelTransport(damping=0.05).fit(teacher, student)
    methods = Methods(teacher, student, given=adapter)
    assert methods.names[0] == GIVEN
    chosen = methods.fit(GIVEN, TURN)
    assert "base orientation" in chosen.notes[0]
    assert chosen.transform(some[0].copy()) == pytest.approx(adapter.transform(some[0]), abs=1e-12)
    full = [sample_domain(arm, 64, 0, spec=EllipsoidSpec(part="full")) for arm in arms]
    with pytest.raises(InvalidInputError, match="6×6"):
        Methods(teacher, student, given=ParallelTransport(damping=0.1).fit(*full))


class Few:
    """Two methods of others."""

    names = ("parallel-transport", "identity")

    def __init__(self, methods):
        self.fit = methods.fit


def test_dragging_the_mounting_fits_all_methods(methods):
    """Every method's map then belongs to the last base_rotation; the same base_rotation is not fitted again."""
    refitting = Refitting(Few(methods), np.eye(3))
    try:
        before = refitting.maps
        refitting.want(np.eye(3), "identity")
        assert not refitting.busy
        for angle in (10, 20, 30):
            wanted = Rotation.from_euler("z", angle, degrees=True).as_matrix()
            refitting.want(wanted, "identity")
        assert refitting.settle()
        for name, chosen in refitting.maps.items():
            assert chosen is not before[name]
            assert chosen.base_rotation == pytest.approx(wanted)
        with pytest.raises(InvalidInputError, match="base_rotation"):
            refitting.want(np.diag([1.0, 1.0, -1.0]), "identity")
    finally:
        refitting.close()


def test_errors_of_fits_are_raised_by_the_maps(methods):
    """Those of the thread, too."""
    few, gate = Few(methods), threading.Event()
    refitting = Refitting(few, np.eye(3), first=("identity",))

    def fail(name, base_rotation):
        assert gate.wait(60.0)
        raise InvalidInputError("no such thing")

    few.fit = fail
    refitting.begin()
    assert set(refitting.maps) == {"identity"}
    gate.set()
    refitting.settle()
    with pytest.raises(InvalidInputError, match="no such thing"):
        _ = refitting.maps
    refitting.close()
