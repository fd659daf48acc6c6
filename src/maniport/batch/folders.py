"""The output of a batch as folders: one for each pair of recording and robot, a table and a page of all."""

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from maniport.batch.inputs import Robot, Source
from maniport.batch.pair import ADAPTERS, Outcome, Pair, content_of
from maniport.batch.table import PAGE, TABLES, Row, write_overview, write_tables
from maniport.errors import OutputError, argument, typed
from maniport.motion.exports import DATASET, FORMATS
from maniport.pipeline.config import CONFIG, Config
from maniport.util.atomic_io import claim
from maniport.util.defaults import ABOUT
from maniport.util.progress import Progress, Step
from maniport.version import __version__

DATASETS = FORMATS[DATASET].file
"""Folder of the LeRobot datasets of a batch, one for each robot."""
OTHER_NAMES = (ABOUT, PAGE, ADAPTERS, CONFIG, DATASETS, *TABLES)
"""Names in the folder of a batch that no robot may have."""


class Checked(NamedTuple):
    """What is done of a recording, and what is missing."""

    rows: list[Row]
    missing: list[Pair]


class FolderOutput:
    """A folder for each pair, with all files of a result.

    Parameters
    ----------
    folder : Path
    config : Config
        Options of the batch; its formats and pages are those of each pair.
    overwrite : bool
        Whether results of other recordings or settings are replaced.
    """

    def __init__(self, folder: Path, config: Config, overwrite: bool):
        self.folder = folder
        self.part = ""
        self._config = config
        self._overwrite = overwrite

    @contextmanager
    def opened(self, sources: Sequence[Source], robots: Sequence[Robot]) -> Iterator[list[Source]]:
        """Take a new folder, or that of an earlier batch; give the sources, all of which are processed."""
        if shards_of(self.folder) is not None:
            raise OutputError(
                f"{str(self.folder)!r} is a packed dataset: give {argument('packed')}, or a new folder"
            )
        claim(self.folder, ABOUT, {"maniport": __version__})
        yield list(sources)

    def check(self, source: Source, robots: Iterable[Robot]) -> Checked:
        """Return the rows of the pairs of a recording that are done, and the pairs that are not."""
        content = content_of(source)
        rows = []
        missing = []
        for robot in robots:
            pair = Pair(self.folder, source, content, robot, typed())
            row = pair.kept_row()
            if row is not None:
                rows.append(row)
                continue
            if not self._overwrite:
                self._require_none(pair)
            missing.append(pair)
        return Checked(rows, missing)

    def _require_none(self, pair: Pair) -> None:
        """Raise `OutputError` where the folder of a pair holds another result."""
        why = pair.difference()
        if why:
            raise OutputError(
                f"{str(pair.folder)!r} holds another result: {why}; give {argument('overwrite')} to replace such "
                "results, or a new folder"
            )

    def keep(self, pair: Pair, outcome: Outcome) -> Row:
        """Return the row of a pair, whose folder the worker wrote."""
        return outcome.row

    def rows_of(self, pairs: Iterable[Pair]) -> list[Row]:
        """Return the rows of those pairs that have a result: they may be written before their task ends."""
        rows = []
        for pair in pairs:
            row = pair.kept_row()
            if row is not None:
                rows.append(row)
        return rows

    def write(self, rows: Sequence[Row], count: int) -> None:
        """Write table and overview; `count` is the number of pairs of the batch."""
        tables = write_tables(self.folder, rows)
        write_overview(self.folder / PAGE, rows, count, tables, self._config.pages)

    def table(self, rows: Sequence[Row]) -> tuple[Row, ...]:
        """Return the rows, which are complete."""
        return tuple(rows)

    def finish(self, rows: Sequence[Row], robots: Iterable[Robot], progress: Progress) -> None:
        """Write table and overview of all pairs, and the datasets that the options ask for."""
        self.write(rows, len(rows))
        if DATASET in self._config.export:
            step = Step(progress, "Write datasets")
            counts = []
            for robot in robots:
                counts.append(_write_dataset(self.folder, rows, robot.name))
            step.end(", ".join(counts))


def shards_of(folder: Path) -> int | None:
    """Return the number of shards of a packed dataset; None where a folder is none."""
    try:
        count = json.loads((folder / ABOUT).read_text(encoding="utf-8"))["shards"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    if isinstance(count, int) and count > 0:
        return count
    return None


def _write_dataset(folder: Path, table: Sequence[Row], robot: str) -> str:
    """Write a dataset of the motions that a robot may execute; return how many there are."""
    from maniport.report.dataset_export import Source, write_joint_dataset

    sources = []
    for row in table:
        if row["robot"] != robot:
            continue
        place = folder / str(row["folder"]) / FORMATS[DATASET].file
        if row["state"] == "failed":
            sources.append(Source(row["recording"], None, f"failed: {row['reason']}"))
        elif not place.is_dir():
            sources.append(Source(row["recording"], None, f"red: {row['warnings']}"))
        else:
            sources.append(Source(row["recording"], place))
    count = write_joint_dataset(folder / DATASETS / robot, sources)
    return f"{count} of {len(sources)} motions to {robot}"
