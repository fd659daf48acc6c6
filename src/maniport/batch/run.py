"""Many recordings on many robots: each pair once, and what is done is not done again."""

import os
import time as clock
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

from joblib import cpu_count

from maniport.arms import Arm
from maniport.batch.executors import completed, executor_for
from maniport.batch.inputs import ABOUT, Robot, Source, find_recordings, find_robots
from maniport.batch.pair import ADAPTERS, Pair, content_of, reason, work
from maniport.batch.table import (
    PAGE,
    TABLES,
    Row,
    failed_row,
    failures,
    write_overview,
    write_tables,
)
from maniport.errors import InvalidInputError, ManiportWarning, OutputError, argument, typed
from maniport.motion.exports import SCENE
from maniport.pipeline.config import BATCH, CONFIG, Config
from maniport.report.write import export_files
from maniport.util.atomic_io import claim
from maniport.util.input_limits import as_path
from maniport.util.progress import ALMOST, Progress, Step, no_progress
from maniport.util.validation import as_count
from maniport.version import __version__

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
    KeyboardInterrupt
        At Ctrl-C, with how many pairs are done. Table and overview of these are written before.
    """
    begun, tell = clock.perf_counter(), progress or no_progress
    if dask is not None and ray:
        raise InvalidInputError(f"{argument('dask')} and {argument('ray')} exclude one another")
    count = cpu_count() if processes is None else as_count(processes, "processes")
    sources = find_recordings(recordings, without=(folder := as_path(output, "output").resolve()))
    config = (config or BATCH).changed(**options)
    pages = config.pages
    if SCENE in export_files(config.export) and not pages:
        raise InvalidInputError(
            f"the format {SCENE!r} shows what a report shows: give {argument('pages')} as well"
        )
    arms = find_robots(robots, config, (ABOUT, PAGE, ADAPTERS, CONFIG, *TABLES))
    claim(folder, ABOUT, {"maniport": __version__})
    step = Step(tell, "Check earlier results")
    tasks, rows = _tasks(folder, sources, arms, count, overwrite)
    names, kept = [(source.name, arm.name) for source in sources for arm in arms], len(rows)
    step.end(f"{kept} of {len(names)} pairs")

    def write() -> tuple[Row, ...]:
        table = tuple(rows[name] for name in names if name in rows)
        write_overview(folder / PAGE, table, len(names), write_tables(folder, table), pages)
        return table

    try:
        with executor_for(min(count, max(len(tasks), 1)), dask, ray) as executor:
            _collect(completed(executor, work, tasks), rows, len(names), tell)
    except KeyboardInterrupt:
        pairs = (
            pair for task in tasks for pair in task
        )  # results are written before the task of several pairs ends
        rows |= {pair.names: row for pair in pairs if (row := pair.kept_row()) is not None}
        done = sum(row["state"] != "failed" for row in write())
        again = "run the same command" if typed() else "make the same call"
        raise KeyboardInterrupt(
            f"{done} of {len(names)} pairs are done; {again} to continue"
        ) from None
    return Batch(folder, write(), kept, clock.perf_counter() - begun)


def _tasks(
    folder: Path, sources: Sequence[Source], robots: Sequence[Robot], width: int, overwrite: bool
) -> tuple[Tasks, Rows]:
    """Return a task for each recording, or for each pair if there are fewer than `width`, and rows of pairs done."""
    tasks, rows = Tasks(), Rows()
    for source in sources:
        content, missing = content_of(source), list[Pair]()
        for pair in (Pair(folder, source, content, robot, typed()) for robot in robots):
            if (row := pair.kept_row()) is not None:
                rows[pair.names] = row
                continue
            if not overwrite and (why := pair.difference()):
                raise OutputError(
                    f"{str(pair.folder)!r} holds another result: {why}; give {argument('overwrite')} to replace such "
                    "results, or a new folder"
                )
            missing.append(pair)
        tasks += (
            [(pair,) for pair in missing]
            if len(sources) < width
            else [tuple(missing)]
            if missing
            else []
        )
    return tasks, rows


def _collect(
    ended: Iterator[tuple[tuple[Pair, ...], Any]], rows: Rows, count: int, tell: Progress
) -> None:
    """Add the rows to those of earlier results as they come; report each with the time left, and warn of failures."""
    step, begun, kept, failed = (
        f"Process {count} pair{'s'[: count != 1]}",
        clock.perf_counter(),
        len(rows),
        0,
    )
    tell(step, kept / count)
    for pairs, outcome in ended:
        lost = isinstance(outcome, Exception)
        own = [failed_row(*pair.names, reason(outcome)) for pair in pairs] if lost else outcome
        for failure in failures(own):
            where = f"{failure['recording']} → {', '.join(failure['robots'])}"
            warnings.warn(f"{where} failed: {failure['reason']}", ManiportWarning, stacklevel=3)
        for row in own:
            names = row["recording"], row["robot"]
            rows[names] = row
            if row["state"] == "failed":
                failed += 1
            else:
                left = (
                    (clock.perf_counter() - begun)
                    / (len(rows) - kept - failed)
                    * (count - len(rows))
                )
                rest = f"; {timedelta(seconds=round(left))} left" if left else ""
                tell(" → ".join(names), 1.0, f"{row['verdict']} ({len(rows)} of {count}{rest})")
            tell(step, min(len(rows) / count, ALMOST))
    before = f", {kept} of them before" if kept else ""
    tell(step, 1.0, f"{len(rows) - failed} done{before}, {failed} failed")
