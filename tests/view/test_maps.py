"""The maps that the live view switches between, and their refits when the mounting is dragged."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import ParallelTransport
from maniport.bodies import EllipsoidSpec
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError
from maniport.transfer import METHODS
from maniport.view.maps import AS_FOUND, GIVEN, Methods, Refitting

TURN = Rotation.from_euler("xyz", [20, -40, 70], degrees=True).as_matrix()


@pytest.fixture(scope="module")
def domains(arms):
    """Small domains of both arms, and ellipsoids of the person that are not in them."""
    return sample_domain(arms[0], 256, 0), sample_domain(arms[1], 512, 1), sample_domain(arms[0], 8, 5)


def test_every_method_of_transfer_is_offered(methods):
    """A method that is added to the library is there without being named in the live view."""
    assert set(methods.names) == {AS_FOUND, *METHODS}


def test_a_raw_copy_is_the_ellipsoid_in_the_other_axes(methods, domains):
    """Without a method, the mounting turns the ellipsoid and nothing else happens."""
    ellipsoid = domains[2][0]
    assert methods.fit("raw-copy", np.eye(3)).transform(ellipsoid) == pytest.approx(ellipsoid, abs=1e-6)
    assert methods.fit("raw-copy", TURN).transform(ellipsoid) == pytest.approx(TURN @ ellipsoid @ TURN.T, abs=1e-6)


@pytest.mark.parametrize("name", ["parallel-transport", "nearest-neighbor"])
def test_maps_are_those_of_the_library(methods, domains, name):
    """At the identity, a map gives what its adapter gives."""
    teacher, student, some = domains
    known = METHODS[name]().get_params()
    options = {"mounting": np.eye(3)} if "mounting" in known else {}
    adapter = METHODS[name](damping=0.01, **options).fit(teacher, student)
    chosen = methods.fit(name, np.eye(3))
    assert np.array([chosen.transform(one) for one in some]) == pytest.approx(adapter.transform(some), abs=1e-12)


@pytest.mark.parametrize("name", [AS_FOUND, *METHODS])
def test_a_person_in_other_axes_makes_no_difference(domains, methods, bank, name):
    """Turning all of the person's ellipsoids and taking the turn back by the mounting gives the same map."""
    teacher, student, some = domains
    turned = Methods(TURN.T @ teacher @ TURN, student).fit(name, TURN)
    plain = methods.fit(name, np.eye(3))
    for one in some:
        seen = TURN.T @ one @ TURN
        image = turned.transform(0.5 * (seen + seen.T))
        assert image == pytest.approx(plain.transform(one), abs=2e-5)


def test_a_given_adapter_keeps_its_mounting(domains, bank):
    """An adapter from a file maps alike wherever the mounting is dragged to, and says so."""
    teacher, student, some = domains
    adapter = ParallelTransport(damping=0.05).fit(teacher, student)
    methods = Methods(teacher, student, given=adapter)
    assert methods.names[0] == GIVEN
    chosen = methods.fit(GIVEN, TURN)
    assert "keeps the mounting" in chosen.ending
    assert chosen.transform(some[0].copy()) == pytest.approx(adapter.transform(some[0]), abs=1e-12)


def test_an_adapter_of_another_size_is_refused(arms, domains, bank):
    """The view shows ellipsoids of motion in space; others cannot be drawn."""
    full = [sample_domain(arm, 64, 0, spec=EllipsoidSpec(part="full")) for arm in arms]
    with pytest.raises(InvalidInputError, match="6×6"):
        Methods(*domains[:2], given=ParallelTransport(damping=0.1).fit(*full))


def test_what_a_fit_warns_of_is_kept(methods):
    """Warnings of a fit become notes to show, instead of lines on a terminal that nobody looks at."""
    notes = [note for name in methods.names for note in methods.fit(name, np.eye(3)).notes]
    assert all(isinstance(note, str) for note in notes)


def test_dragging_the_mounting_refits_all_methods(methods):
    """After a drag, every method's map belongs to the last mounting that was wanted."""
    refitting = Refitting(methods, np.eye(3))
    try:
        before = refitting.maps
        for angle in (10, 20, 30):
            wanted = Rotation.from_euler("z", angle, degrees=True).as_matrix()
            refitting.want(wanted, "icp")
        assert refitting.settle()
        assert not refitting.busy
        for name, chosen in refitting.maps.items():
            assert chosen is not before[name]
            assert chosen.mounting == pytest.approx(wanted)
    finally:
        refitting.close()


def test_the_same_mounting_is_not_fitted_again(methods):
    """Standing still costs nothing."""
    refitting = Refitting(methods, TURN)
    before = refitting.maps
    refitting.want(TURN.copy(), "icp")
    assert not refitting.busy
    assert all(refitting.maps[name] is chosen for name, chosen in before.items())


def test_what_goes_wrong_in_a_refit_is_told(domains, bank, monkeypatch):
    """An error in the thread that fits comes out where the maps are asked for."""
    methods = Methods(*domains[:2])
    refitting = Refitting(methods, np.eye(3))

    def fail(name, mounting):
        raise InvalidInputError("no such thing")

    monkeypatch.setattr(methods, "fit", fail)
    refitting.want(TURN, "icp")
    refitting.settle()
    with pytest.raises(InvalidInputError, match="no such thing"):
        _ = refitting.maps
    refitting.close()


def test_a_mounting_that_is_no_rotation_is_refused(methods):
    """A matrix that mirrors or stretches is no mounting."""
    refitting = Refitting(methods, np.eye(3))
    with pytest.raises(InvalidInputError, match="mounting"):
        refitting.want(np.diag([1.0, 1.0, -1.0]), "icp")
