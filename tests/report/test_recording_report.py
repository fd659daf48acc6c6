import json
from dataclasses import replace

import numpy as np

from maniport.mocap import fit_arm, read_recording
from maniport.report.describe import report_of
from maniport.report.describe.recordings import recording_report
from maniport.report.render import as_numbers


def test_reported_roles_are_an_input():
    def prefixed(names):
        return f"p{names}" if isinstance(names, str) else [prefixed(one) for one in names]

    recording = read_recording("freeform").crop(2, 3)
    roles = json.loads(json.dumps(as_numbers(report_of(recording))))["arms"]["right"]["markers"]
    renamed = replace(recording, names=tuple(map(prefixed, recording.names)))
    markers = {role: prefixed(names) for role, names in roles.items()}
    np.testing.assert_array_equal(
        fit_arm(renamed, markers=markers).joint_angles, fit_arm(recording).joint_angles
    )


def test_roles_that_the_user_assigned_are_not_ascribed_to_a_marker_set():
    recording = read_recording("freeform").crop(2, 3)
    known = as_numbers(recording_report(recording))
    markers = known["arms"]["right"]["markers"]
    assigned = as_numbers(recording_report(recording, markers=markers))
    assert "Plug-in Gait" in known["arms"]["names"]
    assert assigned["arms"]["names"] == "markers"


def test_contradictions_are_warnings(small_result):
    recording = read_recording("ladder").crop(10, 11)
    first, *_ = recording_report(recording, {"elbow": "LeftArm"}).warnings
    assert "lbow of the right arm: 'LeftArm' is a point of the left one" in first
    small = replace(recording, positions=0.5 * recording.positions)
    assert any("the upper arm is 0.148 m long" in text for text in report_of(small).warnings)
    doubted = replace(small_result.recording, quality_warnings=("the unit is doubted",))
    assert report_of(doubted).warnings[0] == "The unit is doubted."
    warnings = report_of(replace(small_result, recording=doubted)).warnings
    assert warnings == ("The unit is doubted.", *report_of(small_result).warnings)
