"""Model selection where no method is named: the length field if it passes its checks, else a transport."""

from dataclasses import replace

import numpy as np
import pytest

import maniport as mp
from maniport import spd
from maniport.errors import InvalidInputError, NotSPDError
from maniport.evaluation import domain_distance, evaluate, select_method
from maniport.evaluation.comparison import nearest_transport
from maniport.report import as_markdown, report_of
from maniport.studies.trajectories import human_evaluation
from maniport.transfer import method_of, name_of
from maniport.transfer.length_field.fit import FieldReport
from sizes import SIX_ROWS

SIX = mp.Arm.from_dh(
    "six", SIX_ROWS, -3.1, 3.1
)  # its length field reverses orientation in many places


@pytest.fixture(scope="module", params=["panda", "six"])
def chosen(request):
    """A choice for a person and a robot whose length field is good (Panda) or bad (six joints)."""
    person = mp.load_arm("rhuman")
    robot = mp.load_arm("panda") if request.param == "panda" else SIX
    domains = mp.sample_domain(person, 1024, 0), mp.sample_domain(robot, 2048, 1)
    path = np.zeros((5, 7))
    path[:, 1] = np.radians(90.0)
    path[:, 3] = np.radians(np.linspace(20.0, 110.0, 5))
    return request.param, select_method(
        *domains, person.manipulability(path), robot=robot, damping=0.01
    )


def test_a_bad_length_field_is_not_chosen(chosen):
    name, (adapter, table) = chosen
    method = "length-field" if name == "panda" else "parallel-transport"
    assert name_of(adapter) == table.adapter.name == table.recommended == method
    assert bool(table.rejected) is (name != "panda")
    assert {row.name for row in table.rows} == {
        "identity",
        "mean-transport",
        "parallel-transport",
        "scaled-transport",
        method,
    }
    gaps = {row.name: row.feasibility_gap for row in table.rows}
    assert gaps[method] is not None
    assert f"Selected {method.replace('-', ' ')}" in as_markdown(report_of(table))


@pytest.mark.parametrize(
    "worse",
    [{"reversing": 0.11}, {"nonmonotone": 0.04}, {"moved_axes": 0.06}, {"rank_correlation": 0.79}],
    ids=str,
)
def test_every_check_can_fail(worse):
    good = FieldReport(100, 0.0, 0.0, 0.8, 0.0, moved_axes=0.05, reversing=0.1, nonmonotone=0.03)
    assert good.failures() == ()
    assert len(replace(good, **worse).failures()) == 1


IRB140_ROWS = [
    [0, 0.352, 0.07, -np.pi / 2],
    [0, 0, 0.36, 0],
    [0, 0, 0, -np.pi / 2],
    [0, 0.38, 0, np.pi / 2],
    [0, 0, 0, -np.pi / 2],
    [0, 0.065, 0, 0],
]
IRB140_LOWER = np.radians([-180.0, -90.0, -230.0, -200.0, -115.0, -400.0])
IRB140_UPPER = np.radians([180.0, 110.0, 50.0, 200.0, 115.0, 400.0])


@pytest.mark.parametrize("motion", human_evaluation())
def test_evaluation_recommends_what_selection_takes(motion):
    """The criterion depends on the domains: it is the same for all motions and for every evaluated adapter."""
    person = mp.load_arm("rhuman")
    robot = mp.Arm.from_dh("irb140", IRB140_ROWS, IRB140_LOWER, IRB140_UPPER)
    domains = mp.sample_domain(person, 1024, 0), mp.sample_domain(robot, 2048, 1)
    profile = person.manipulability(human_evaluation()[motion][::8])
    taken = nearest_transport(*domains, damping=0.01)
    for method in ("identity", "mean-transport", "parallel-transport", "scaled-transport"):
        adapter = method_of(method, damping=0.01).fit(*domains)
        table = evaluate(adapter, *domains, profile)
        assert table.recommended == name_of(taken) == "parallel-transport"


@pytest.mark.parametrize("ratio", [0.5, 1.0, 1.7])
def test_another_dispersion_is_scaled(ratio, random_spd):
    rng = np.random.default_rng(0)
    teacher = random_spd(rng, 200, 3, 10.0)
    student = 2.0 * spd.powm(random_spd(rng, 300, 3, 10.0), ratio)
    wanted = "parallel-transport" if ratio == 1.0 else "scaled-transport"
    assert name_of(nearest_transport(teacher, student)) == wanted


def test_domain_distance_is_zero_between_equal_domains(random_spd):
    rng = np.random.default_rng(1)
    domain = random_spd(rng, 3000, 3)
    other = random_spd(rng, 400, 3)
    assert domain_distance(domain, domain) == pytest.approx(0.0, abs=1e-12)
    near = domain_distance(other, domain)
    far = domain_distance(3.0 * other, domain)
    assert 0.0 < near < 0.1 * far
    change = np.diag([1.0, 5.0, 0.2])
    moved = domain_distance(change @ other @ change, change @ domain @ change)
    assert moved == pytest.approx(near, rel=1e-3)


def test_large_ellipsoids_get_a_transport():
    """For 6×6 the field is not fitted."""
    person = mp.load_arm("rhuman")
    robot = mp.load_arm("panda")
    spec = mp.arms.EllipsoidSpec("velocity", "full")
    domains = [mp.sample_domain(arm, 64, 0, spec=spec) for arm in (person, robot)]
    profile = person.ellipsoids(person.sample(5, 0), spec)
    adapter, table = select_method(*domains, profile, robot=robot, spec=spec, damping=0.01)
    assert name_of(adapter) == table.recommended
    assert isinstance(adapter, mp.ParallelTransport | mp.ScaledTransport)


def test_bad_input_is_refused():
    person = mp.load_arm("rhuman")
    robot = mp.load_arm("panda")
    domain = mp.sample_domain(person, 16, 0)
    profile = person.manipulability(np.zeros((5, 7)))
    for sets, error, text in (
        ((-domain, domain, profile), NotSPDError, r"^teacher_domain\[0\]"),
        (
            (domain, np.array([np.eye(2)] * 5), profile),
            InvalidInputError,
            "^student_domain must hold 3×3",
        ),
        ((domain, domain, profile[:2]), InvalidInputError, "profile must hold at least 3"),
    ):
        with pytest.raises(error, match=text):
            select_method(*sets, robot=robot, damping=0.01)
