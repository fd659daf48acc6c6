"""Model selection where no method is named: the length field if it passes its checks, else parallel transport."""

from dataclasses import replace

import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError, NotSPDError
from maniport.evaluation import select_method
from maniport.report import as_markdown, report_of
from maniport.transfer import name_of
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
    path[:, 1], path[:, 3] = np.radians(90.0), np.radians(np.linspace(20.0, 110.0, 5))
    return request.param, select_method(
        *domains, person.manipulability(path), robot=robot, damping=0.01
    )


def test_a_bad_length_field_is_not_chosen(chosen):
    name, (adapter, table) = chosen
    method = "length-field" if name == "panda" else "parallel-transport"
    assert name_of(adapter) == table.adapter.name == method
    assert bool(table.rejected) is (name != "panda")
    assert {row.name for row in table.rows} == {
        "identity",
        "mean-transport",
        "parallel-transport",
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


def test_large_ellipsoids_get_parallel_transport():
    """For 6×6 the field is not fitted."""
    person, robot, spec = (
        mp.load_arm("rhuman"),
        mp.load_arm("panda"),
        mp.arms.EllipsoidSpec("velocity", "full"),
    )
    domains = [mp.sample_domain(arm, 64, 0, spec=spec) for arm in (person, robot)]
    profile = person.ellipsoids(person.sample(5, 0), spec)
    adapter, _ = select_method(*domains, profile, robot=robot, spec=spec, damping=0.01)
    assert isinstance(adapter, mp.ParallelTransport)


def test_bad_input_is_refused():
    person, robot = mp.load_arm("rhuman"), mp.load_arm("panda")
    domain, profile = mp.sample_domain(person, 16, 0), person.manipulability(np.zeros((5, 7)))
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
