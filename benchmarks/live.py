"""Live: how long one frame takes, and whether a million leave anything behind; each in a process of its own.

``python -m benchmarks.live [quick] [times | memory]`` prints both, or one of them.
"""

import gc
import json
import sys
import time
import warnings
from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicSpline
from threadpoolctl import threadpool_limits

import maniport as mp
from maniport.mocap import shipped_recording

from .complete import GMR
from .inputs import Array
from .measure import Row, duration, fresh_process, within
from .soak import resident

RECORDING = "ladder"
RATES = (120.0, 500.0)  # Hz
MEDIAN, RARE = 0.5e-3, 2e-3  # s
PERCENTILES = (50.0, 99.0, 99.9, 100.0)
TIMED, STEPS = 20_000, 1_000_000
GROWTH = 1.0  # MB
UNSEEN, EACH = 100, 5_000
"""While memory is looked at, so many frames in so many show nobody: the robot brakes, rests and gets back."""
TIMEOUT = 7200.0  # s


def rows(quick: bool) -> Iterator[Row]:
    """Two rows for each rate, and one for the memory."""
    found = fresh_process("-m", __name__, *(["quick"] if quick else []), timeout=TIMEOUT)[1]
    for rate, (median, high, rare, worst) in zip(RATES, found["seconds"], strict=True):
        what = f"live: a frame at {rate:g} Hz in, joint positions of the Panda out, with limits and collisions"
        note = f"processor time, of two runs the least; 99 %: {duration(high)}, largest: {duration(worst)}"
        note = f"{note}. {GMR}"
        yield within(what, median, MEDIAN, duration, note)
        yield within(f"{what}: 99.9 % of {found['timed']:,} frames", rare, RARE, duration)
    note = f"{found['blocks']} blocks of Python's memory more; without Python's garbage collector in between"
    what = f"growth of memory over the second half of {found['steps']:,} frames"
    yield within(what, found["megabytes"], GROWTH, lambda value: f"{value:.2f} MB", note)


class _Played:
    """Robots that are led by a recording, which is played at any rate, back and forth."""

    def __init__(self) -> None:
        self._recording = mp.read_recording(shipped_recording(RECORDING))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sizes = {"n_teacher": 1024, "n_student": 2048}
            self._result = mp.transfer_recording(self._recording, method="parallel-transport", **sizes)

    def frames(self, rate: float, count: int) -> Iterator[tuple[mp.Live, Array, float]]:
        """So many times the robot, a frame, and when it comes [s]."""
        live, time = mp.Live.of(self._result, clock=None), self._recording.time
        points = np.stack([self._recording.point(name) for name in live.points], axis=1)
        shown = CubicSpline(time, points)(np.arange(time[0], time[-1], 1.0 / rate))
        there_and_back = 2 * len(shown) - 2
        for i in range(count):
            at = i % there_and_back
            yield live, shown[min(at, there_and_back - at)], i / rate


def _clocked(played: _Played, rate: float, count: int) -> list[float]:
    """Times of frames [s]: the least of two runs for each, since others use the machine, too."""
    taken = np.full((2, count), np.inf)
    for run in taken:
        for i, (live, frame, t) in enumerate(played.frames(rate, count)):
            begin = time.thread_time()
            live.step(frame, t)
            run[i] = time.thread_time() - begin
    return [float(one) for one in np.percentile(taken.min(axis=0)[1:], PERCENTILES)]


def _grown(played: _Played, count: int) -> dict[str, float]:
    """What the second half of many frames adds to the memory [MB] and to the blocks of Python's."""
    gc.disable()
    before = resident(), sys.getallocatedblocks()
    for i, (live, frame, t) in enumerate(played.frames(RATES[-1], count)):
        if i == count // 2:
            before = resident(), sys.getallocatedblocks()
        live.step(None if i % EACH < UNSEEN else frame, t)
    return {"megabytes": resident() - before[0], "blocks": sys.getallocatedblocks() - before[1]}


def _main(words: list[str]) -> None:
    timed, steps = (1_000, 4_000) if "quick" in words else (TIMED, STEPS)
    played, found = _Played(), {}
    with threadpool_limits(1):
        if "memory" not in words:
            found |= {"seconds": [_clocked(played, rate, timed) for rate in RATES], "timed": timed}
        if "times" not in words:
            found |= {**_grown(played, steps), "steps": steps}
    print(json.dumps(found))


if __name__ == "__main__":
    _main(sys.argv[1:])
