"""Task study: simulation and scores with known answers, files, statistics, and runs that are resumed."""

import json

import numpy as np
import pytest

from benchmarks.tasks import methods, run
from benchmarks.tasks.__main__ import main
from benchmarks.tasks.run import Unit, median_interval, study_report
from benchmarks.tasks.score import (
    ROTOR,
    SimulatedArm,
    carry,
    push,
    react,
    read_motion,
    resist,
    score,
)
from benchmarks.tasks.task import HELD_OUT, ROBOTS, Task, demonstrations, of_folder
from maniport.arms import Arm, load_arm
from maniport.errors import FileFormatError, InvalidInputError, MissingPackageError, OutputError
from maniport.evaluation import polytope_extent
from maniport.motion.arm_model import InverseDynamics

pytestmark = pytest.mark.slow

pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def panda():
    return load_arm("panda")


@pytest.fixture(scope="module")
def simulated(panda):
    return SimulatedArm(panda)


@pytest.fixture(scope="module")
def held(panda):
    u = np.random.default_rng(0).normal(size=(4, 3))
    return panda.sample(4, 0), u / np.linalg.norm(u, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def task(panda):
    q = joint_motion()
    person = next(demonstrations())
    time = np.linspace(0.0, 6.0, len(q))
    return Task.of(
        "test", "panda", time, panda.forward(q)[:, :3, 3], person.arm, person.joint_angles[: len(q)]
    )


def joint_motion(count=16):
    ready = np.array(ROBOTS["panda"].ready)
    return ready + np.linspace(0.0, 0.4, count)[:, None] * np.ones(7)


def write(path, task, q):
    rows = [",".join(map(repr, row)) for row in np.column_stack([task.time, q]).tolist()]
    path.write_text(
        "\n".join([",".join(["time_s", *(f"{name}_rad" for name in task.arm.joint_names)]), *rows])
        + "\n"
    )
    return path


def test_simulation_has_the_dynamics_of_the_description_and_rotors(simulated, held):
    q, generator = held[0], np.random.default_rng(1)
    velocity, acceleration = generator.normal(size=(2, *q.shape))
    expected = InverseDynamics(simulated.arm).torques(q, velocity, acceleration)
    expected = expected + ROTOR * simulated.limits * acceleration
    assert np.allclose(simulated.torques(q, velocity, acceleration), expected, atol=1e-3)


def test_push_is_the_force_of_the_linear_program(simulated, held):
    q, u = held
    both = [[polytope_extent(simulated.arm, a, sign * b[None])[0, 0] for a, b in zip(q, u, strict=True)]
            for sign in (1, -1)]  # fmt: skip
    assert np.allclose(push(simulated, q, u), np.min(both, axis=0), rtol=0.03)


def test_carry_is_the_payload_that_saturates_a_motor(panda, simulated):
    q, time = joint_motion(), np.linspace(0.0, 1e4, 16)
    payload = carry(simulated, time, q)
    assert payload > 1.0
    for factor, within in ((0.99, True), (1.01, False)):
        torques = panda.with_payload(factor * payload).gravity_torques(q)
        assert bool(np.all(np.abs(torques) <= panda.effort_limits)) is within


def test_react_takes_the_time_of_the_fastest_joint():
    """With a low velocity limit it is that of the fastest joint, 1.875 times its mean speed with minimum jerk."""
    arm = load_arm("panda").with_limits(velocity=0.05)
    simulated = SimulatedArm(arm)
    q = np.array([ROBOTS["panda"].ready])
    up = np.array([[0.0, 0.0, 1.0]])
    jacobian = arm.jacobian(q[0])[:3]
    short = 0.02  # [m], over which the Jacobian is nearly constant
    rates = np.abs(np.linalg.pinv(jacobian) @ up[0]).max()
    assert react(simulated, q, up, distance=short)[0] == pytest.approx(
        1.875 * short * rates / 0.05, rel=0.05
    )
    assert np.isinf(react(simulated, q, up, distance=3.0)[0])


def test_resist_improves_with_stronger_motors_and_ends_without_impulse(panda, simulated, held):
    q, u = held
    assert np.allclose(resist(simulated, q, u, impulse=0.0), 0.0, atol=1e-6)
    stronger = SimulatedArm(panda.with_limits(effort=3.0 * panda.effort_limits))
    assert np.all(resist(stronger, q, u) < resist(simulated, q, u))


def test_arms_without_masses_are_refused():
    with pytest.raises(InvalidInputError):
        SimulatedArm(Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]]))


def test_a_task_and_a_motion_survive_their_files(task, tmp_path, capsys):
    q = np.round(joint_motion(), 9)
    task.save(tmp_path / "task.json")
    again = Task.load(tmp_path / "task.json")
    assert np.array_equal(again.path, task.path)
    assert np.array_equal(again.force_directions, task.force_directions)
    file = write(tmp_path / "joints.csv", task, q)
    assert np.array_equal(read_motion(file, again), q)
    assert score(again, read_motion(file, again)) == score(task, q)
    assert run.is_valid(score(task, q))
    assert not run.is_valid(score(task, q + 0.01))
    assert main(["score", str(file), str(tmp_path / "task.json")]) == 0
    assert "Resemblance force" in capsys.readouterr().out


@pytest.mark.parametrize(("name", "change"), [
    ("head", lambda lines: [lines[0].replace("panda_joint3_rad", "x"), *lines[1:]]),
    ("short", lambda lines: lines[:-2]),
    ("word", lambda lines: [lines[0], lines[1].replace(lines[1].split(",")[1], "fast"), *lines[2:]]),
    ("ragged", lambda lines: [*lines[:-1], "1,2"]), ("empty", lambda lines: []),
    ("nan", lambda lines: [*lines[:-1], ",".join(["nan"] * 8)]),
])  # fmt: skip
def test_damaged_motions_are_refused(task, tmp_path, name, change):
    file = write(tmp_path / f"{name}.csv", task, joint_motion())
    file.write_text("\n".join(change(file.read_text().splitlines())))
    with pytest.raises(FileFormatError):
        read_motion(file, task)


@pytest.mark.parametrize("change", [
    {"time": [1, 0]}, {"path": [[0, 0, 0]]}, {"instants": [99]}, {"instants": []},
    {"person_force": [[1.0]]}, {"x": 1},
])  # fmt: skip
def test_damaged_tasks_are_refused(task, tmp_path, change):
    task.save(tmp_path / "task.json")
    content = json.loads((tmp_path / "task.json").read_text()) | change
    (tmp_path / "task.json").write_text(json.dumps(content))
    with pytest.raises(FileFormatError):
        Task.load(tmp_path / "task.json")


def unit(push, valid=True, resist=2.0):
    row = dict.fromkeys(("speed", "react", "carry", "resemblance_force", "resemblance_speed"), 1.0)
    rows = [{"method": name, "valid": True, "push": 10.0, "resist": 2.0, **row}
            for name in ("position-only", "direct-force", "direct-speed")]  # fmt: skip
    own = [{"method": name, "valid": valid, "push": push, "resist": resist, **row}
           for name in ("length-field, force", "length-field, velocity")]  # fmt: skip
    return Unit("a", "panda", False, 4.0, (*rows, *own))


def test_ratios_are_above_one_where_a_method_is_better():
    assert unit(20.0).ratio("length-field, force", "push") == 2.0
    assert unit(20.0, resist=1.0).ratio("length-field, force", "resist") == 2.0
    assert unit(20.0, resist=np.inf).ratio("length-field, force", "resist") == 0.0
    assert unit(20.0, valid=False).ratio("length-field, force", "push") == 0.0


def test_report_has_medians_and_failures():
    units = (
        unit(20.0),
        unit(30.0),
        unit(40.0, valid=False),
        Unit("b", "panda", failure="out of reach"),
    )
    report = study_report(units, 0)
    table = report.sections[0].tables[0].value[0]
    assert table["force"]["push"]["median"] == 2.0
    assert table["force"]["failed"] == 1
    assert any(metric.text == "out of reach" for metric in report.sections[-1].metrics)


def test_bootstrap_covers_the_median():
    interval = median_interval(np.arange(21.0))
    assert interval["low"] < interval["median"] == 10.0 < interval["high"]
    assert median_interval([1.0, 1.0]) == {"median": 1.0, "low": 1.0, "high": 1.0}


@pytest.fixture
def small(monkeypatch):
    motion = next(demonstrations())
    short = run.Demonstration("short", motion.arm, motion.time[:12], motion.joint_angles[:12])
    monkeypatch.setattr(run, "demonstrations", lambda: iter([short]))
    monkeypatch.setattr(run, "QUICK", ("short",))
    every = methods.costs
    only = {"yoshikawa": lambda rows, q: -np.linalg.slogdet(load_arm("panda").ellipsoids(q))[1]}
    monkeypatch.setattr(methods, "costs", lambda problem: only)
    monkeypatch.setattr(run, "motions", lambda problem: methods.motions(problem, 2))
    report = study_report((unit(20.0),), 0)
    monkeypatch.setattr(run, "study_report", lambda units, seed: report)
    return every


def test_runs_repeat_their_bytes_and_are_resumed(small, tmp_path, monkeypatch):
    run.study_tasks(tmp_path / "a", quick=True)
    (scores,) = (tmp_path / "a").rglob("scores.json")
    assert [row["method"] for row in json.loads(scores.read_text())["rows"]] == [
        "position-only",
        "random",
        "yoshikawa",
    ]
    run.study_tasks(tmp_path / "b", quick=True)
    files = sorted(
        file.relative_to(tmp_path / "a") for file in (tmp_path / "a").rglob("*") if file.is_file()
    )
    assert len(files) == 7
    assert all(
        (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
        for file in files
    )
    monkeypatch.setattr(run, "_computed", None)  # an error if it were called
    run.study_tasks(tmp_path / "a", quick=True)
    with pytest.raises(OutputError):
        run.study_tasks(tmp_path / "a", 1, quick=True)
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "other").write_text("")
    with pytest.raises(OutputError):
        run.study_tasks(tmp_path / "c", quick=True)


def test_all_costs_are_finite_on_the_path(small):
    motion = next(run.demonstrations())
    problem = methods.problem_of(ROBOTS["panda"], motion)
    q = methods.follow(problem, np.array(ROBOTS["panda"].ready))
    assert np.abs(problem.arm.forward(q)[:, :3, 3] - problem.task.path).max() < 1e-4
    for name, cost in small(problem).items():
        assert np.all(np.isfinite(cost(np.arange(len(q)), q))), name


def test_motions_are_cut_and_named_once():
    names = [motion.name for motion in demonstrations()]
    assert len(names) == len(set(names)) >= 20
    assert {*names, *ROBOTS} > HELD_OUT
    assert all(motion.time[-1] <= 8.0 for motion in demonstrations())


def test_wrong_arguments_are_refused_before_work(tmp_path, monkeypatch):
    with pytest.raises(InvalidInputError):
        run.study_tasks(tmp_path / "x", robots=["toaster"])
    with pytest.raises(InvalidInputError):
        list(of_folder(tmp_path))
    assert main(["score", "missing.csv", "missing.json"]) == 1
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(MissingPackageError, match=r"\.\[simulate\]"):
        run.study_tasks(tmp_path / "x")
    assert not (tmp_path / "x").exists()
