"""Tests of the whole report."""

import json

import numpy as np
import pytest

from maniport import ParallelTransport, RawCopy, RiemannianICP, load_arm, sample_domain, spd
from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError, NotFittedError, UnknownNameError
from maniport.evaluation import Evaluation, evaluate
from maniport.evaluation.alternatives import LOOKUP, RAW_COPY, RECENTRING, TRANSPORT
from maniport.evaluation.gap_search import GapSearch
from maniport.spd.regularization import Regularization
from maniport.telling import as_markdown, as_numbers, facts_of
from maniport.transfer import method_of
from maniport.transfer.rigid_adapter import RigidMap


@pytest.fixture(scope="module")
def problem(make_cloud, turn_about):
    """Clouds of which the second is a rigid image of the first, with the truth along a motion."""
    rng = np.random.default_rng(4)
    teacher = make_cloud(rng, 120)
    truth = RigidMap(spd.mean(teacher), np.diag([1.0, 2.0, 5.0]), turn_about(20.0), 0.8)
    ends = make_cloud(rng, 2)
    profile = spd.geodesic(ends[0], ends[1], np.linspace(0.0, 1.0, 15))
    return teacher, truth.apply(teacher), profile, truth.apply(profile)


@pytest.fixture(scope="module")
def evaluation(problem):
    """The report on an ICP that can find the truth."""
    teacher, student, profile, truth = problem
    adapter = RiemannianICP(random_state=0).fit(teacher, student)
    return evaluate(adapter, teacher, student, profile, truth=truth, pairs=(teacher[:30], student[:30]), name="icp")


def test_every_row_has_every_measure_that_applies(evaluation):
    """Without an arm there is no feasibility gap; all else is measured for the adapter and all alternatives."""
    assert [row.name for row in evaluation.rows][:5] == ["icp", RAW_COPY, RECENTRING, TRANSPORT, LOOKUP]
    for row in evaluation.rows:
        if row.note == "pyriemann is not installed":
            continue
        assert row.feasibility_gap is None
        assert row.domain_feasibility_gap is None
        others = (row.rmse, row.smoothness, row.structure, row.energy_distance, row.identity)
        assert all(value is not None for value in (*others, row.stability))


def test_the_truth_is_recognised(evaluation):
    """Where the student is a rigid image, the ICP finds it, and the verdict says so first."""
    assert evaluation.adapter.rmse.undivided < 1e-6
    assert evaluation.adapter.energy_distance < 1e-6
    assert evaluation.row(RAW_COPY).rmse.undivided > 0.5
    assert evaluation.verdict.recommended == "icp"


def test_the_noise_of_the_student_stands_beside(evaluation):
    """Samples kept out of the domain are as far from the rest as samples are, and no farther."""
    noise = evaluation.student_noise
    assert 0.0 < noise.energy_distance < evaluation.row(RAW_COPY).energy_distance


def test_report_is_ready_for_json_and_for_reading(evaluation):
    """The numbers are plain; the page says the verdict before it has a line for every row."""
    facts = facts_of(evaluation)
    table = json.loads(json.dumps(as_numbers(facts), allow_nan=False))["evaluation"]["rows"]
    assert table["icp"]["rmse"]["undivided"] == evaluation.adapter.rmse.undivided
    assert table["icp"]["smoothness"]["largest_ratio"] == evaluation.adapter.smoothness.largest_ratio
    lines = as_markdown(facts, level=3).splitlines()
    assert lines[0] == "### icp"
    verdict = next(i for i, line in enumerate(lines) if line.startswith("- icp is "))
    assert verdict < next(i for i, line in enumerate(lines) if line.startswith("|"))
    body = [line for line in lines if line.startswith("|")]
    assert len(body) == 3 + len(evaluation.rows)
    assert len({line.count("|") for line in body}) == 1
    assert not any("feasibility gap" in line for line in lines)


def test_rows_are_found_by_name(evaluation):
    """An unknown name is an error that lists the rows."""
    assert evaluation.row("icp") is evaluation.adapter
    with pytest.raises(UnknownNameError, match="unknown row 'raw'; there are, nearest first: 'raw-copy'"):
        evaluation.row("raw")


def test_the_adapter_is_left_as_it_was(problem):
    """Evaluation fits clones only."""
    teacher, student, profile, _ = problem
    adapter = ParallelTransport(damping=0.01).fit(teacher, student)
    before = adapter.transform(profile)
    evaluate(adapter, teacher, student, profile, draws=0)
    np.testing.assert_array_equal(adapter.transform(profile), before)


def test_same_seed_same_report(problem):
    """All that is drawn is drawn from the seed."""
    teacher, student, profile, _ = problem
    adapter = ParallelTransport(damping=0.01).fit(teacher, student)
    first, again = (evaluate(adapter, teacher, student, profile, random_state=3) for _ in range(2))
    assert as_numbers(facts_of(first)) == as_numbers(facts_of(again))


def test_a_profile_that_stands_still_has_no_steps_to_compare(problem):
    """What compares motion is left out then; gaps and all else stay."""
    teacher, student, profile, _ = problem
    adapter = ParallelTransport().fit(teacher, student)
    found = evaluate(adapter, teacher, student, np.tile(profile[0], (4, 1, 1)), draws=0)
    assert (found.adapter.smoothness, found.adapter.structure) == (None, None)
    assert found.adapter.energy_distance is not None
    assert "turn of axes" not in as_markdown(facts_of(found))


@pytest.mark.parametrize("method", ["icp", "nearest-neighbor"])
def test_a_person_in_other_axes_is_judged_alike(problem, turn_about, method):
    """Where the teacher's frame is turned and the mounting says so, every row has the measures that it had."""
    teacher, student, profile, truth = problem
    turn = turn_about(90.0, axis=0)
    tables = []
    for mounting in (np.eye(3), turn):
        seen = [mounting.T @ points @ mounting for points in (teacher, profile)]
        adapter = method_of(method, damping=0.01, mounting=mounting, random_state=0).fit(seen[0], student)
        found = evaluate(
            adapter, seen[0], student, seen[1], truth=truth, draws=0, rows=(RAW_COPY, RECENTRING, TRANSPORT)
        )
        tables.append([(row.rmse.undivided, row.structure.major_turn, row.energy_distance) for row in found.rows])
    np.testing.assert_allclose(*tables, rtol=1e-6, atol=1e-6)


@pytest.fixture(scope="module")
def arms():
    """Person and robot, a fitted adapter and its domains, small."""
    person, robot = load_arm("rhuman"), load_arm("panda")
    domains = sample_domain(person, 128, 0), sample_domain(robot, 256, 1)
    path = np.zeros((5, 7))
    path[:, 1], path[:, 3] = np.radians(90.0), np.radians(np.linspace(20.0, 110.0, 5))
    return person, robot, domains, person.manipulability(path)


def test_with_the_arms_feasibility_gaps_and_fresh_draws_join(arms):
    """The robot's kinematics gives feasibility gaps, none for the lookup; both arms give fresh draws."""
    person, robot, domains, profile = arms
    adapter = ParallelTransport(damping=0.01).fit(*domains)
    told = []
    found = evaluate(
        adapter,
        *domains,
        profile,
        person=person,
        robot=robot,
        n_domain=4,
        draws=2,
        progress=lambda step, fraction, found="": told.append((step, fraction)),
    )
    assert isinstance(found, Evaluation)
    assert TRANSPORT not in [row.name for row in found.rows[1:]]
    assert found.row(LOOKUP).feasibility_gap.p95 < 0.01
    assert found.adapter.feasibility_gap.median > 0.01
    assert found.adapter.domain_feasibility_gap is not None
    assert found.adapter.stability.n_draws == 2
    assert "feasibility gap" in as_markdown(facts_of(found))
    assert "2 fresh draws" in found.settings["stability"]
    assert [fraction for _, fraction in told[-1:]] == [1.0]


def test_with_a_floor_the_gap_is_that_of_lifted_ellipsoids():
    """Eigenvalues below the floor are lifted on both sides, and nothing is added to the others."""
    rows = [[0.0, 0.0, 0.0, np.pi / 2], [np.pi / 2, 0.0, 0.0, np.pi / 2], [0.0, 0.0, 0.0, 0.0]]
    gantry = Arm.from_dh("gantry", rows, [-1.0] * 3, [1.0] * 3, kinds=["prismatic"] * 3)  # M = I everywhere
    small = np.linspace(0.0, 0.5, 5)
    targets = np.array([np.diag([4.0, 1.0, one]) for one in small])
    found = GapSearch(gantry, VELOCITY, Regularization(floor=0.2), 5).distances(targets)
    np.testing.assert_allclose(found, np.hypot(np.log(4.0), np.log(np.maximum(small, 0.2))), rtol=1e-6)


def test_what_the_gap_was_searched_with_is_told(arms):
    """A profile that is thinned for the search and a floor are told beside the table; else nothing is."""
    _, robot, domains, profile = arms
    long = spd.geodesic(profile[1], profile[2], np.linspace(0.0, 1.0, 130))
    adapter = RawCopy(floor=1e-4).fit(*domains)
    facts = facts_of(evaluate(adapter, *domains, long, robot=robot, n_domain=0, draws=0, rows=()))
    search = as_numbers(facts)["evaluation"]["gap_search"]
    assert search.startswith("searched at 128 of the profile's 130 ellipsoids, evenly spread; the floor is added")
    assert as_markdown(facts).count(search) == 1
    plain = evaluate(RawCopy().fit(*domains), *domains, profile[1:], robot=robot, n_domain=0, draws=0, rows=())
    assert "gap_search" not in as_numbers(facts_of(plain))["evaluation"]


def test_bad_input_is_told(problem, arms):
    """Unfitted adapters, other counts and ellipsoids that the robot does not make are errors."""
    teacher, student, profile, truth = problem
    adapter = ParallelTransport().fit(teacher, student)
    with pytest.raises(NotFittedError, match="ParallelTransport is not fitted yet"):
        evaluate(ParallelTransport(), teacher, student, profile)
    with pytest.raises(InvalidInputError, match=r"^truth must have the shape of profile"):
        evaluate(adapter, teacher, student, profile, truth=truth[:-1])
    with pytest.raises(InvalidInputError, match=r"^robot must be an Arm"):
        evaluate(RawCopy().fit(teacher, student), teacher, student, profile, robot="panda")
    with pytest.raises(InvalidInputError, match=r"^adapter must be"):
        evaluate("raw-copy", teacher, student, profile)
    with pytest.raises(InvalidInputError, match="profile must hold at least 3"):
        evaluate(adapter, teacher, student, profile[:2])
    with pytest.raises(InvalidInputError, match="draws must be 0 or at least 2; found 1"):
        evaluate(adapter, teacher, student, profile, draws=1)
    with pytest.raises(InvalidInputError, match="student_domain must hold the ellipsoids of 'panda'"):
        evaluate(adapter, teacher, student, profile, robot=arms[1], spec=EllipsoidSpec(part="full"))
