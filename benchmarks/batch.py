"""A batch of recordings on two robots: seconds of recording per second of processor time."""

import json
import resource
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import maniport as mp
from maniport.mocap import shipped_recording

from .measure import Row, duration, fresh_process

ROBOTS = ("panda", "ur5")


def rows(quick: bool) -> Iterator[Row]:
    """Yield a batch of clips by one process and by two."""
    clips = 2 if quick else 12
    with tempfile.TemporaryDirectory() as folder:
        one, two = (
            fresh_process("-m", __name__, str(clips), str(processes), folder)
            for processes in (1, 2)
        )
    speed = one["recorded"] / one["cpu"]
    yield Row(
        f"batch of {clips} clips of 9 s on {len(ROBOTS)} robots",
        duration(one["cpu"]),
        ratio=f"{speed:.3g} s of recording per s",
        bound="≥ 15",
        met=speed >= 15.0,
        note=f"processor time of one process; {one['failed']} failed",
    )
    ratio = one["wall"] / two["wall"]
    peer = f"1 process: {duration(one['wall'])}"
    met = ratio >= 1.7
    yield Row(
        "the same by 2 processes", duration(two["wall"]), peer, f"{ratio:.3g}×", "≥ 1.7×", met
    )


def main(count: int, processes: int, folder: Path) -> None:
    """Transfer clips of the bundled recordings; print times as JSON."""
    clips = folder / "clips"
    clips.mkdir(exist_ok=True)
    for i in range(count):
        whole = mp.read_recording(shipped_recording(("ladder", "freeform")[i % 4 == 3]))
        start = (1.7 * i) % max(whole.duration - 9.0, 0.1)
        whole.crop(start, min(start + 9.0, whole.duration)).save(clips / f"{i:02d}.npz")
    warnings.simplefilter("ignore")
    begin = time.perf_counter()
    batch = mp.transfer_batch(
        [str(clips / "*.npz")], ROBOTS, folder / f"by-{processes}", processes=processes
    )
    wall = time.perf_counter() - begin
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(
        json.dumps(
            {
                "wall": wall,
                "cpu": sum(one.ru_utime + one.ru_stime for one in used),
                "failed": len(batch.failed),
                "recorded": sum(row.get("recording.duration_s") or 0.0 for row in batch.table),
            }
        )
    )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
