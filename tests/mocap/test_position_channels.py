"""Position channels of joints below the root of a BVH file replace offsets from which they differ."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.mocap import read_recording

CASES = Path(__file__).parent / "cases"
POSITION = "Xposition Yposition Zposition "


@pytest.fixture(scope="module")
def control():
    return read_recording(CASES / "control.bvh")


def with_positions(text, offsets_of, channels_of):
    """Give every joint below the root position channels; both functions take its offset and return three numbers."""
    lines = text.splitlines()
    motion = lines.index("MOTION")
    inserted = []  # column of the channels of a joint, and its offset
    column = 0
    below_root = False
    offset = []
    for i, line in enumerate(lines[:motion]):
        words = line.split()
        if words[:1] == ["JOINT"]:
            below_root = True
        if words[:1] == ["OFFSET"]:
            offset = [float(word) for word in words[1:]]
            if below_root:
                lines[i] = "OFFSET " + " ".join(map(str, offsets_of(np.array(offset))))
        if words[:1] == ["CHANNELS"]:
            if below_root:
                inserted.append((column, np.array(offset)))
                lines[i] = f"CHANNELS {int(words[1]) + 3} {POSITION}{' '.join(words[2:])}"
            column += int(words[1])
    for i in range(motion + 3, len(lines)):
        values = lines[i].split()
        for at, joint_offset in reversed(inserted):
            values[at:at] = [f"{value:.6f}" for value in channels_of(joint_offset)]
        lines[i] = " ".join(values)
    return "\n".join(lines) + "\n"


def test_offsets_of_a_template_give_way_to_channels(control):
    recording = read_recording(CASES / "template_offsets_positions_in_channels.bvh")
    for point in ("LeftHand", "RightArm", "RightForeArm", "RightHand"):
        assert_allclose(recording.point(point), control.point(point), atol=1e-6)
    note = next(note for note in recording.notes if "position channels" in note)
    assert "10.5 units at LeftLeg" in note


@pytest.mark.parametrize(
    ("offsets_of", "channels_of", "is_used"),
    [
        (lambda offset: 0 * offset, lambda offset: offset, True),
        (lambda offset: 0.5 * offset + 3, lambda offset: offset, True),
        (lambda offset: offset, lambda offset: 0 * offset, False),
        (lambda offset: offset, lambda offset: 0 * offset + 1e-6, False),
        (lambda offset: offset, lambda offset: offset + 1e-4, False),
    ],
)
def test_channels_are_used_where_they_differ(tmp_path, control, offsets_of, channels_of, is_used):
    file = tmp_path / "a.bvh"
    text = (CASES / "control.bvh").read_text()
    file.write_text(with_positions(text, offsets_of, channels_of))
    recording = read_recording(file)
    for point in ("Neck", "LeftHand", "RightForeArm", "RightHand"):
        assert_allclose(recording.point(point), control.point(point), atol=1e-5)
    assert any("position channels" in note for note in recording.notes) == is_used


def test_hips_below_a_root_that_stands_still(tmp_path, control):
    """As in the data set of Bandai Namco: the path of the person is in the channels of the hips."""
    lines = (CASES / "control.bvh").read_text().splitlines()
    root = next(i for i, line in enumerate(lines) if line.startswith("ROOT"))
    motion = lines.index("MOTION")
    hips = lines[root:motion]
    hips[0] = "JOINT Hips"
    hips[2] = "OFFSET 0 93.0 0"
    head = ["HIERARCHY", "ROOT joint_Root", "{", "OFFSET 0 0 0"]
    head += [f"CHANNELS 6 {POSITION}Zrotation Xrotation Yrotation"]
    rows = [f"0 0 0 0 0 0 {line}" for line in lines[motion + 3 :]]
    file = tmp_path / "a.bvh"
    file.write_text("\n".join([*head, *hips, "}", *lines[motion : motion + 3], *rows]))
    recording = read_recording(file)
    assert np.ptp(control.point("Hips"), axis=0).max() >= 0
    for point in ("Hips", "Neck", "RightHand"):
        assert_allclose(recording.point(point), control.point(point), atol=1e-9)
    assert any("1 joint below the root" in note for note in recording.notes)
