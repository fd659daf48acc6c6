"""Live control: time of a frame, and growth of memory over many frames."""

import gc
import json
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from threadpoolctl import threadpool_limits

import maniport as mp
from maniport.mocap import shipped_recording

from .inputs import Array
from .measure import Row, duration, fresh_process, within

RATES = (120.0, 500.0)  # Hz


def rows(quick: bool) -> Iterator[Row]:
    """Yield two rows for each rate, one for garbage collections, and one for the memory."""
    run = fresh_process("-m", __name__, *(["quick"] if quick else []))
    for rate, (median, rare, largest) in zip(RATES, run["seconds"], strict=True):
        work = f"live step of the Panda, {rate:g} Hz"
        note = f"processor time, lesser of two runs; largest {duration(largest)}"
        yield within(f"{work}: median", median, 0.3e-3, duration, note)
        yield within(f"{work}: 99.9 %", rare, 1.0e-3, duration)
    text = f"live: longest garbage collection in {run['timed']:,} steps"
    yield within(text, run["pause"], 2e-3, duration)
    text = f"live: growth of memory over the second half of {run['steps']:,} steps"
    yield within(text, run["megabytes"], 1.0, lambda value: f"{value:.2f} MB")


def frames(rate: float, count: int) -> Iterator[tuple[mp.Live, Array, float]]:
    """Yield the controller, a frame, and its time [s]: the ladder recording, forward and backward."""
    recording = mp.read_recording(shipped_recording("ladder"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = mp.transfer_recording(
            recording, method="scaled-transport", n_teacher=1024, n_student=2048
        )
    live = mp.Live.of(result, clock=None, auto_engage=True)
    instants = recording.time
    points = np.stack([recording.point(name) for name in live.points], axis=1)
    shown = CubicSpline(instants, points)(np.arange(instants[0], instants[-1], 1.0 / rate))
    period = 2 * len(shown) - 2
    for i in range(count):
        at = i % period
        yield live, shown[min(at, period - at)], i / rate


def step_times(rate: float, count: int) -> list[float]:
    """Return median, 99.9th percentile and maximum of the times of a step [s], the lesser of two runs of each."""
    taken = np.full((2, count), np.inf)
    for run in taken:
        for i, (live, frame, t) in enumerate(frames(rate, count)):
            begin = time.thread_time()
            live.step(frame, t)
            run[i] = time.thread_time() - begin
    return [float(value) for value in np.percentile(taken.min(axis=0)[1:], (50.0, 99.9, 100.0))]


def longest_collection(count: int) -> float:
    """Return the processor time of the longest garbage collection during steps [s]."""
    begin = 0.0
    pauses = [0.0]

    def measure(phase: str, _: dict[str, int]) -> None:
        nonlocal begin
        if phase == "start":
            begin = time.thread_time()
        else:
            pauses.append(time.thread_time() - begin)

    for i, (live, frame, t) in enumerate(frames(RATES[-1], count)):
        if i == 1:
            gc.callbacks.append(measure)
        live.step(frame, t)
    gc.callbacks.remove(measure)
    return max(pauses)


def memory_growth(count: int) -> float:
    """Return the memory that the second half of many steps adds [MB]; 100 of 5000 frames are missing."""
    gc.disable()
    before = resident()
    for i, (live, frame, t) in enumerate(frames(RATES[-1], count)):
        if i == count // 2:
            before = resident()
        live.step(None if i % 5_000 < 100 else frame, t)
    return resident() - before


def resident() -> float:
    """Return the resident memory of this process [MB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return float(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024


def main(quick: bool) -> None:
    """Print times and memory as JSON."""
    timed, steps = (1_000, 4_000) if quick else (20_000, 200_000)
    with threadpool_limits(1):
        seconds = [step_times(rate, timed) for rate in RATES]
        pause = longest_collection(timed)
        print(
            json.dumps(
                {
                    "seconds": seconds,
                    "timed": timed,
                    "pause": pause,
                    "megabytes": memory_growth(steps),
                    "steps": steps,
                }
            )
        )


if __name__ == "__main__":
    main("quick" in sys.argv)
