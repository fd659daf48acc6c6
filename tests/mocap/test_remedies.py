"""Warnings that model and person differ advise only what lowers the residual."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from maniport import arms
from maniport.arms import PERSONS, Arm
from maniport.mocap import fit_arm, fit_arms, read_recording

CASES = Path(__file__).parent / "cases"


def differences(fit):
    return [text for text in fit.quality_warnings if "differ" in text or "rotated by" in text]


def bent_elbow(record, degrees):
    """Record an arm whose elbow is bent by so many degrees, half of the time."""
    arm = arms.myoarm(0.31, 0.26, 0.06)
    time = np.linspace(0.0, 2.0, 60)
    q = np.tile(np.radians([40.0, 40.0, -20.0, 60.0, 5.0, 2.0, 5.0]), (60, 1))
    bending = np.minimum(np.linspace(60.0, 2.0 * degrees - 60.0, 60), degrees)
    q[:, arm.joint_names.index("elbow_flexion")] = np.radians(bending)
    return record(arm, time, q)


def stiff(*lengths, **named):
    """MyoArm whose elbow stops at 100°."""
    chain = arms.myoarm(*lengths, **named).chain
    upper = chain.upper.copy()
    upper[chain.coordinates.index("elbow_flexion")] = np.radians(100.0)
    return Arm(replace(chain, upper=upper))


@pytest.mark.parametrize("person", ["myoarm", "rhuman"])
@pytest.mark.parametrize("name", ["freeform", "ladder", "both-arms"])
def test_bundled_recordings_have_no_differences(name, person):
    side = "both" if name == "both-arms" else "auto"
    motion = fit_arms(read_recording(name), person, side=side)
    assert not differences(motion)
    assert all(fit.model_warnings == () for fit in motion.arms)


def test_another_model_is_advised_where_it_fits_better_only(record, monkeypatch):
    monkeypatch.setitem(PERSONS, "stiff", stiff)
    recording = bent_elbow(record, 140.0)
    (text,) = differences(fit_arm(recording, "stiff"))
    assert "person='myoarm'" in text
    assert "person='rhuman'" in text
    for person in ("myoarm", "rhuman"):
        assert not differences(fit_arm(recording, person))


@pytest.mark.parametrize("person", ["myoarm", "rhuman"])
def test_what_does_not_help_is_not_advised(record, person):
    """No model bends the elbow by 170°: advice is to check the points, not another model and back again."""
    (text,) = differences(fit_arm(bent_elbow(record, 170.0), person))
    assert "elbow_flexion beyond its limit of 150°" in text
    _, _, advice = text.partition("Advice: ")
    assert "check the roles" in advice
    assert "person=" not in advice
    assert "side=" not in advice


def test_an_arm_that_is_not_recorded_is_not_advised(record):
    recording = bent_elbow(record, 170.0)
    names = {"shoulder": "RSHO", "elbow": "RELB", "wrist": "RWRA", "hand": "RFIN"}
    recording = replace(recording, names=tuple(names.get(name, name) for name in recording.names))
    (text,) = differences(fit_arm(recording, markers={"wrist": "RWRA"}))
    assert "side=" not in text


@pytest.mark.parametrize("name", ["mirrored_axes.trc", "ladder"])
def test_left_handed_axes_are_one_warning_and_inverting_one_helps(name):
    recording = read_recording(name if name == "ladder" else CASES / name).crop(0.0, 4.0)
    mirrored = replace(recording, positions=recording.positions * [-1.0, 1.0, 1.0])
    wrong, right = (recording, mirrored) if name != "ladder" else (mirrored, recording)
    fit = fit_arm(wrong, side="right")
    assert not differences(fit)  # they follow from the axes
    (text,) = [text for text in fit.quality_warnings if "mirrored" in text]
    assert "left-handed" in text
    fit = fit_arm(right, side="right")
    assert not differences(fit)
    assert not any("mirrored" in text for text in fit.quality_warnings)


def test_markers_that_no_exchange_helps_are_omitted(record, slow_motion):
    """Of an elbow whose markers lie before and behind it, instead of beside it."""
    arm = arms.myoarm(0.31, 0.26, 0.06)
    time, q = slow_motion(arm)
    recording = record(arm, time, q)
    middle = recording.point("elbow")
    shoulder = recording.point("shoulder")
    across = recording.point("elbow_lateral") - middle
    forward = np.cross(across, shoulder - middle)
    forward *= 0.03 / np.linalg.norm(forward, axis=-1, keepdims=True)
    positions = recording.positions.copy()
    positions[:, recording.names.index("elbow_lateral")] = middle + forward
    positions[:, recording.names.index("elbow_medial")] = middle - forward
    wrong = replace(recording, positions=positions)

    (text,) = differences(fit_arm(wrong))
    assert "exchanged" not in text
    assert "markers={'elbow_axis': None}" in text
    fit = fit_arm(wrong, markers={"elbow_axis": None})
    assert not differences(fit)
    np.testing.assert_allclose(fit.joint_angles, q, atol=1e-3)


def test_a_model_for_both_arms_is_compared_on_both(monkeypatch):
    """Each arm gets the advice that lowers the residual of both together."""
    monkeypatch.setitem(PERSONS, "stiff", stiff)
    recording = read_recording("both-arms").crop(0.0, 2.0)
    texts = differences(fit_arms(recording, "stiff"))
    assert [text.partition(" arm:")[0] for text in texts] == ["left", "right"]
    for text in texts:
        assert "person='myoarm'" in text
        assert "side=" not in text
    assert not differences(fit_arms(recording, "myoarm"))
