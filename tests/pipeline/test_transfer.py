"""One object for all recordings: what is computed once, and what maps are for."""

from unittest import mock

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import maniport as mp
from maniport.errors import InvalidInputError, OutputError
from maniport.mocap import shipped_recording
from maniport.motion import MotionLimits
from maniport.pipeline import Config, transfer
from maniport.pipeline.following import SampledRobot
from sizes import little_search

PART = {"start": 2.0, "stop": 2.3}
STILL = Config(method="identity", n_teacher=64, n_student=64, move=False, **PART)


@pytest.fixture
def calls(monkeypatch):
    """Names of what is called, in this order."""
    names = []

    def counted(name, function):
        def call(*arguments, **keywords):
            names.append(name)
            return function(*arguments, **keywords)

        return call

    for module, name in (
        ("maniport.pipeline.settings", "read_recording"),
        ("maniport.pipeline.human", "fit_arms"),
        ("maniport.pipeline.transfer", "settings_of"),
        ("maniport.pipeline.transfer", "fit_map"),
        ("maniport.pipeline.following", "planner_of"),
    ):
        function = vars(__import__(module, fromlist=[name]))[name]
        monkeypatch.setattr(f"{module}.{name}", counted(name, function))
    monkeypatch.setattr(MotionLimits, "of", counted("limits", MotionLimits.of))
    return names


@pytest.mark.parametrize("has_file", [False, True])
def test_a_run_does_everything_once(calls, tmp_path, has_file):
    options = dict(PART)
    if has_file:
        file = tmp_path / "limits.yaml"
        file.write_text("joints: {panda_joint2: {velocity: 1.0, upper: 1.5}}", encoding="utf-8")
        options["limits"] = str(file)
    with little_search():
        result = mp.transfer_recording(
            "freeform", robot="panda", method="identity", n_teacher=64, n_student=64, **options
        )
    if has_file:
        assert result.arm.motion.velocity_limits[1] == 1.0
        assert result.arm.robot.velocity_limits[1] == 1.0
    assert calls == [
        "settings_of",
        "limits",
        "read_recording",
        "fit_arms",
        "planner_of",
        "fit_map",
    ]


def test_a_second_recording_needs_its_person_only(calls):
    job = mp.Transfer("panda", STILL)
    fitted = job.fit(job.read("freeform"))
    calls.clear()
    with mock.patch.object(SampledRobot, "sample", side_effect=AssertionError("sampled")):
        fitted.run(job.read("freeform"))
    assert calls == ["read_recording", "fit_arms"]


def test_runs_do_not_change_one_another(panda):
    """Each motion has the generator of the samples in the same state."""
    with little_search():
        job = mp.Transfer(panda, Config(method="identity", n_teacher=64, n_student=64, **PART))
        fitted = job.fit(job.read("freeform"))
        first = fitted.run(job.read("freeform"))
        second = fitted.run(job.read("freeform"))
        whole = mp.Transfer(panda, job.settings.config).run("freeform")
    for other in (second, whole):
        assert_array_equal(
            first.motion.trajectory.control_positions, other.motion.trajectory.control_positions
        )


def test_saved_maps_are_the_same_maps(tmp_path):
    job = mp.Transfer("panda", STILL)
    human = job.read(shipped_recording("freeform"))
    fitted = job.fit(human)
    fitted.save(tmp_path / "maps")
    with pytest.raises(OutputError, match="overwrite"):
        fitted.save(tmp_path / "maps")
    again = job.load(tmp_path / "maps").run(human)
    expected = fitted.run(human)
    assert_array_equal(again.arm.target_profile, expected.arm.target_profile)
    assert again.arm.evaluation.values == expected.arm.evaluation.values


def test_a_robot_that_stays_has_no_targets():
    job = mp.Transfer("panda", STILL)
    human = job.read("freeform")
    with pytest.raises(InvalidInputError, match="not moved"):
        job.fit(human).map(human)


def test_targets_are_those_of_the_maps(panda):
    config = STILL.changed(move=True)
    job = mp.Transfer(panda, config)
    human = job.read("freeform")
    with little_search():
        fitted = job.fit(human)
        (target,) = fitted.map(human)
    mapped = fitted.adapters[0].transform(human.ellipsoids[0])
    assert_array_equal(target.ellipsoids, mapped)
    assert_array_equal(target.positions, human.hand_paths[0])
    assert np.all(np.diff(target.time) > 0.0)
    assert transfer.mean_rotation(fitted.maps).shape == (3, 3)
