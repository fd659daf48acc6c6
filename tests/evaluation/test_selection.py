"""Model selection where no method is named: the length field if it passes its checks, else parallel transport."""

from dataclasses import replace

import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError, NotSPDError
from maniport.evaluation import select_method
from maniport.report import as_markdown, report_of
from maniport.transfer.length_field.fit import FieldReport


def wrist_arm(path):
    """Write a six-joint arm with the dimensions of an IRB140: its length field reverses orientation in many places."""
    offsets = [
        ("0 0 0", "0 0 1", (-3.14, 3.14)),
        ("0.07 0 0.352", "0 1 0", (-1.57, 1.92)),
        ("0 0 0.36", "0 1 0", (-4.01, 0.87)),
        ("0.1 0 0", "1 0 0", (-3.49, 3.49)),
        ("0.28 0 0", "0 1 0", (-2.01, 2.01)),
        ("0.065 0 0", "1 0 0", (-6.98, 6.98)),
    ]
    links = "".join(f'<link name="l{i}"/>' for i in range(8))
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" velocity="3" effort="10"/></joint>'
        for i, (xyz, axis, (low, high)) in enumerate(offsets)
    )
    fixed = '<joint name="tip" type="fixed"><parent link="l6"/><child link="l7"/></joint>'
    path.write_text(f'<robot name="six">{links}{joints}{fixed}</robot>')
    return mp.load_arm(path, frame="l7")


@pytest.fixture(scope="module", params=["panda", "six"])
def chosen(request, tmp_path_factory):
    """A choice for a person and a robot whose length field is good (Panda) or bad (six joints)."""
    person = mp.load_arm("rhuman")
    folder = tmp_path_factory.mktemp("robots")
    robot = mp.load_arm("panda") if request.param == "panda" else wrist_arm(folder / "six.urdf")
    domains = mp.sample_domain(person, 1024, 0), mp.sample_domain(robot, 2048, 1)
    path = np.zeros((5, 7))
    path[:, 1], path[:, 3] = np.radians(90.0), np.radians(np.linspace(20.0, 110.0, 5))
    return request.param, select_method(*domains, person.manipulability(path), robot=robot, damping=0.01)


def test_a_bad_length_field_is_not_chosen(chosen):
    """The baselines follow the chosen method; a rejected field has a row without measures."""
    name, choice = chosen
    assert choice.method == ("length-field" if name == "panda" else "parallel-transport")
    assert bool(choice.failures) is (name != "panda")
    table = choice.evaluation
    assert table.adapter.name == choice.method
    assert {row.name for row in table.rows} == {"identity", "mean-transport", "parallel-transport", "length-field"}
    assert table.row(choice.method).feasibility_gap is not None
    assert (table.row("length-field").feasibility_gap is None) is bool(choice.failures)
    assert f"Selected {choice.method.replace('-', ' ')}" in as_markdown(report_of(choice))


@pytest.mark.parametrize(
    "worse", [{"reversing": 0.11}, {"nonmonotone": 0.04}, {"moved_axes": 0.06}, {"rank_correlation": 0.79}], ids=str
)
def test_every_check_can_fail(worse):
    """Each measure beyond its limit fails by itself."""
    good = FieldReport(100, 0.0, 0.0, 0.0, 1.0, 0.8, 0.0, 1.0, 0.0, moved_axes=0.05, reversing=0.1, nonmonotone=0.03)
    assert good.failures() == ()
    assert len(replace(good, **worse).failures()) == 1


def test_large_ellipsoids_get_parallel_transport():
    """For 6×6 the field is not fitted."""
    person, robot, spec = mp.load_arm("rhuman"), mp.load_arm("panda"), mp.arms.EllipsoidSpec("velocity", "full")
    domains = [mp.sample_domain(arm, 64, 0, spec=spec) for arm in (person, robot)]
    profile = person.ellipsoids(person.sample(5, 0), spec)
    assert select_method(*domains, profile, robot=robot, spec=spec, damping=0.01).method == "parallel-transport"


def test_bad_input_is_refused():
    """Errors name the argument."""
    person, robot = mp.load_arm("rhuman"), mp.load_arm("panda")
    domain, profile = mp.sample_domain(person, 16, 0), person.manipulability(np.zeros((5, 7)))
    for sets, error, text in (
        ((-domain, domain, profile), NotSPDError, r"^teacher_domain\[0\]"),
        ((domain, np.array([np.eye(2)] * 5), profile), InvalidInputError, "^student_domain must hold 3×3"),
        ((domain, domain, profile[:2]), InvalidInputError, "profile must hold at least 3"),
    ):
        with pytest.raises(error, match=text):
            select_method(*sets, robot=robot, damping=0.01)
