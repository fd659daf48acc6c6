"""`maniport info` shows what was recognized, repaired and contradicted in a recording, also of a part."""

import json
import re
import shlex
from pathlib import Path

import pytest

CASES = Path(__file__).parents[1] / "mocap" / "cases"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("datarate_100_times_of_30hz.trc", ["100 Hz", "30 Hz", "DataRate"]),
        ("rest_pose_5_frames.bvh", ["first 5 frames", "rest pose"]),
        ("template_offsets_positions_in_channels.bvh", ["osition channels", "10.5 units"]),
        ("one_recording.bvh.zip", ["control.bvh", "archive"]),
    ],
)
def test_info_shows_notes_and_warnings(run, name, words):
    code, out, _ = run("info", CASES / name)
    assert code == 0
    assert all(word in out for word in words)


def test_info_of_a_part(run):
    code, out, _ = run("info", CASES / "control.bvh", "--start", "0.5", "--stop", "1", "--json")
    assert code == 0
    assert json.loads(out)["recording"]["frames"] == 16
    code, _, err = run("info", CASES / "control.bvh", "--start", "5")
    assert (code, "1.96667 s" in err) == (2, True)


def test_the_remedy_for_a_frame_time_of_zero_works(run):
    file = CASES / "frame_time_zero.bvh"
    code, _, err = run("info", file)
    assert (code, "--fps" in err) == (2, True)
    code, out, _ = run("info", file, "--fps", "30", "--json")
    assert (code, json.loads(out)["recording"]["rate_hz"]) == (0, 30)


def test_the_rate_that_a_warning_names_can_be_set(run):
    file = CASES / "datarate_100_times_of_30hz.trc"
    out = run("info", file)[1]
    remedy = re.search(r"--fps [\d.]+", out)
    assert remedy is not None
    code, out, _ = run("info", file, *shlex.split(remedy[0]), "--json")
    assert (code, json.loads(out)["recording"]["rate_hz"]) == (0, 100)
