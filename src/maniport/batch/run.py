"""Many recordings on many robots: each pair once, and what is done is not done again."""

import os
import time as clock
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

from joblib import cpu_count

from maniport.arms import Arm
from maniport.batch.executors import ClusterLostError, Executor, completed, executor_for
from maniport.batch.folders import OTHER_NAMES, FolderOutput
from maniport.batch.inputs import Robot, Source, find_recordings, find_robots
from maniport.batch.pair import Outcome, Pair, reason, work
from maniport.batch.table import Row, failed_row, failures
from maniport.errors import InvalidInputError, ManiportWarning, argument, counted, typed
from maniport.motion.exports import SCENE
from maniport.pipeline.config import BATCH, Config
from maniport.report.write import export_files
from maniport.util.input_limits import as_path
from maniport.util.progress import ALMOST, Progress, Step, no_progress
from maniport.util.validation import as_count

COMPILING_S = 28
"""Processor time for which a new worker process compiles before its first pair [s]: measured by `computing_s` of
equal pairs in one worker."""

Rows = dict[tuple[str, str], Row]  # by the names of a recording and a robot
Tasks = list[tuple[Pair, ...]]  # pairs of one recording, which a process works on


@dataclass(frozen=True)
class Batch:
    """Result of `transfer_batch`.

    Attributes
    ----------
    folder : Path
        Where the results are: ``table.csv``, ``table.parquet``, ``index.html``, and a folder for each pair.
    table : tuple of dict
        A row for each pair, in the order of recordings and robots: ``recording``, ``robot``, ``state`` ("done" or
        "failed"), ``reason``, ``warnings``, ``folder``, ``status``, ``verdict``, ``computing_s`` (processor time [s]),
        and metrics by their names in ``summary.json``, such as ``motion.distance.median``; None for missing numbers.
        All batches have the same keys. ``pandas.DataFrame(batch.table)`` takes it.
    kept : int
        How many of them were done before.
    seconds : float
        How long it took.
    """

    folder: Path
    table: tuple[Row, ...]
    kept: int
    seconds: float

    def __repr__(self) -> str:
        pairs = f"{len(self.table)} pairs, {len(self.failed)} failed, {self.kept} done before"
        return f"Batch({str(self.folder)!r}: {pairs})"

    @property
    def failed(self) -> tuple[Row, ...]:
        """The rows of the pairs of which nothing came."""
        return tuple(row for row in self.table if row["state"] == "failed")


def transfer_batch(
    recordings: Sequence[str | os.PathLike[str]],
    robots: Sequence[Arm | str | Path],
    output: str | os.PathLike[str],
    config: Config | None = None,
    *,
    processes: int | None = None,
    dask: str | None = None,
    ray: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> Batch:
    """Transfer all recordings to all robots; write the results, a table of metrics and an overview to a folder.

    It returns a `Batch`. A robot is sampled once in each process. The adapter of a person and a robot is fitted once,
    for arms whose lengths are equal when rounded to 1 cm. A failed pair is a warning and a row of the table; the rest
    continues. A later call, also after a kill, skips pairs whose recording, robot, settings and version of maniport are
    the same. The results are those of one process, bit for bit; only the computing times differ.

    Parameters
    ----------
    recordings : sequence of str or path
        Files, folders, and patterns such as ``recordings/**/*.bvh``; see docs/batch.md.
    robots : sequence of Arm, str or Path
        As `transfer_recording` takes them.
    output : str or path
        A new folder, or that of an earlier batch.
    config : Config, optional
        Options of all pairs. Default: a rate of 100 Hz and the length field, since
        ``method="auto"`` selects a method for each recording, which takes longer. Of each recording at most
        `profile_rate` ellipsoids a second are transferred, and with `pages` each pair gets a report.
    processes : int, optional
        Default: as many as there are cores.
    dask, ray : str, bool
        Address of a Dask scheduler, such as ``"scheduler:8786"``, or Ray, whose workers access the same folders.
    overwrite : bool
        Whether results of other recordings or settings are replaced.
    progress : callable, optional
    **options
        Options by name, as in `transfer_recording`; they override those of `config`.

    Raises
    ------
    ManiportError
        When a setting is wrong, nothing matches, or the folder holds other things, or results of other settings.
        Also when the cluster is lost: with how many pairs are done; table and overview of these are written before.
    KeyboardInterrupt
        At Ctrl-C, with how many pairs are done. Table and overview of these are written before.
    """
    begun = clock.perf_counter()
    tell = progress or no_progress
    if dask is not None and ray:
        raise InvalidInputError(f"{argument('dask')} and {argument('ray')} exclude one another")
    width = cpu_count()
    if processes is not None:
        width = as_count(processes, "processes")
    folder = as_path(output, "output").resolve()
    sources = find_recordings(recordings, without=folder)
    config = (config or BATCH).changed(**options)
    _check_exports(config)
    arms = find_robots(robots, config, OTHER_NAMES)
    target = FolderOutput(folder, config, overwrite)
    target.claim()

    step = Step(tell, "Check earlier results")
    on_cluster = dask is not None or ray
    split = on_cluster or len(sources) < width
    tasks, rows = _tasks(target, sources, arms, split)
    names = []
    for source in sources:
        names += [(source.name, arm.name) for arm in arms]
    kept = len(rows)
    step.end(f"{kept} of {len(names)} pairs")

    collection = _Collection(rows, len(names), tell)
    try:
        with _executor(min(width, max(len(tasks), 1)), dask, ray, tell) as executor:
            _collect(executor, tasks, collection, target)
    except (KeyboardInterrupt, ClusterLostError) as stop:
        for task in tasks:
            for row in target.rows_of(task):
                rows[names_of(row)] = row
        table = _in_order(rows, names)
        target.write(table, len(names))
        done = sum(row["state"] != "failed" for row in table)
        raise _stopped(stop, done, len(names)) from None
    table = _in_order(rows, names)
    target.finish(table, arms, tell)
    return Batch(folder, table, kept, clock.perf_counter() - begun)


def _check_exports(config: Config) -> None:
    """Raise where a format is not available, or needs a report that is not written."""
    if SCENE in export_files(config.export) and not config.pages:
        raise InvalidInputError(
            f"the format {SCENE!r} shows what a report shows: give {argument('pages')} as well"
        )


def names_of(row: Row) -> tuple[str, str]:
    """Return the names of recording and robot of a row."""
    return row["recording"], row["robot"]


def _in_order(rows: Rows, names: Sequence[tuple[str, str]]) -> tuple[Row, ...]:
    """Return the rows of those pairs that have one, in the order of the batch."""
    return tuple(rows[name] for name in names if name in rows)


def _stopped(
    stop: KeyboardInterrupt | ClusterLostError, done: int, count: int
) -> KeyboardInterrupt | ClusterLostError:
    """Return the error that ended a batch with how many pairs are done, and how to continue."""
    again = "run the same command" if typed() else "make the same call"
    state = f"{done} of {count} pairs are done; {again} to continue"
    if isinstance(stop, ClusterLostError):
        return ClusterLostError(f"{stop}; {state}")
    return KeyboardInterrupt(state)


@contextmanager
def _executor(
    processes: int, dask: str | None, ray: bool, progress: Progress
) -> Iterator[Executor]:
    """Give the executor; report the connection to a cluster."""
    if dask is None and not ray:
        with executor_for(processes, dask, ray) as executor:
            yield executor
        return
    step = Step(progress, "Connect to the cluster")
    with executor_for(processes, dask, ray) as executor:
        step.end(f"each new worker compiles for about {COMPILING_S} s of processor time")
        yield executor


def _tasks(
    target: FolderOutput, sources: Sequence[Source], robots: Sequence[Robot], split: bool
) -> tuple[Tasks, Rows]:
    """Return the tasks, and the rows of pairs that are done.

    A task is a recording with all robots, or, with `split`, one pair: where there are fewer recordings than processes,
    or their number is unknown, as on a cluster.
    """
    tasks = Tasks()
    rows = Rows()
    for source in sources:
        done, missing = target.check(source, robots)
        for row in done:
            rows[names_of(row)] = row
        if split:
            tasks += [(pair,) for pair in missing]
        elif missing:
            tasks.append(tuple(missing))
    return tasks, rows


class _Collection:
    """Rows of a batch, to which those of pairs are added as they come.

    It reports each with the time left, and warns of failures.
    """

    def __init__(self, rows: Rows, count: int, progress: Progress):
        self._rows = rows
        self._count = count
        self._progress = progress
        self._step = f"Process {counted(count, 'pair')}"
        self._begun = clock.perf_counter()
        self._kept = len(rows)
        self._failed = 0

    def begin(self) -> None:
        """Report how many were done before."""
        self._begun = clock.perf_counter()
        self._progress(self._step, self._kept / self._count)

    def add(self, rows: Sequence[Row]) -> None:
        """Add rows of one recording."""
        for failure in failures(rows):
            where = f"{failure['recording']} → {', '.join(failure['robots'])}"
            text = f"{where} failed: {failure['reason']}"
            warnings.warn(text, ManiportWarning, stacklevel=4)
        for row in rows:
            names = names_of(row)
            self._rows[names] = row
            if row["state"] == "failed":
                self._failed += 1
            else:
                state = f"{len(self._rows)} of {self._count}{self._time_left()}"
                self._progress(" → ".join(names), 1.0, f"{row['verdict']} ({state})")
            self._progress(self._step, min(len(self._rows) / self._count, ALMOST))

    def end(self) -> None:
        """Report how many are done, and how many failed."""
        before = ""
        if self._kept:
            before = f", {self._kept} of them before"
        done = len(self._rows) - self._failed
        self._progress(self._step, 1.0, f"{done} done{before}, {self._failed} failed")

    def _time_left(self) -> str:
        seconds = clock.perf_counter() - self._begun
        done = len(self._rows) - self._kept - self._failed
        left = seconds / done * (self._count - len(self._rows))
        if not left:
            return ""
        return f"; {timedelta(seconds=round(left))} left"


def _collect(
    executor: Executor, tasks: Tasks, collection: _Collection, target: FolderOutput
) -> None:
    """Run the tasks, and collect the rows of results that are where they should be.

    A result of another computer may be visible only after some time; it is verified again until then.
    """
    hidden = list[tuple[Pair, Outcome, float]]()
    collection.begin()
    for pairs, outcomes in completed(executor, work, tasks):
        if isinstance(outcomes, Exception):
            why = reason(outcomes)
            outcomes = [Outcome(failed_row(*pair.names, why)) for pair in pairs]
        rows = list[Row]()
        for pair, outcome in zip(pairs, outcomes, strict=True):
            if outcome.failed:
                outcome = outcome.reported(executor.is_cluster)
            elif not outcome.is_visible(pair):
                hidden.append((pair, outcome, clock.monotonic() + executor.shown_after))
                continue
            target.keep(pair, outcome)
            rows.append(outcome.row)
        collection.add(rows)

    for pair, outcome, last in hidden:
        visible = outcome.is_visible(pair)
        while not visible and clock.monotonic() < last:
            clock.sleep(0.5)
            visible = outcome.is_visible(pair)
        if visible:
            collection.add([outcome.row])
        else:
            pair.discard()
            collection.add([outcome.missing()])
    collection.end()
