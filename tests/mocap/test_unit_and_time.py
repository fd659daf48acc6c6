"""Contradictions between the points of a recording and its unit or times."""

import numpy as np
import pytest

from dialect_files import POINTS, SKELETONS, mirrored, write_bvh
from maniport.errors import FileFormatError
from maniport.mocap import Recording, read_recording
from maniport.mocap.roles import assign_roles


def test_right_options_cause_no_warning():
    for name, unit in (("ladder", "CMU"), ("freeform", "mm")):
        assert read_recording(name, unit=unit).quality_warnings == ()


@pytest.mark.parametrize("unit", ["m", "mm", "inch"])
def test_an_impossible_unit_is_rejected(tmp_path, made, unit):
    skeleton_file = write_bvh(tmp_path / "small.bvh", SKELETONS["LAFAN1"], made)
    with pytest.raises(FileFormatError, match=f"small.bvh: unit='{unit}' .*unit='cm' makes it 0.3"):
        read_recording(skeleton_file, unit=unit)


def test_of_several_bodies_one_is_used(tmp_path, made):
    markers = made.recording(mirrored(POINTS["Plug-in Gait"]))
    names = tuple(f"{body}:{name}" for body in "AB" for name in markers.names)
    positions = np.concatenate([markers.positions, markers.positions + 0.1], axis=1)
    file = tmp_path / "two.npz"
    Recording(names, positions, markers.time).save(file)
    both = read_recording(file)
    assert "several bodies: A, B" in both.quality_warnings[0]
    for own, body in ((None, "A"), ({"shoulder": "B:RSHO"}, "B")):
        roles = assign_roles(both, own)
        assert {name[:2] for role in ("shoulder", "elbow", "wrist") for name in roles[role]} == {
            f"{body}:"
        }
        assert roles["trunk_up"][0][0].startswith(body)
    positions[:, names.index("A:RELB")] = np.nan
    Recording(names, positions, markers.time).save(file)
    assert assign_roles(read_recording(file))["wrist"] == ("B:RWRA", "B:RWRB")


@pytest.mark.parametrize(
    ("scale", "word"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")]
)
def test_times_that_cannot_be_seconds_are_recognized(tmp_path, markers, scale, word):
    file = tmp_path / "slow.npz"
    np.savez(
        file, names=np.array(markers.names), positions=markers.positions, time=markers.time * scale
    )
    recording = read_recording(file)
    assert any(f"recognized as {word}" in note for note in recording.notes)
    np.testing.assert_allclose(recording.time, markers.time, atol=1e-12)
