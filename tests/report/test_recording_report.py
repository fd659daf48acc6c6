"""What is told of a recording: its points, their roles, and what completes an arm."""

import json
from dataclasses import replace

import numpy as np
import pytest

from maniport.mocap import fit_arm, read_recording
from maniport.report.metrics import report_of
from maniport.report.recording import recording_report
from maniport.report.renderings import as_markdown, as_numbers


@pytest.fixture(scope="module")
def bare():
    """The ladder without the points that show wrist and neck."""
    recording = read_recording("ladder").crop(10, 11)
    return recording.select([name for name in recording.names if name not in ("RightHand", "Neck")])


@pytest.mark.filterwarnings("ignore:the model of the arm and the person differ")
def test_what_is_told_can_be_given_back():
    """The roles in the numbers are what `markers` takes, and give the same arm."""
    recording = read_recording("freeform").crop(2, 3)
    told = json.loads(json.dumps(as_numbers(report_of(recording))))["arms"]["right"]["markers"]
    renamed = replace(recording, names=tuple(f"p{name}" for name in recording.names))
    mine = {role: _prefixed(names) for role, names in told.items()}
    np.testing.assert_array_equal(fit_arm(renamed, markers=mine).joint_angles, fit_arm(recording).joint_angles)


def _prefixed(names):
    return f"p{names}" if isinstance(names, str) else [_prefixed(one) for one in names]


def test_the_way_to_complete_an_arm_completes_it(bare):
    """The template names the roles that are missing; filled in, it completes the arm."""
    facts = recording_report(bare, command="'my walk.bvh' --fps 30")
    assert facts.warnings == ("No arm is complete, so that none can be fitted.",)
    template = as_numbers(facts)["to_complete"]["markers"]
    assert template == {"wrist": ["NAME"], "trunk_up": [["LOW"], ["HIGH"]]}
    page = as_markdown(facts)
    assert json.dumps(template) in page
    assert "The right arm lacks wrist, trunk_up." in page
    assert "`maniport transfer 'my walk.bvh' --fps 30 --markers markers.json -o results`" in page
    filled = {"wrist": ["RightFingerBase"], "trunk_up": [["Spine"], ["EndSiteNeck"]]}
    completed = recording_report(bare, filled)
    assert as_numbers(completed)["arms"]["right"]["complete"]
    assert not completed.warnings


@pytest.mark.parametrize("side", ["right", "left"])
def test_what_would_tell_more_is_told_of_the_arm_that_is_fitted(side):
    """Of two whole arms the page speaks of the one that is fitted."""
    recording = read_recording("both-arms").crop(2, 3)
    few = recording.select([name for name in recording.names if not name.endswith(("FIN", "OHAND", "IHAND"))])
    page = as_markdown(recording_report(few, side=side))
    assert f"The {side} arm can be fitted as it is" in page
    assert ("--side left" in page.splitlines()[-1]) == (side == "left")


def test_a_contradicted_arm_is_warned_of():
    """Points of the other arm and lengths that no adult has stand among the warnings."""
    recording = read_recording("ladder").crop(10, 11)
    first, *_ = recording_report(recording, {"elbow": "LeftArm"}).warnings
    assert "lbow of the right arm: 'LeftArm' is a point of the left one" in first
    small = replace(recording, positions=0.5 * recording.positions)
    assert any("the upper arm is 0.148 m long" in one for one in report_of(small).warnings)


def test_doubts_of_a_recording_go_before_other_warnings(small_result):
    """Whoever gave a unit or an axis that the points contradict reads that first, of the recording and of the run."""
    doubted = replace(small_result.recording, quality_warnings=("the unit is doubted",))
    assert report_of(doubted).warnings[0] == "The unit is doubted."
    run = report_of(replace(small_result, recording=doubted))
    assert run.warnings[0] == "The unit is doubted."
    assert run.warnings[1:] == report_of(small_result).warnings
