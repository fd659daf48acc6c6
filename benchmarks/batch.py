"""Many recordings on many robots: how quick, by how many processes, and whether it is all one however it is done."""

import csv
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import maniport as mp
from maniport.arms.human import human_arm
from maniport.batch.pair import ADAPTERS, PAIR
from maniport.batch.table import COMPUTING, PAGE, TABLES
from maniport.mocap import shipped_recording, synthetic_recording

from .measure import BATCH_PLOT, ROOT, Row, duration, failed, fresh_process
from .scale import growth

ROBOTS = ("panda", "ur5")
CLIPS, QUICK_CLIPS = 200, 6
"""Two of six are excerpts of the ladder, one of freeform, three are generated."""
COMPARED, QUICK_COMPARED = 48, 6
"""All clips are worked on once, by two processes. So many of them are worked on in all other ways: by one process, by
two, on Dask, and after a kill."""
COMPILED = 2
"""So many let functions be compiled before anything is measured."""
SHORTEST, LONGEST = 6.0, 12.0  # s
PERSONS = ((0.29, 0.25, 0.05), (0.31, 0.27, 0.05), (0.33, 0.29, 0.06))
"""Lengths of the arms of generated clips [m]."""
FPS, WAVES = 30.0, (0.1, 0.9)
"""Of generated clips [Hz]: frames, and slowest and quickest of the waves that each joint is a sum of."""
FACTOR, SCALING = 10.0, 1.8

RUN = """
import json, resource, sys, time
import maniport as mp
from maniport.pipeline import stages
aside = {"sample_robot": 0.0, "fit_map": 0.0}
def timed(name):
    whole = getattr(stages, name)
    def one(*given):
        begin = time.process_time()
        found = whole(*given)
        aside[name] += time.process_time() - begin
        return found
    setattr(stages, name, one)
if __name__ == "__main__":
    recordings, output, processes, dask, *robots = sys.argv[1:]
    if processes == "1":
        list(map(timed, list(aside)))
    begin, started = time.perf_counter(), time.process_time()
    found = mp.batch([recordings], robots, output, processes=int(processes), dask=dask or None)
    used = [resource.getrusage(one) for one in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(json.dumps({
        "wall": time.perf_counter() - begin, "cpu": sum(one.ru_utime + one.ru_stime for one in used),
        "started": started, "robots": aside["sample_robot"], "fits": aside["fit_map"],
        "pairs": len(found.table), "failed": len(found.failed), "kept": found.kept,
        "recorded": sum(row.get("recording.duration_s") or 0.0 for row in found.table),
        "distance": sorted(row["motion.distance.median"] for row in found.table if row["state"] == "done"),
    }))
"""


class Run(NamedTuple):
    """A batch in a process of its own; times are in seconds, `recorded` counts each recording for every robot.

    How much of the cores' time starts Python, gets to know the robots and fits adapters is known of one process alone.
    """

    wall: float
    cpu: float
    started: float
    robots: float
    fits: float
    pairs: int
    failed: int
    kept: int
    recorded: float
    distance: list[float]

    @property
    def factor(self) -> float:
        """Seconds of recording for each second of a core."""
        return self.recorded / self.cpu

    @property
    def of_pairs(self) -> float:
        """The same of the pairs alone."""
        return self.recorded / (self.cpu - self.started - self.robots - self.fits)


def rows(quick: bool) -> Iterator[Row]:
    """A batch of all clips; then some of them in several ways."""
    count, few = (QUICK_CLIPS, QUICK_COMPARED) if quick else (CLIPS, COMPARED)
    with tempfile.TemporaryDirectory(prefix="maniport-batch-") as name:
        folder = Path(name)
        write_clips(folder / "clips", count)
        write_clips(folder / "few", few)
        write_clips(folder / "first", COMPILED)
        batch(folder / "first", folder / "compiled", 1)
        alone, both = (batch(folder / "few", folder / f"by-{k}", k) for k in (1, 2))
        every = batch(folder / "clips", folder / "dataset", 2)
        yield _factor(every, count)
        yield _pairs(alone, few, len(list((folder / "by-1" / ADAPTERS).glob("*.npz"))))
        yield Row(
            f"{few} clips × {len(ROBOTS)} robots by 2 processes", duration(both.wall), f"1: {duration(alone.wall)}",
            f"{alone.wall / both.wall:.3g}×", f"≥ {SCALING:g}×", alone.wall / both.wall >= SCALING,
            "wall time, starting the processes and what each finds out of the robots included",
        )  # fmt: skip
        yield _same("by 2 processes", folder / "by-1", folder / "by-2")
        yield _on_dask(folder)
        yield _resumed(folder)
        if not quick:
            _plot({len(ROBOTS) * few: both.wall, len(ROBOTS) * count: every.wall})
            exponent = growth(both.wall, every.wall, count / few)
            yield Row(
                f"growth of time from {few} to {count} recordings", f"N^{exponent:.2f}", "", f"N^{exponent:.2f}", "–",
                None, "2 processes",
            )  # fmt: skip


def batch(clips: Path, output: Path, processes: int, dask: str = "") -> Run:
    """Do it in a process of its own."""
    words = ["-W", "ignore", "-c", RUN, str(clips / "*.npz"), str(output), str(processes), dask, *ROBOTS]
    return Run(**fresh_process(*words, timeout=7200.0)[1])


def write_clips(folder: Path, count: int) -> None:
    """Write clips: excerpts of the shipped recordings, and arms of three persons that move in waves."""
    folder.mkdir()
    random = np.random.default_rng(0)
    shipped = {name: mp.read_recording(shipped_recording(name)) for name in ("ladder", "freeform")}
    for k in range(count):
        lasts = random.uniform(SHORTEST, LONGEST)
        name = ("ladder", "waves", "freeform", "waves", "ladder", "waves")[k % 6]
        if name == "waves":
            clip = _waves(PERSONS[k // 2 % len(PERSONS)], lasts, random)
        else:
            whole = shipped[name]
            lasts = min(lasts, whole.duration)
            start = float(whole.time[0] + random.uniform(0.0, whole.duration - lasts))
            clip = whole.crop(start, start + lasts)
        np.savez(folder / f"{k:03d}-{name}.npz", names=clip.names, positions=clip.positions, rate=clip.rate)


def _waves(lengths: tuple[float, ...], lasts: float, random: np.random.Generator) -> mp.Recording:
    """A motion of all joints in the middle half of their ranges."""
    arm = human_arm("myoarm", lengths=dict(zip(("upper arm", "forearm", "hand"), lengths, strict=True)))
    time_ = np.arange(round(lasts * FPS)) / FPS
    hertz, phase = random.uniform(*WAVES, (3, 1, arm.dof)), random.uniform(0.0, 2.0 * np.pi, (3, 1, arm.dof))
    waves = np.sin(2.0 * np.pi * hertz * time_[:, None] + phase).mean(axis=0)
    return synthetic_recording(arm, 0.5 * (arm.lower + arm.upper) + 0.25 * (arm.upper - arm.lower) * waves, time_)


def _factor(run: Run, count: int) -> Row:
    d = run.distance
    return Row(
        f"{count} clips of {SHORTEST:g} to {LONGEST:g} s × {', '.join(ROBOTS)}, without pages",
        f"{duration(run.wall)} by 2 processes, {run.cpu:.0f} s of cores",
        "",
        f"{run.factor:.3g} s of recording per second of a core",
        f"≥ {FACTOR:g}",
        run.factor >= FACTOR and run.failed == 0,
        f"each recording counts for each robot, and all that is done once is in it; {run.failed} of {run.pairs} pairs "
        f"failed; median distances {d[len(d) // 2]:.2f}, from {d[0]:.2f} to {d[-1]:.2f}",
    )


def _pairs(run: Run, count: int, adapters: int) -> Row:
    work = run.cpu - run.started - run.robots - run.fits
    return Row(
        f"{count} of these clips by 1 process, the pairs alone", f"{work:.0f} s of {run.cpu:.0f} s of the core", "",
        f"{run.of_pairs:.3g} s of recording per second of the core", "–", None,
        f"once for each process: {run.started:.1f} s to start, {run.robots:.1f} s to know the robots; once for all: "
        f"{run.fits:.1f} s to fit {adapters} adapters",
    )  # fmt: skip


def _on_dask(folder: Path) -> Row:
    work = "the same bytes on two workers of Dask"
    try:
        import distributed
    except ImportError:
        return failed(work, "the same", "distributed is not installed")
    options = {"n_workers": 2, "threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None}
    with distributed.LocalCluster(**options, silence_logs="ERROR") as cluster:
        batch(folder / "few", folder / "by-dask", 1, cluster.scheduler_address)
    return _same("on two workers of Dask", folder / "by-1", folder / "by-dask")


def _resumed(folder: Path) -> Row:
    """Kill it when a third is done, and go on."""
    output, third = folder / "killed", len(list((folder / "few").iterdir())) * len(ROBOTS) // 3
    words = [sys.executable, "-W", "ignore", "-c", RUN, str(folder / "few" / "*.npz"), str(output), "2", "", *ROBOTS]
    process = subprocess.Popen(words, cwd=ROOT, start_new_session=True, stdout=subprocess.DEVNULL)
    while (
        process.poll() is None and sum(PAIR in files for _, _, files in os.walk(output)) < third
    ):  # folders come and go
        time.sleep(0.1)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    run = batch(folder / "few", output, 2)
    return _same(f"after a kill, with {run.kept} of {run.pairs} pairs done", folder / "by-1", output)


def _same(how: str, one: Path, other: Path) -> Row:
    """Compare the bytes of all results, and the tables without the computing times, of two folders."""
    first, second = _files(one), _files(other)
    differing = sorted(set(first) ^ set(second)) + [name for name in first if first[name] != second.get(name)]
    figure = "the same" if not differing else f"{len(differing)} files differ, such as {differing[0]}"
    note = f"{len(first)} files: {TABLES[0]} without computing times, adapters, and for each pair motion and summaries"
    return Row(f"the bytes {how}", figure, "by 1 process", figure, "the same", not differing, note)


def _files(folder: Path) -> dict[str, bytes]:
    with open(folder / TABLES[0], newline="", encoding="utf-8") as stream:
        table = [{**row, COMPUTING: ""} for row in csv.DictReader(stream)]
    timed = {PAIR, PAGE, *TABLES}
    found = (file for file in folder.rglob("*") if file.is_file() and file.name not in timed)
    files = {name: file.read_bytes() for file in found if "/." not in (name := f"/{file.relative_to(folder)}")}
    return {**files, TABLES[0]: repr(table).encode()}


def _plot(walls: dict[int, float]) -> None:
    figure = Figure(figsize=(4.2, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.loglog(list(walls), list(walls.values()), "o-", color="#1f5a99")
    axes.set_xlabel("pairs of recording and robot")
    axes.set_ylabel("time by 2 processes [s]")
    axes.grid(True, which="both", alpha=0.3)
    figure.savefig(BATCH_PLOT, dpi=130)
