import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import MeanTransport, ParallelTransport, RiemannianICP, load_arm, sample_domain, spd
from maniport.arms import EllipsoidSpec
from maniport.errors import InvalidInputError, NotFittedError
from maniport.evaluation import evaluate
from maniport.evaluation.comparison import baselines_for
from maniport.evaluation.metrics import BASELINES
from maniport.report import as_markdown, as_numbers, report_of
from maniport.transfer.rigid_adapter import RigidMap

TURN = Rotation.from_euler("z", 20.0, degrees=True).as_matrix()


@pytest.fixture(scope="module")
def problem(random_spd):
    """Clouds of which the second is a rigid image of the first, with the truth along a motion."""
    root = np.diag(
        [0.6, 1.3, 2.7]
    )  # a center that is not round, so that the rotation is determined
    clouds = root @ random_spd(np.random.default_rng(4), 122, 3, 10.0) @ root
    teacher = clouds[2:]
    ends = clouds[:2]
    truth = RigidMap(spd.mean(teacher), np.diag([1.0, 2.0, 5.0]), TURN, 0.8)
    profile = spd.geodesic(ends[0], ends[1], np.linspace(0.0, 1.0, 15))
    return teacher, truth.apply(teacher), profile, truth.apply(profile)


@pytest.fixture(scope="module")
def evaluation(problem):
    teacher, student, profile, truth = problem
    adapter = RiemannianICP().fit(teacher, student)
    return evaluate(adapter, teacher, student, profile, truth=truth)


def test_every_row_has_every_metric_that_applies(evaluation):
    assert tuple(row.name for row in evaluation.rows) == ("icp", *BASELINES)
    for row in evaluation.rows:
        assert row.feasibility_gap is None
        assert None not in (row.rmse, row.step_ratio, row.preservation)
    assert evaluation.adapter.rmse.undivided < 1e-6
    assert evaluation.values["identity"] > 0.5
    assert evaluation.recommended == "icp"


def test_the_report_has_plain_numbers_and_a_line_for_every_row(evaluation):
    report = report_of(evaluation)
    table = json.loads(json.dumps(as_numbers(report), allow_nan=False))["evaluation"]["rows"]
    assert table["icp"]["rmse"]["undivided"] == evaluation.adapter.rmse.undivided
    body = [line for line in as_markdown(report).splitlines() if line.startswith("|")]
    assert len(body) >= 2 + len(evaluation.rows)
    assert len({line.count("|") for line in body}) == 1


def test_the_adapter_stays_and_the_seed_decides(problem):
    teacher, student, profile, _ = problem
    adapter = ParallelTransport(damping=0.01).fit(teacher, student)
    before = adapter.transform(profile)
    first, again = (evaluate(adapter, teacher, student, profile, random_state=3) for _ in range(2))
    assert as_numbers(report_of(first)) == as_numbers(report_of(again))
    np.testing.assert_array_equal(adapter.transform(profile), before)


@pytest.fixture(scope="module")
def arms():
    person = load_arm("rhuman")
    robot = load_arm("panda")
    domains = sample_domain(person, 128, 0), sample_domain(robot, 256, 1)
    path = np.zeros((5, 7))
    path[:, 1] = np.radians(90.0)
    path[:, 3] = np.radians(np.linspace(20.0, 110.0, 5))
    return robot, domains, person.manipulability(path)


def test_with_the_robot_gaps_join(arms):
    robot, domains, profile = arms
    adapter = ParallelTransport(damping=0.01).fit(*domains)
    steps = []
    options = {"robot": robot, "rows": (*BASELINES, "nearest-neighbor")}
    result = evaluate(
        adapter, *domains, profile, **options, progress=lambda _, done, text="": steps.append(done)
    )
    assert "parallel-transport" not in [row.name for row in result.rows[1:]]
    assert {row.name: row for row in result.rows}["nearest-neighbor"].feasibility_gap.p95 < 0.01
    assert result.adapter.feasibility_gap.mean > 0.01
    assert steps[-1] == 1.0


def test_bad_input_is_refused(problem, arms):
    teacher, student, profile, truth = problem
    adapter = ParallelTransport().fit(teacher, student)
    for arguments, options, error, word in (
        ((ParallelTransport(), profile), {}, NotFittedError, "not fitted"),
        (("identity", profile), {}, InvalidInputError, "^adapter"),
        ((adapter, profile[:2]), {}, InvalidInputError, "profile"),
        ((adapter, profile), {"truth": truth[:-1]}, InvalidInputError, "^truth"),
        ((adapter, profile), {"robot": "panda"}, InvalidInputError, "^robot"),
        (
            (adapter, profile),
            {"robot": arms[0], "spec": EllipsoidSpec(part="full")},
            InvalidInputError,
            "student",
        ),
    ):
        with pytest.raises(error, match=word):
            evaluate(arguments[0], teacher, student, arguments[1], **options)


def test_mean_transport_matches_the_means_and_nothing_else(problem):
    """The teacher's mean becomes the student's, and all distances stay: a congruence by S̄^½ (R_b T̄ R_bᵀ)^-½ R_b."""
    points, student = problem[:2]
    adapter = MeanTransport(base_rotation=TURN).fit(points, student)
    factor = (
        spd.powm(spd.mean(student), 0.5) @ spd.powm(TURN @ spd.mean(points) @ TURN.T, -0.5) @ TURN
    )
    images = adapter.transform(points)
    np.testing.assert_allclose(images, factor @ points @ factor.T, rtol=1e-8)
    np.testing.assert_allclose(adapter.inverse_transform(images), points, rtol=1e-8)


def test_a_method_is_not_its_own_baseline(problem):
    assert "parallel-transport" not in baselines_for(ParallelTransport())
    own = ParallelTransport(damping=0.01)
    adapter = RiemannianICP(damping=0.01).fit(*problem[:2])
    baselines = baselines_for(adapter, ("identity", own))
    assert list(baselines) == ["identity", "parallel-transport"]
    assert baselines["parallel-transport"].get_params() == own.get_params()
    for rows, word in (
        ((ParallelTransport(damping=0.02),), "rows"),
        (("identity baseline",), "method"),
    ):
        with pytest.raises(InvalidInputError, match=word):
            baselines_for(adapter, rows)
