"""Recordings of many frames: reading time against `numpy.loadtxt` in the same run, memory, and parts."""

import json
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from maniport.arms import myoarm
from maniport.mocap import Recording, read_recording, synthetic_recording

from .inputs import Array
from .measure import ROOT, Row, duration, fresh_process

FRAMES = 120_000
POINTS = 24
MOST_TIMES = 2.0  # of `numpy.loadtxt`
MOST_MEMORY = 3.0  # of the array that is returned
ROUNDS = 3


def rows(quick: bool) -> Iterator[Row]:
    """Yield reading time and memory for each format; every format in a fresh process."""
    count = FRAMES // 10 if quick else FRAMES
    with tempfile.TemporaryDirectory() as folder:
        for name in WRITERS:
            file = Path(folder) / name
            WRITERS[name](file, _recording(count))
            found = fresh_process("-m", f"{__package__}.recordings", str(file))
            yield _row(name, count // 3 if name == "rows.csv" else count, found)
            file.unlink()


def _row(name: str, count: int, found: dict[str, float]) -> Row:
    ratio = found["ours"] / found["peer"]
    note = f"memory {found['memory']:.2f} × the array (≤ {MOST_MEMORY:g}); one second of it: {duration(found['part'])}"
    return Row(
        f"read {name}, {count} frames × {POINTS} points",
        duration(found["ours"]),
        f"numpy.loadtxt: {duration(found['peer'])}",
        f"{ratio:.2f}×",
        f"≤ {MOST_TIMES:g}×",
        ratio <= MOST_TIMES and found["memory"] <= MOST_MEMORY,
        note,
    )


def _recording(count: int) -> Recording:
    """Return an arm that moves for many frames, with points that fill up the number."""
    arm = myoarm()
    t = np.arange(count) / 100.0
    middle = (arm.upper + arm.lower) / 2
    half = (arm.upper - arm.lower) / 2
    q = middle + 0.4 * half * np.sin(t[:, None] + np.arange(arm.dof))
    recording = synthetic_recording(arm, q, t)
    own = recording.positions.shape[1]
    more = np.repeat(recording.positions[:, :1], POINTS - own, axis=1)
    more = more + np.linspace(0.0, 0.2, POINTS - own)[:, None]
    names = (*recording.names, *(f"marker{i}" for i in range(POINTS - own)))
    return Recording(names, np.concatenate([recording.positions, more], axis=1), t)


def _lines(table: Array, separator: str) -> Iterator[str]:
    for row in table:
        yield separator.join(f"{value:.5f}" for value in row) + "\n"


def _write_csv(file: Path, recording: Recording) -> None:
    names = [f"{name}_{axis}" for name in recording.names for axis in "xyz"]
    table = np.column_stack([recording.time, recording.positions.reshape(len(recording), -1)])
    with open(file, "w", encoding="utf-8") as stream:
        stream.write(",".join(["time", *names]) + "\n")
        stream.writelines(_lines(table, ","))


def _write_rows_of_points(file: Path, recording: Recording) -> None:
    """Write a row for each point of a third of the frames."""
    count = len(recording) // 3
    points = len(recording.names)
    times = np.repeat(recording.time[:count], points)
    table = np.column_stack([times, recording.positions[:count].reshape(-1, 3)])
    with open(file, "w", encoding="utf-8") as stream:
        stream.write("time,x,y,z,name\n")
        for i, line in enumerate(_lines(table, ",")):
            stream.write(f"{line.rstrip()},{recording.names[i % points]}\n")


def _write_trc(file: Path, recording: Recording) -> None:
    count = len(recording)
    number = np.arange(1, count + 1)
    positions = 1000 * recording.positions.reshape(count, -1)
    table = np.column_stack([number, recording.time, positions])
    labels = "\t\t\t".join(recording.names)
    axes = "\t".join(f"{axis}{i + 1}" for i in range(POINTS) for axis in "XYZ")
    with open(file, "w", encoding="utf-8") as stream:
        stream.write(f"PathFileType\t4\t(X/Y/Z)\t{file.name}\n")
        stream.write("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n")
        stream.write(f"100\t100\t{count}\t{POINTS}\tmm\n")
        stream.write(f"Frame#\tTime\t{labels}\n\t\t{axes}\n\n")
        stream.writelines(_lines(table, "\t"))


def _write_mot(file: Path, recording: Recording) -> None:
    """Write 73 columns of joint angles [°], four of which are those of an arm."""
    count = len(recording)
    columns = ["arm_flex_r", "arm_add_r", "arm_rot_r", "elbow_flex_r"]
    columns += [f"other{i}" for i in range(68)]
    angles = 40 * np.sin(recording.time[:, None] + np.arange(len(columns)))
    with open(file, "w", encoding="utf-8") as stream:
        stream.write(f"Coordinates\nnRows={count}\ninDegrees=yes\nendheader\n")
        stream.write("\t".join(["time", *columns]) + "\n")
        stream.writelines(_lines(np.column_stack([recording.time, angles]), "\t"))


def _write_bvh(file: Path, recording: Recording) -> None:
    """Write the skeleton of the bundled recording of a ladder with the angles of its frames, again and again."""
    lines = (ROOT / "src/maniport/mocap/data/ladder.bvh").read_text(encoding="utf-8").splitlines()
    motion = lines.index("MOTION")
    frames = [line for line in lines[motion + 3 :] if line.strip()]
    count = len(recording)
    with open(file, "w", encoding="utf-8") as stream:
        stream.write("\n".join([*lines[: motion + 1], f"Frames: {count}", lines[motion + 2], ""]))
        for i in range(count):
            stream.write(frames[i % len(frames)] + "\n")


WRITERS: dict[str, Callable[[Path, Recording], None]] = {
    "a.csv": _write_csv,
    "rows.csv": _write_rows_of_points,
    "a.trc": _write_trc,
    "a.mot": _write_mot,
    "a.bvh": _write_bvh,
}


def _header_lines(file: Path) -> int:
    """Return the number of lines before the numbers."""
    header = {".csv": 1, ".trc": 6, ".mot": 5}
    if file.suffix in header:
        return header[file.suffix]
    with open(file, encoding="utf-8") as stream:
        return next(i for i, line in enumerate(stream) if line.startswith("MOTION")) + 3


def _measured(file: Path) -> dict[str, float]:
    """Return least processor times [s] of both sides in turn, and the memory relative to the array."""
    columns = range(4) if file.name == "rows.csv" else None  # without the names
    delimiter = {".csv": ",", ".trc": "\t"}.get(file.suffix)
    skipped = _header_lines(file)
    times: dict[str, list[float]] = {"peer": [], "ours": [], "part": []}
    read_recording("freeform")
    for _ in range(ROUNDS):
        begin = time.process_time()
        size = np.loadtxt(file, delimiter=delimiter, skiprows=skipped, usecols=columns).nbytes
        times["peer"].append(time.process_time() - begin)
        begin = time.process_time()
        read_recording(file)
        times["ours"].append(time.process_time() - begin)
        begin = time.process_time()
        read_recording(file, start=20.0, stop=21.0)
        times["part"].append(time.process_time() - begin)
    tracemalloc.start()
    recording = read_recording(file)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    least = {name: min(values) for name, values in times.items()}
    return least | {"memory": peak / max(size, recording.positions.nbytes)}


if __name__ == "__main__":
    print(json.dumps(_measured(Path(sys.argv[1]))))
