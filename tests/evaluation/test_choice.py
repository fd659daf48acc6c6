"""The rule by which methods are recommended and chosen, and the choice itself."""

import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError, NotSPDError
from maniport.evaluation import Gaps, Row, Smoothness, Structure, choose
from maniport.evaluation.choice import CANDIDATES
from maniport.evaluation.rule import DOES_THE_JOB, FEASIBLE, FEASIBLE_AT_95, LEAST_GAP, does_the_job
from maniport.evaluation.verdict import verdict
from maniport.telling import as_markdown, as_numbers, facts_of
from maniport.transfer import METHODS, method_of

ABLE = Gaps(FEASIBLE, 0.0, FEASIBLE_AT_95)


@pytest.mark.parametrize(
    ("row", "enough"),
    [
        (Row("raw-copy", feasibility_gap=ABLE), True),
        (Row("raw-copy", feasibility_gap=ABLE, domain_feasibility_gap=ABLE), True),
        (Row("raw-copy", feasibility_gap=Gaps(1.01 * FEASIBLE, 0.0, 0.0)), False),
        (Row("raw-copy", feasibility_gap=Gaps(0.0, 0.0, 1.01 * FEASIBLE_AT_95)), False),
        (Row("raw-copy", feasibility_gap=ABLE, domain_feasibility_gap=Gaps(1.01 * FEASIBLE, 0.0, 0.0)), False),
        (Row("raw-copy", feasibility_gap=ABLE, smoothness=Smoothness(2.0, 1.0, 1.0, 1.0)), False),
        (Row("raw-copy", feasibility_gap=ABLE, structure=Structure(1.0, 0.0, 11.0, 0.0, 0, 0)), False),
        (Row("raw-copy", feasibility_gap=ABLE, structure=Structure(0.8, 0.0, 0.0, 0.0, 0, 0)), True),
        (Row("raw-copy"), False),
    ],
)
def test_what_does_the_job(row, enough):
    """Small gaps of profile and held-out samples, mean and 95 %, and no weakness but that near and far are mixed up."""
    assert does_the_job(row) is enough


def test_the_least_that_does_the_job_is_taken():
    """Of methods that ask for what the robot can make the one that changes least, though another has a smaller gap."""
    table = [
        Row("icp", feasibility_gap=Gaps(0.0, 0.0, 0.0)),
        Row("raw-copy", feasibility_gap=Gaps(0.2, 0.2, 0.3)),
        Row("recentring", feasibility_gap=Gaps(0.04, 0.0, 0.1)),
        Row("parallel-transport", feasibility_gap=Gaps(0.03, 0.0, 0.1)),
    ]
    found = verdict(table)
    assert (found.recommended, found.reason) == ("recentring", DOES_THE_JOB)


def test_weak_methods_are_taken_where_all_are():
    """One that turns the axes far is not recommended for its small gap, unless nothing else is there."""
    weak = Row("icp", feasibility_gap=Gaps(0.1, 0.1, 0.1), structure=Structure(1.0, 0.0, 40.0, 0.0, 0, 0))
    sound = Row("parallel-transport", feasibility_gap=Gaps(0.3, 0.3, 0.3))
    assert (verdict([weak, sound]).recommended, verdict([weak, sound]).reason) == ("parallel-transport", LEAST_GAP)
    assert verdict([weak]).recommended == "icp"


@pytest.fixture(scope="module")
def arms():
    """Person and robot with a motion of the person's."""
    person, robot = mp.load_arm("rhuman"), mp.load_arm("panda")
    path = np.zeros((5, 7))
    path[:, 1], path[:, 3] = np.radians(90.0), np.radians(np.linspace(20.0, 110.0, 5))
    return person, robot, path


def test_a_robot_that_is_the_teacher_needs_nothing(arms):
    """Where the demonstrated ellipsoids can be made, a raw copy is taken at once and nothing else is fitted."""
    _, robot, _ = arms
    domains, told = (mp.sample_domain(robot, n, seed) for n, seed in ((128, 0), (256, 1))), []
    profile = robot.manipulability(0.5 * (robot.lower + robot.upper) + np.linspace(0.0, 0.5, 4)[:, None])
    found = choose(*domains, profile, robot=robot, person=robot, damping=0.01, progress=lambda *step: told.append(step))
    assert (found.method, found.reason) == ("raw-copy", DOES_THE_JOB)
    assert isinstance(found.adapter, mp.RawCopy)
    assert all(row.feasibility_gap is None for row in found.evaluation.rows[1:])
    assert found.evaluation.row("icp").note == "not tried, since raw-copy does the job"
    assert found.evaluation.settings["further samples"] == "64, held out of the fit"
    assert told[-1] == ("choose the method", 1.0, "raw-copy")
    facts = facts_of(found)
    assert as_numbers(facts)["evaluation"]["choice"] == {"method": "raw-copy", "reason": DOES_THE_JOB}
    assert "raw-copy was chosen, the least that asks for what the robot can make" in as_markdown(facts)


@pytest.fixture(scope="module")
def between_arms(arms):
    """A choice between two bodies, among rigid methods, of which one cannot be fitted; the field would do the job."""
    person, robot, path = arms
    domains = mp.sample_domain(person, 128, 0), mp.sample_domain(robot, 256, 1)
    with pytest.MonkeyPatch.context() as patch:

        class Broken(mp.RawCopy):
            def _fit(self, teacher, student):
                raise InvalidInputError("teacher is too small for this")

        patch.setitem(METHODS, "icp", Broken)
        return choose(*domains, person.manipulability(path), robot=robot, methods=CANDIDATES[:-1], damping=0.01)


def test_otherwise_the_one_that_none_undercuts_is_taken(between_arms):
    """It stands first in the table, the verdict on which names the same method, and the others are measured beside."""
    table = between_arms.evaluation
    assert between_arms.reason == LEAST_GAP
    assert table.adapter.name == between_arms.method == table.verdict.recommended
    assert 0.95 * table.verdict.value <= table.verdict.best_value
    assert len(table.verdict.values) == len(table.rows) - 1
    assert "No method asks only for what the robot can make" in as_markdown(facts_of(between_arms))


def test_what_cannot_be_fitted_is_left_out_and_told(between_arms):
    """The row says why."""
    row = between_arms.evaluation.row("icp")
    assert (row.note, row.feasibility_gap) == ("left out: teacher is too small for this", None)


def test_wrong_input_is_an_error_and_no_choice(arms):
    """What no method could take is refused by name."""
    person, robot, path = arms
    domain, profile = mp.sample_domain(person, 16, 0), person.manipulability(path)
    with pytest.raises(InvalidInputError, match="unknown method 'best'"):
        choose(domain, domain, profile, robot=robot, methods=("best",))
    with pytest.raises(NotSPDError, match=r"teacher\[0\] is indefinite"):
        choose(-domain, domain, profile, robot=robot, damping=0.01)
    with pytest.raises(InvalidInputError, match="profile must hold at least 3"):
        choose(domain, domain, profile[:2], robot=robot, damping=0.01)


def test_methods_stand_in_the_order_of_the_rule():
    """The names that are chosen among are methods in the order of the registry."""
    assert [name for name in METHODS if name in CANDIDATES] == list(CANDIDATES)
    assert all(method_of(name) for name in CANDIDATES)
