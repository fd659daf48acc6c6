"""Many recordings on many robots: each pair once, and what is done is not done again."""

import json
import os
import time as clock
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from maniport.batch.executors import completed, cores, executor_for
from maniport.batch.inputs import ABOUT, Robot, RobotInput, Source, find_recordings, find_robots
from maniport.batch.pair import (
    ADAPTERS,
    Order,
    Task,
    content_of,
    difference,
    folder_of,
    kept_row,
    reason,
    settings_of,
    work,
)
from maniport.batch.table import FAILED, PAGE, TABLES, Row, failed_row, failures, write_overview, write_tables
from maniport.errors import InvalidInputError, ManiportWarning, OutputError, argument, typed
from maniport.motion.exports import SCENE
from maniport.pipeline.config import BATCH, CONFIG, Config
from maniport.report.write import export_files
from maniport.util.atomic_io import written_whole
from maniport.util.input_limits import as_path
from maniport.util.progress import ALMOST, Progress, Step, no_progress
from maniport.util.validation import as_count
from maniport.version import __version__

Pair = tuple[str, str]  # Names of a recording and a robot


@dataclass(frozen=True)
class Batch:
    """Result of `transfer_batch`.

    Attributes
    ----------
    folder : Path
        Where the results are: ``table.csv``, ``table.parquet``, ``index.html``, and a folder for each pair.
    table : tuple of dict
        A row for each pair, in the order of recordings and robots: ``recording``, ``robot``, ``state`` ("done" or
        "failed"), ``reason`` of a failure, ``warnings``, ``folder``, ``good``, ``verdict``, ``computing_s`` (processor
        time [s]), and metrics by their names in ``summary.json``, such as ``motion.distance.median``. All rows of all
        batches have the same keys; a number that there is not is None. ``pandas.DataFrame(batch.table)`` takes it.
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
        return (
            f"Batch({str(self.folder)!r}: {len(self.table)} pairs, {len(self.failed)} failed, {self.kept} done before)"
        )

    @property
    def failed(self) -> tuple[Row, ...]:
        """The rows of the pairs of which nothing came."""
        return tuple(row for row in self.table if row["state"] == FAILED)


def transfer_batch(
    recordings: Sequence[str | os.PathLike[str]],
    robots: Sequence[RobotInput],
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
    for arms whose lengths are equal to a centimetre. A failed pair is a warning and a row of the table; the rest
    continues. A later call, also after a kill, skips pairs whose recording, robot, settings and version of maniport are
    the same. The results are those of one process, bit for bit; only the computing times differ.

    Parameters
    ----------
    recordings : sequence of str or path
        Files, folders, and patterns such as ``recordings/**/*.bvh``; see docs/batch.md.
    robots : sequence of Arm, str or Path
        As `transfer_recording` takes them; or pairs of a robot and options of its own, such as its motion limits.
    output : str or path
        A new folder, or that of an earlier batch.
    config : Config, optional
        Options of all pairs. Default: planning effort "quick", a rate of 100 Hz and the length field, since
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
    count = cores() if processes is None else as_count(processes, "processes")
    folder = as_path(output, "output").resolve()
    found = find_recordings(recordings, without=folder)
    config = (config or BATCH).changed(**options)
    rate, pages = config.batch.profile_rate, config.batch.pages
    order = Order(folder, config.human, rate, _exports(config.motion.export, pages), pages, typed())
    arms = find_robots(robots, config, (ABOUT, PAGE, ADAPTERS, CONFIG, *TABLES))
    _claim(folder)
    rows, step = dict[Pair, Row](), Step(tell, "Check earlier results")
    tasks = list(_tasks(order, found, arms, overwrite, rows, count))
    step.end(f"{len(rows)} of {len(found) * len(arms)} pairs")
    kept, pairs = len(rows), [(source.name, robot.name) for source in found for robot in arms]
    try:
        with executor_for(min(count, max(len(tasks), 1)), dask, ray) as executor:
            rows |= _reported(completed(executor, work, tasks), len(pairs), kept, tell)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_interrupted(order, tasks, rows, pairs)) from None
    table = _write(folder, [rows[pair] for pair in pairs], len(pairs), pages)
    return Batch(folder, table, kept, clock.perf_counter() - begun)


def _write(folder: Path, table: Sequence[Row], count: int, pages: bool) -> tuple[Row, ...]:
    """Write table and overview, of all pairs or of those of the `count` that are done."""
    write_overview(folder / PAGE, table, count, write_tables(folder, table), pages)
    return tuple(table)


def _interrupted(order: Order, tasks: Iterable[Task], rows: dict[Pair, Row], pairs: Sequence[Pair]) -> str:
    """Write table and overview of the pairs that are done, or failed; return how many are done and how to continue."""
    for task in tasks:  # results are written before the task of several pairs ends
        for robot, settings in zip(task.robots, task.settings, strict=True):
            if (row := kept_row(order, task.source, robot, settings)) is not None:
                rows[task.source.name, robot.name] = row
    table = _write(order.output, [rows[pair] for pair in pairs if pair in rows], len(pairs), order.pages)
    done = sum(row["state"] != FAILED for row in table)
    again = "run the same command" if typed() else "make the same call"
    return f"{done} of {len(pairs)} pairs are done; {again} to continue"


def _exports(formats: str | Iterable[str], pages: bool) -> dict[str, str]:
    """Files by formats."""
    exports = export_files(formats)
    if SCENE in exports and not pages:
        raise InvalidInputError(f"the format {SCENE!r} shows what a report shows: give {argument('pages')} as well")
    return exports


def _claim(folder: Path) -> None:
    """Mark a folder that is new, empty but for hidden files, or that of an earlier batch."""
    about = folder / ABOUT
    try:
        earlier = "maniport" in json.loads(about.read_text(encoding="utf-8"))
    except (OSError, ValueError, TypeError):
        earlier = False
    if not earlier and folder.is_dir() and any(not file.name.startswith(".") for file in folder.iterdir()):
        raise OutputError(f"{str(folder)!r} holds other things and no batch; give {argument('output')} a new folder")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write {str(folder)!r}: {error.strerror or error}") from None
    with written_whole(about) as temporary:
        temporary.write_text(json.dumps({"maniport": __version__}) + "\n", encoding="utf-8")


def _tasks(
    order: Order, sources: Sequence[Source], robots: Sequence[Robot], overwrite: bool, rows: dict[Pair, Row], width: int
) -> Iterator[Task]:
    """Yield a task for each recording, or for each pair where there are fewer recordings than processes.

    Pairs that are done go to `rows`.
    """
    for source in sources:
        left, content = list[tuple[Robot, Mapping[str, str]]](), content_of(source)
        for robot in robots:
            settings = settings_of(order, content, robot)
            if (row := kept_row(order, source, robot, settings)) is not None:
                rows[source.name, robot.name] = row
                continue
            folder = folder_of(order, source, robot)
            if not overwrite and (why := difference(folder, settings)):
                raise OutputError(
                    f"{str(folder)!r} holds another result: {why}; give {argument('overwrite')} to replace such "
                    "results, or a new folder"
                )
            left.append((robot, settings))
        for part in [left] if len(sources) >= width else [[pair] for pair in left]:
            if part:
                yield Task(order, source, content, *(tuple(column) for column in zip(*part, strict=True)))


def _reported(ended: Iterator[tuple[Task, Any]], count: int, kept: int, tell: Progress) -> Iterator[tuple[Pair, Row]]:
    """Yield the rows as they come; report each with the time left, and warn of failures."""
    step, begun, done, failed = f"work on {count} pair{'s'[: count != 1]}", clock.perf_counter(), 0, 0
    tell(step, kept / count)
    for task, outcome in ended:
        rows = outcome
        if isinstance(outcome, Exception):
            rows = [failed_row(task.source.name, robot.name, reason(outcome)) for robot in task.robots]
        for failure in failures(rows):
            where = f"{failure['recording']} → {', '.join(failure['robots'])}"
            warnings.warn(f"{where} failed: {failure['reason']}", ManiportWarning, stacklevel=3)
        for row in rows:
            pair = row["recording"], row["robot"]
            if row["state"] == FAILED:
                failed += 1
            else:
                done += 1
                left = count - kept - done - failed
                rest = f"; {_duration((clock.perf_counter() - begun) / done * left)} left" if left else ""
                tell(" → ".join(pair), 1.0, f"{row['verdict']} ({kept + done + failed} of {count}{rest})")
            tell(step, min((kept + done + failed) / count, ALMOST))
            yield pair, row
    before = f", {kept} of them before" if kept else ""
    tell(step, 1.0, f"{kept + done} done{before}, {failed} failed")


def _duration(seconds: float) -> str:
    """A duration in the unit that suits it."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = seconds / 60.0
    return f"{minutes:.0f} min" if minutes < 90.0 else f"{minutes / 60.0:.1f} h"
