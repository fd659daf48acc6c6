"""Times of frames: a clock in the file precedes a declared rate, and contradictions are reported with both values."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dialect_files import POINTS, mirrored
from format_files import (
    SAUL,
    amass,
    write_csv,
    write_json,
    write_mot,
    write_motive,
    write_mvnx,
    write_nexus,
    write_qualisys,
    write_trc,
)
from maniport.errors import FileFormatError, InvalidInputError
from maniport.mocap import read_recording
from maniport.mocap.readers.times import FileTimes, frame_times

CASES = Path(__file__).parent / "cases"


@pytest.fixture(scope="module")
def whole(made):
    """The motion with the names of segments, at 50 Hz."""
    return made.recording(mirrored(POINTS["MVNX"]))


@pytest.fixture(scope="module")
def lossy(markers):
    """The motion at 50 Hz without the frames 10 to 24, so that it has a gap of 0.32 s."""
    kept = np.delete(np.arange(len(markers)), np.arange(10, 25))
    return replace(markers, positions=markers.positions[kept], time=markers.time[kept])


def reported(messages, *words):
    return any(all(word in text for word in words) for text in messages)


def with_frames(file, attributes):
    """Replace the attributes of the frames of an MVNX file."""
    before, *frames = file.read_text().split('<frame time="')
    frames = [frame.partition('"')[2] for frame in frames]
    identity = '<frame time="0"' + frames[0]
    rest = [f"<frame {text}{frame}" for text, frame in zip(attributes, frames[1:], strict=True)]
    file.write_text(before + identity + "".join(rest))
    return file


STAMPS = {
    "time": lambda i: f'time="{i * 20}"',
    "ms": lambda i: f'ms="{1_700_000_000_000 + i * 20}"',
    "index": lambda i: f'index="{i}"',
    "all": lambda i: f'time="{i * 20}" index="{i}" ms="{1_700_000_000_000 + i * 20 + i % 3}"',
}


@pytest.mark.parametrize("stamp", STAMPS)
def test_lost_frames_of_mvnx_are_gaps(tmp_path, whole, stamp):
    kept = np.delete(np.arange(40), np.arange(10, 25))
    part = replace(whole, positions=whole.positions[kept], time=whole.time[kept])
    file = with_frames(write_mvnx(tmp_path / "a.mvnx", part), map(STAMPS[stamp], kept))
    recording = read_recording(file)
    assert_allclose(recording.time, whole.time[kept], atol=1e-9)
    assert recording.rate == pytest.approx(50)
    assert reported(recording.quality_warnings, "gap", "0.32")


def test_a_frame_rate_of_mvnx_that_contradicts_its_times(tmp_path, whole):
    file = write_mvnx(tmp_path / "a.mvnx", whole)
    file.write_text(file.read_text().replace('frameRate="50"', 'frameRate="120"'))
    recording = read_recording(file)
    assert recording.rate == pytest.approx(50)
    assert reported(recording.quality_warnings, "120", "50", "rate=")
    again = read_recording(file, rate=120)
    assert again.rate == pytest.approx(120)
    assert reported(again.notes, "caller", "120")
    assert reported(again.notes, "50 (time)")


def test_clocks_of_mvnx_that_contradict_each_other(tmp_path, whole):
    """Times that only count frames give way to frame numbers that skip lost ones."""
    kept = np.delete(np.arange(40), np.arange(10, 25))
    part = replace(whole, positions=whole.positions[kept], time=whole.time[kept])
    stamps = [f'time="{20 * i}" index="{k}"' for i, k in enumerate(kept)]
    recording = read_recording(with_frames(write_mvnx(tmp_path / "a.mvnx", part), stamps))
    assert_allclose(recording.time, whole.time[kept], atol=1e-9)
    assert reported(recording.quality_warnings, "0.480", "0.780")


def test_the_times_of_a_trc_precede_its_data_rate():
    recording = read_recording(CASES / "datarate_100_times_of_30hz.trc")
    assert_allclose(recording.time, np.arange(60) / 30, atol=1e-9)
    assert reported(recording.quality_warnings, "100", "30")
    by_rate = read_recording(CASES / "datarate_100_times_of_30hz.trc", rate=100.0)
    assert_allclose(by_rate.time, np.arange(60) / 100, atol=1e-9)
    assert by_rate.quality_warnings == ()


@pytest.mark.parametrize(
    ("write", "name", "key"),
    [
        (write_trc, "a.trc", "DataRate"),
        (write_motive, "a.csv", "Capture Frame Rate"),
        (write_qualisys, "a.tsv", "FREQUENCY"),
    ],
)
def test_a_declared_rate_that_contradicts_the_times_is_reported(
    tmp_path, markers, write, name, key
):
    file = write(tmp_path / name, markers)
    agreeing = read_recording(file)
    assert agreeing.quality_warnings == ()
    text = file.read_text()
    for old in ("50.000000", "50.00", "FREQUENCY\t50"):
        text = text.replace(
            old, old.replace("50", "200", 1) if "FREQ" not in old else "FREQUENCY\t200"
        )
    file.write_text(text)
    recording = read_recording(file)
    assert_allclose(recording.time, markers.time, atol=1e-6)
    assert reported(recording.quality_warnings, "200", "50", key)


@pytest.mark.parametrize(
    ("write", "name"),
    [
        (write_trc, "a.trc"),
        (write_motive, "a.csv"),
        (write_qualisys, "a.tsv"),
        (write_csv, "b.csv"),
    ],
)
def test_lost_frames_are_gaps_in_every_table(tmp_path, lossy, write, name):
    recording = read_recording(write(tmp_path / name, lossy))
    assert_allclose(recording.time, lossy.time, atol=1e-5)
    assert reported(recording.quality_warnings, "gap", "0.32")


def test_frame_numbers_of_nexus_skip_lost_frames(tmp_path, markers):
    """Nexus writes frame numbers and a rate, but no times."""
    file = write_nexus(tmp_path / "a.csv", markers)
    lines = file.read_text().splitlines()
    first = lines.index("Trajectories") + 5
    file.write_text("\n".join(lines[: first + 10] + lines[first + 25 :]) + "\n")
    recording = read_recording(file)
    assert_allclose(recording.time, np.delete(markers.time, np.arange(10, 25)), atol=1e-9)
    twice = [line.replace(",", ",", 1) for line in lines]
    for i in range(first, first + 40):
        number, _, rest = twice[i].partition(",")
        twice[i] = f"{2 * int(number)},{rest}"
    file.write_text("\n".join(twice) + "\n")
    assert_allclose(read_recording(file).time, markers.time, atol=1e-9)


def test_rounded_times_are_those_of_the_rate(tmp_path, markers):
    """Times to hundredths of a second at 60 Hz are an even rate; lost frames show in them nevertheless."""
    fast = replace(markers, time=np.arange(40) / 60)
    file = write_trc(tmp_path / "a.trc", replace(fast, time=np.round(fast.time, 2)))
    text = file.read_text()
    rate = f"{1 / 0.02:.2f}"
    file.write_text(text.replace(rate, "60.00"))
    recording = read_recording(file)
    assert_allclose(recording.time, fast.time, atol=1e-9)
    assert recording.quality_warnings == ()


def test_irregular_times_are_kept(tmp_path, markers):
    """Times of a camera without a fixed rate are no rounding of an even one."""
    time = markers.time + 0.006 * np.sin(1.7 * np.arange(40))
    uneven = replace(markers, time=time)
    assert_allclose(read_recording(write_csv(tmp_path / "a.csv", uneven)).time, time, atol=1e-6)
    frames = [
        {"t": t, "joints": dict(zip(markers.names, places.tolist(), strict=True))}
        for t, places in zip(time, np.nan_to_num(markers.positions), strict=True)
    ]
    content = {"fps": 50, "frames": frames}
    recording = read_recording(write_json(tmp_path / "a.json", content), unit="m")
    assert_allclose(recording.time, time, atol=1e-9)
    assert not reported(recording.quality_warnings, "rate")


def test_times_and_rate_of_json(tmp_path, markers):
    frames = [
        {"timestamp_ms": 1000 * t, "joints": dict(zip(markers.names, places.tolist(), strict=True))}
        for t, places in zip(markers.time, np.nan_to_num(markers.positions), strict=True)
    ]
    for i, frame in enumerate(frames):
        if i % 7 == 3:
            del frame["timestamp_ms"]
    file = write_json(tmp_path / "a.json", {"fps": 25, "frames": frames})
    recording = read_recording(file, unit="m")
    assert_allclose(recording.time, markers.time, atol=1e-9)
    assert reported(recording.quality_warnings, "25", "50")
    assert json.loads(file.read_text())["fps"] == 25


def test_times_and_rate_of_arrays(tmp_path, markers):
    file = tmp_path / "a.npz"
    arrays = {"names": list(markers.names), "positions": markers.positions, "unit": "m"}
    np.savez(file, **arrays, time=markers.time, fps=120)
    recording = read_recording(file)
    assert_allclose(recording.time, markers.time)
    assert reported(recording.quality_warnings, "120", "50", "fps")
    np.savez(file, **arrays, time=markers.time, fps=50.0)
    assert read_recording(file).quality_warnings == ()
    np.savez(file, **arrays, time=np.zeros(40), fps=50.0)
    recording = read_recording(file)
    assert_allclose(recording.time, markers.time, atol=1e-12)
    assert reported(recording.quality_warnings, "do not increase")


def test_rates_of_amass_that_differ(tmp_path, made):
    file = tmp_path / "a.npz"
    arrays = amass(made)
    np.savez(file, **arrays, mocap_frame_rate=120.0)
    recording = read_recording(file)
    assert reported(recording.quality_warnings, "120", "50", "mocap_framerate", "mocap_frame_rate")
    assert read_recording(file, rate=120).rate == pytest.approx(120)
    np.savez(file, **arrays, mocap_frame_rate=120.0, mocap_time_length=40 / 120)
    supported = read_recording(file)
    assert supported.rate == pytest.approx(120)
    assert reported(supported.quality_warnings, "120", "50")
    np.savez(file, **arrays, fps=50.0)
    assert read_recording(file).quality_warnings == ()


def write_rate(file, recording, rate):
    """Write points without times, in arrays or in JSON, with a value under ``fps``."""
    positions = np.nan_to_num(recording.positions)
    content = {"names": list(recording.names), "positions": positions.tolist(), "fps": rate}
    if file.suffix == ".npz":
        np.savez(file, **content)
    else:
        write_json(file, content)
    return file


@pytest.mark.parametrize("suffix", [".npz", ".json"])
@pytest.mark.parametrize("rate", ["50", "50.0", "50 Hz", "50fps", " 50 frames per second "])
def test_a_rate_as_text_is_read(tmp_path, markers, suffix, rate):
    recording = read_recording(write_rate(tmp_path / f"a{suffix}", markers, rate), unit="m")
    assert_allclose(recording.time, markers.time, atol=1e-12)


@pytest.mark.parametrize("suffix", [".npz", ".json"])
@pytest.mark.parametrize(
    "rate", ["fifty", "", "nan", "-50", "50 ms", "1/50", True, 0, -1, [50, 60], 1e300, 10**18]
)
def test_a_rate_that_is_none_is_named_and_can_be_replaced(tmp_path, markers, suffix, rate):
    file = write_rate(tmp_path / f"a{suffix}", markers, rate)
    with pytest.raises(FileFormatError, match=r"fps.*rate="):
        read_recording(file, unit="m")
    recording = read_recording(file, unit="m", rate=50)
    assert_allclose(recording.time, markers.time, atol=1e-12)


@pytest.mark.parametrize("rate", ["1" * 400, [50, [60]], {"value": 50}, None])
def test_odd_rates_of_json_are_named(tmp_path, markers, rate):
    file = write_rate(tmp_path / "a.json", markers, rate)
    with pytest.raises(FileFormatError, match=r"fps.*rate="):
        read_recording(file, unit="m")


@pytest.mark.parametrize("rate", [b"50", "50", True, [50]])
def test_a_rate_of_the_caller_is_a_number(rate):
    with pytest.raises(InvalidInputError, match="rate"):
        read_recording(CASES / "control.bvh", rate=rate)


@pytest.mark.parametrize("step", ["0.05 s", "50 ms", "50ms", "20 Hz", "20 fps", "0.05 seconds"])
def test_a_frame_time_with_a_unit(tmp_path, step):
    text = (CASES / "control.bvh").read_text(encoding="utf-8")
    file = tmp_path / "a.bvh"
    file.write_text(re.sub("Frame Time: .*", f"Frame Time: {step}", text))
    recording = read_recording(file)
    assert recording.rate == pytest.approx(20.0)
    assert recording.quality_warnings == ()


@pytest.mark.parametrize("step", ["1.#IND", "fifty", "fifty ms"])
def test_a_frame_time_that_is_none_needs_a_rate(tmp_path, step):
    text = (CASES / "control.bvh").read_text(encoding="utf-8")
    file = tmp_path / "a.bvh"
    file.write_text(re.sub("Frame Time: .*", f"Frame Time: {step}", text))
    with pytest.raises(FileFormatError, match="Frame Time"):
        read_recording(file)


def test_a_rate_in_the_header_of_opensim(tmp_path, made):
    file = write_mot(tmp_path / "a.sto", made.time, made.joint_angles, SAUL)
    file.write_text(file.read_text().replace("version=1", "version=1\nDataRate=100.000000"))
    recording = read_recording(file)
    assert recording.rate == pytest.approx(50)
    assert reported(recording.quality_warnings, "100", "50")


def test_what_states_no_time_needs_a_rate():
    with pytest.raises(InvalidInputError, match="rate="):
        frame_times(FileTimes(), 10)
    with pytest.raises(InvalidInputError, match="rate="):
        frame_times(FileTimes(rates={"fps": 0.0}), 10)
    with pytest.raises(InvalidInputError, match="shape"):
        frame_times(FileTimes({"time": np.zeros(3)}), 10)


def test_a_frame_time_of_zero_needs_a_rate():
    file = CASES / "frame_time_zero.bvh"
    with pytest.raises(FileFormatError, match="rate="):
        read_recording(file)
    expected = read_recording(CASES / "control.bvh")
    recording = read_recording(file, rate=30)
    assert_allclose(recording.positions, expected.positions)
    assert_allclose(recording.time, expected.time)
