"""Many recordings on many robots: each pair once, and what is done is not done again."""

import os
import time as clock
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from datetime import timedelta
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Protocol

from joblib import cpu_count

from maniport.arms import Arm
from maniport.batch.executors import ClusterLostError, Executor, completed, executor_for
from maniport.batch.folders import OTHER_NAMES, Checked, FolderOutput
from maniport.batch.inputs import Clip, Robot, Source, find_recordings, find_robots
from maniport.batch.packed import PackedDataset, PackedOutput
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


class Output(Protocol):
    """Where a batch writes: folders of pairs, or a packed dataset."""

    folder: Path
    part: str  # of which shard these are the pairs, for a message

    def opened(
        self, sources: Sequence[Source], robots: Sequence[Robot]
    ) -> AbstractContextManager[list[Source]]:
        """Take the folder; give those sources that are processed."""

    def check(self, source: Source, robots: Iterable[Robot]) -> Checked:
        """Return the rows of the pairs of a recording that are done, and the pairs that are not."""

    def keep(self, pair: Pair, outcome: Outcome) -> Row:
        """Keep the result or failure of a pair; return its row."""

    def rows_of(self, pairs: Iterable[Pair]) -> list[Row]:
        """Return the rows of pairs that were written before their task ended."""

    def write(self, rows: Sequence[Row], count: int) -> None:
        """Write what is done of `count` pairs."""

    def finish(self, rows: Sequence[Row], robots: Iterable[Robot], progress: Progress) -> None:
        """Write everything that is made of all pairs."""

    def table(self, rows: Sequence[Row]) -> tuple[Row, ...]:
        """Return the complete rows of the table."""


@dataclass(frozen=True)
class Batch:
    """Result of `transfer_batch`.

    Attributes
    ----------
    folder : Path
        Where the results are: ``table.csv``, ``table.parquet``, ``index.html``, and a folder for each pair; of a
        packed batch ``manifest.parquet``, ``metrics.parquet``, ``joints.parquet`` and ``targets.parquet``.
    pairs : int
        Number of pairs of recording and robot.
    failed : tuple of dict
        The rows of the pairs of which nothing came.
    kept : int
        How many of them were done before.
    seconds : float
        How long it took.
    """

    folder: Path
    pairs: int
    failed: tuple[Row, ...]
    kept: int
    seconds: float
    read: Callable[[], tuple[Row, ...]] = field(repr=False)

    def __repr__(self) -> str:
        pairs = f"{self.pairs} pairs, {len(self.failed)} failed, {self.kept} done before"
        return f"Batch({str(self.folder)!r}: {pairs})"

    @cached_property
    def table(self) -> tuple[Row, ...]:
        """A row for each pair, in the order of recordings and robots; of a packed batch read from its files.

        Its keys are ``recording``, ``robot``, ``state`` ("done" or "failed"), ``reason``, ``warnings``, ``folder``,
        ``status``, ``verdict``, ``computing_s`` (processor time [s]), and metrics by their names in ``summary.json``,
        such as ``motion.distance.median``; None for missing numbers. All batches have the same keys.
        ``pandas.DataFrame(batch.table)`` takes it.
        """
        return self.read()


def transfer_batch(
    recordings: Sequence[str | os.PathLike[str] | Clip],
    robots: Sequence[Arm | str | Path],
    output: str | os.PathLike[str] | PackedDataset,
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
    recordings : sequence of str or path, or of Clip
        Files, folders, and patterns such as ``recordings/**/*.bvh``; see docs/batch.md. `maniport.batch.read_list`
        reads a list, which may name the person of each recording.
    robots : sequence of Arm, str or Path
        As `transfer_recording` takes them.
    output : str, path or PackedDataset
        A new folder, or that of an earlier batch. A `PackedDataset` has few files, and may be processed in shards.
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
    sources = find_recordings(recordings, without=_folder_of(output))
    config = (config or BATCH).changed(**options)
    target = _output(output, config, overwrite)
    arms = find_robots(robots, config, OTHER_NAMES)
    on_cluster = dask is not None or ray

    with target.opened(sources, arms) as own:
        step = Step(tell, "Check earlier results")
        tasks, rows = _tasks(target, own, arms, split=on_cluster or len(own) < width)
        names = []
        for source in own:
            names += [(source.name, arm.name) for arm in arms]
        kept = len(rows)
        step.end(f"{kept} of {len(names)} pairs{target.part}")

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

    failed = tuple(row for row in table if row["state"] == "failed")
    read = partial(target.table, table)
    return Batch(target.folder, len(names), failed, kept, clock.perf_counter() - begun, read)


def _folder_of(output: str | os.PathLike[str] | PackedDataset) -> Path:
    """Return the folder of the output."""
    if isinstance(output, PackedDataset):
        output = output.folder
    return as_path(output, "output").resolve()


def _output(
    output: str | os.PathLike[str] | PackedDataset, config: Config, overwrite: bool
) -> Output:
    """Return the output of a batch; raise where a format is not available, or needs what is not written."""
    formats = export_files(config.export)
    if isinstance(output, PackedDataset):
        if formats or config.pages:
            raise InvalidInputError(
                f"{argument('packed')} writes neither pages nor further formats: leave out {argument('pages')} and "
                f"{argument('export')}"
            )
        return PackedOutput(output, overwrite)
    if SCENE in formats and not config.pages:
        raise InvalidInputError(
            f"the format {SCENE!r} shows what a report shows: give {argument('pages')} as well"
        )
    return FolderOutput(_folder_of(output), config, overwrite)


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
    target: Output, sources: Sequence[Source], robots: Sequence[Robot], split: bool
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
        self._progress(self._step, self._kept / max(self._count, 1))

    def add(self, rows: Sequence[Row], kept: Sequence[Row]) -> None:
        """Report rows of one recording, and keep what the output gave for them."""
        for failure in failures(rows):
            where = f"{failure['recording']} → {', '.join(failure['robots'])}"
            text = f"{where} failed: {failure['reason']}"
            warnings.warn(text, ManiportWarning, stacklevel=4)
        for row, own in zip(rows, kept, strict=True):
            names = names_of(row)
            self._rows[names] = own
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


def _collect(executor: Executor, tasks: Tasks, collection: _Collection, target: Output) -> None:
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
        kept = list[Row]()
        for pair, outcome in zip(pairs, outcomes, strict=True):
            if outcome.failed:
                outcome = outcome.reported(executor.is_cluster)
            elif not outcome.is_visible(pair):
                hidden.append((pair, outcome, clock.monotonic() + executor.shown_after))
                continue
            rows.append(outcome.row)
            kept.append(target.keep(pair, outcome))
        collection.add(rows, kept)

    for pair, outcome, last in hidden:
        visible = outcome.is_visible(pair)
        while not visible and clock.monotonic() < last:
            clock.sleep(0.5)
            visible = outcome.is_visible(pair)
        if visible:
            collection.add([outcome.row], [outcome.row])
        else:
            pair.discard()
            missing = outcome.missing()
            collection.add([missing], [missing])
    collection.end()
