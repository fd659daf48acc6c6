"""The output of a batch as few Parquet files, for many recordings: in one run, or in shards that are merged.

dataset/
  batch.json                    number of shards
  manifest.parquet, …           of one run, or merged
  shards/003-of-100/
    shard.json                  list of recordings and settings that it is a part of
    journal                     results that are not in the tables yet; removed at the end
    manifest.parquet, …
"""

import fcntl
import json
import os
import sys
import tempfile
import time as clock
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from maniport.batch.folders import Checked, shards_of
from maniport.batch.inputs import Robot, Source, digest
from maniport.batch.journal import Journal
from maniport.batch.pair import Outcome, Pair, content_of, differing
from maniport.batch.parquet_tables import (
    JOINTS,
    MANIFEST,
    METRICS,
    NAMES,
    TARGETS,
    FileStamp,
    Key,
    file_of,
    pairs_in,
    read_keys,
    read_rows,
    require_pyarrow,
    require_table,
    tables_of,
    write_manifest,
    write_table,
)
from maniport.batch.shards import Shard
from maniport.batch.table import COMPUTING, Row, failed_row
from maniport.errors import (
    FileFormatError,
    OutputError,
    argument,
    counted,
    some_of,
    typed,
)
from maniport.util.atomic_io import claim, write_text
from maniport.util.defaults import ABOUT
from maniport.util.input_limits import as_path
from maniport.util.progress import Progress, Step
from maniport.version import __version__

SHARDS = "shards"  # folder of all shards
SHARD = "shard.json"
JOURNAL = "journal"
LOCK = ".lock"
MANIFEST_SHARE = 0.02
"""Largest share of the time that is spent on writing the manifest while results come."""


@dataclass(frozen=True)
class PackedDataset:
    """Where a batch writes few Parquet files instead of a folder for each pair; `maniport.transfer_batch` takes it.

    Parameters
    ----------
    folder : str or path
        A new folder, or that of an earlier batch.
    shard : str, optional
        ``"i/n"``: process part i of n, in a folder of its own below `folder`. Default: all.

    Raises
    ------
    InvalidInputError
        When `shard` is not i/n with 1 <= i <= n.
    """

    folder: str | os.PathLike[str]
    shard: str = "1/1"

    def __post_init__(self) -> None:
        as_path(self.folder, "folder")
        Shard.parse(self.shard)

    def merge(self, progress: Progress | None = None) -> "Merged":
        """Join the tables of all shards in the dataset's folder; the shards stay.

        Returns
        -------
        Merged
            Number of pairs, and the rows of those that failed.

        Raises
        ------
        OutputError
            When the folder has no shards, one is missing, incomplete or damaged, or belongs to another list of
            recordings or other settings: with its number.
        """
        return merge(as_path(self.folder, "folder").resolve(), progress)


class Merged(NamedTuple):
    """Result of a merge."""

    pairs: int
    failed: tuple[Row, ...]


class PackedOutput:
    """Files of a packed batch, or of one of its shards.

    Parameters
    ----------
    dataset : PackedDataset
    overwrite : bool
        Whether results of other recordings or settings, and damaged files, are replaced.
    """

    def __init__(self, dataset: PackedDataset, overwrite: bool):
        require_pyarrow()
        self.dataset = as_path(dataset.folder, "output").resolve()
        self.shard = Shard.parse(dataset.shard)
        self.folder = shard_folder(self.dataset, self.shard)
        self.part = ""
        if self.shard.count > 1:
            self.part = f" of shard {self.shard}"
        self._overwrite = overwrite
        self._rows: dict[Key, Row] = {}  # of the manifest
        self._stored: set[Key] = (
            set()
        )  # pairs in the tables, of which the journal has no newer result
        self._is_changed = True  # whether the tables lack a result, or have one too many
        self._next_manifest = 0.0  # time after which the manifest is written again [s]
        self._journal: Journal
        self._adapters: Path

    @contextmanager
    def opened(self, sources: Sequence[Source], robots: Sequence[Robot]) -> Iterator[list[Source]]:
        """Take the folder for this process, and read what is done; give those sources that are in this shard."""
        own = self.shard.select(sources)
        _claim(self.dataset, self.shard.count)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"cannot write {str(self.folder)!r}: {error.strerror or error}"
            ) from None
        with ExitStack() as stack:
            stack.enter_context(_locked(self.folder))
            self._journal = stack.enter_context(closing(Journal(self.folder / JOURNAL)))
            stored = self._read_tables()
            self._rows = stored | self._journal.rows
            self._drop_others({(source.name, robot.name) for source in own for robot in robots})
            is_complete = file_of(self.folder, MANIFEST).exists()
            self._is_changed = self._rows != stored or not is_complete
            self._stored = stored.keys() & self._rows.keys() - self._journal.rows.keys()
            about = {
                "shard": str(self.shard),
                "recordings": digest([(source.name, source.person) for source in sources]),
                "settings": {robot.name: dict(robot.settings) for robot in robots},
            }
            write_text(self.folder / SHARD, json.dumps(about) + "\n")
            adapters = tempfile.TemporaryDirectory(prefix="maniport-")
            self._adapters = Path(stack.enter_context(adapters))
            yield own

    def _read_tables(self) -> dict[Key, Row]:
        """Return the rows of the manifest that the tables have; a damaged table is an error, unless it is replaced."""
        files = {name: file_of(self.folder, name) for name in NAMES}
        if not (files[METRICS].exists() and files[MANIFEST].exists()):
            return {}  # the journal has all results, since the tables were never completed
        try:
            require_table(files[JOINTS])
            require_table(files[TARGETS])
            keys = read_keys(files[METRICS])
            rows = {}
            for row in read_rows(files[MANIFEST]):
                row["settings"] = sys.intern(row["settings"])  # the same text in each row
                if key_of(row) in keys or row["state"] == "failed":
                    rows[key_of(row)] = row
        except FileFormatError as error:
            if not self._overwrite:
                raise OutputError(
                    f"{error}; restore it, or give {argument('overwrite')} to process all pairs of this folder again"
                ) from None
            for file in files.values():
                file.unlink(missing_ok=True)
            return {}
        return rows

    def _drop_others(self, wanted: set[Key]) -> None:
        """Forget the rows of other recordings and robots; those with a result may be dropped with `overwrite` alone."""
        others = self._rows.keys() - wanted
        done = sorted(key for key in others if self._rows[key]["state"] == "done")
        if done and not self._overwrite:
            names = some_of(f"{recording} on {robot}" for recording, robot in done)
            raise OutputError(
                f"{str(self.folder)!r} holds {counted(len(done), 'pair')} that are not of this call: {names}; give all "
                f"recordings and robots, a new folder, or {argument('overwrite')} to drop them"
            )
        for key in others:
            del self._rows[key]

    def check(self, source: Source, robots: Iterable[Robot]) -> Checked:
        """Return the rows of the pairs of a recording that are done, and the pairs that are not.

        A file with the size and time that the manifest has is not read.
        """
        stamp = FileStamp.of(source.path)
        rows = []
        missing = []
        for robot in robots:
            pair = Pair(self.dataset, source, "", robot, typed(), self._adapters)
            earlier = self._rows.get(pair.names)
            if earlier is None or earlier["state"] == "failed":
                missing.append(pair)
                continue
            content = earlier["content"]
            if stamp != (earlier["size"], earlier["modified_ns"]):
                content = content_of(source)
            why = _difference(earlier, robot, content)
            if not why:
                rows.append(earlier)
                continue
            if not self._overwrite:
                raise OutputError(
                    f"{str(self.folder)!r} holds another result of {source.name!r} on {robot.name!r}: {why}; "
                    f"give {argument('overwrite')} to replace such results, or a new folder"
                )
            missing.append(pair)
        return Checked(rows, missing)

    def keep(self, pair: Pair, outcome: Outcome) -> Row:
        """Append the result of a pair to the journal; return its row of the manifest, and of a failure that given."""
        row = outcome.row
        manifest: Row = {
            "recording": row["recording"],
            "robot": row["robot"],
            "state": row["state"],
            "reason": row["reason"],
            "path": str(pair.source.path),
            "settings": settings_text(pair.robot),
            COMPUTING: row[COMPUTING],
        }
        packed = outcome.packed
        tables = tables_of(manifest, None, None)
        if packed is not None:
            manifest["size"] = packed.stamp.size
            manifest["modified_ns"] = packed.stamp.modified_ns
            manifest["content"] = packed.content
            manifest["joints"] = packed.result.joints
            tables = tables_of(manifest, row, packed.result)
        self._journal.append(tables)
        self._rows[pair.names] = manifest
        self._stored.discard(pair.names)
        self._is_changed = True
        if clock.monotonic() >= self._next_manifest:
            self._write_manifest()
        if packed is None:
            return row
        return manifest

    def _write_manifest(self) -> None:
        """Write the manifest of all pairs so far; the larger it is, the longer until it is written again."""
        begun = clock.monotonic()
        write_manifest(file_of(self.folder, MANIFEST), self._rows)
        now = clock.monotonic()
        self._next_manifest = now + (now - begun) / MANIFEST_SHARE

    def rows_of(self, pairs: Iterable[Pair]) -> list[Row]:
        """Return no rows: a result is kept when its task ends."""
        return []

    def write(self, rows: Sequence[Row], count: int) -> None:
        """Write the manifest of an interrupted batch; its journal stays."""
        self._write_manifest()

    def finish(self, rows: Sequence[Row], robots: Iterable[Robot], progress: Progress) -> None:
        """Write the tables of all pairs; the journal is removed at the end, so that this can be interrupted."""
        step = Step(progress, "Write tables")
        if self._is_changed:
            self._write_tables()
        self._journal.path.unlink()
        step.end()

    def _write_tables(self) -> None:
        """Write the tables of all pairs from the earlier ones and the journal; the manifest is last."""
        done = {key for key, row in self._rows.items() if row["state"] == "done"}
        stored = self._stored & done
        for name in (JOINTS, TARGETS, METRICS):
            file = file_of(self.folder, name)
            sources = [self._journal.pairs(name, done)]
            if stored:
                sources.append(pairs_in(file, stored))
            write_table(file, name, sources)
        self._write_manifest()

    def table(self, rows: Sequence[Row]) -> tuple[Row, ...]:
        """Read the complete rows of the table, in the order of those given."""
        metrics = {key_of(row): row for row in read_rows(file_of(self.folder, METRICS))}
        table = []
        for manifest in rows:
            key = key_of(manifest)
            row = failed_row(*key, manifest["reason"]) | metrics.get(key, {})
            row[COMPUTING] = manifest[COMPUTING]
            table.append(row)
        return tuple(table)


def key_of(row: Row) -> Key:
    """Return the names of recording and robot of a row."""
    return row["recording"], row["robot"]


def settings_text(robot: Robot) -> str:
    """Return the digests of all settings of a robot as JSON, equal for equal settings."""
    return sys.intern(json.dumps(dict(robot.settings), sort_keys=True))


def _difference(earlier: Row, robot: Robot, content: str) -> str:
    """Name the settings in which an earlier result differs; empty where it has the same recording and settings."""
    if earlier["settings"] == settings_text(robot) and earlier["content"] == content:
        return ""
    saved = {**json.loads(earlier["settings"]), "recording": earlier["content"]}
    return differing({**robot.settings, "recording": content}, saved)


def shard_folder(dataset: Path, shard: Shard) -> Path:
    """Return the folder of a shard, which is that of the dataset where there is one only."""
    if shard.count == 1:
        return dataset
    digits = len(str(shard.count))
    return dataset / SHARDS / f"{shard.index:0{digits}}-of-{shard.count}"


def _claim(dataset: Path, count: int) -> None:
    """Take a new folder, or that of a batch of as many shards."""
    earlier = shards_of(dataset)
    if earlier is not None and earlier != count:
        raise OutputError(
            f"{str(dataset)!r} has {counted(earlier, 'shard')}; found {count}; "
            f"give {argument('shard')} i/{earlier}, or a new folder"
        )
    claim(dataset, ABOUT, {"maniport": __version__, "shards": count})


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other processes from a folder; the lock ends with this process, even when it is killed."""
    with open(folder / LOCK, "a", encoding="utf-8") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(
                f"{str(folder)!r} is written by another process; wait until it has ended, or end it"
            ) from None
        except OSError:
            pass  # a file system without locks
        yield


def merge(dataset: Path, progress: Progress | None = None) -> Merged:
    """Join the tables of all shards, as `PackedDataset.merge`."""
    require_pyarrow()
    count = shards_of(dataset)
    if count is None:
        raise OutputError(f"{str(dataset)!r} is no folder of a packed batch")
    if count == 1:
        raise OutputError(f"{str(dataset)!r} has no shards: the tables in it are complete")
    folders = []
    for index in range(1, count + 1):
        folders.append(shard_folder(dataset, Shard(index, count)))
    _require_complete(folders)
    _require_same(folders)

    step = Step(progress, f"Merge {count} shards")
    with _locked(dataset):
        try:
            for i, name in enumerate(NAMES):
                step(i / len(NAMES))
                write_table(
                    file_of(dataset, name),
                    name,
                    [pairs_in(file_of(folder, name)) for folder in folders],
                )
        except FileFormatError as error:
            raise OutputError(
                f"{error}; process this shard again with {argument('overwrite')}"
            ) from None
    pairs = 0
    failed = []
    for row in read_rows(file_of(dataset, MANIFEST)):
        pairs += 1
        if row["state"] == "failed":
            failed.append(failed_row(*key_of(row), row["reason"]))
    step.end(counted(pairs, "pair"))
    return Merged(pairs, tuple(failed))


def _require_complete(folders: Sequence[Path]) -> None:
    """Raise `OutputError` with the numbers of shards that are missing or not complete."""
    missing = []
    begun = []
    for i, folder in enumerate(folders):
        shard = str(Shard(i + 1, len(folders)))
        if (folder / JOURNAL).exists():
            begun.append(shard)
        elif not file_of(folder, MANIFEST).exists():
            missing.append(shard)
    texts = []
    if missing:
        texts.append(f"missing: {some_of(missing)}")
    if begun:
        texts.append(f"running or interrupted: {some_of(begun)}")
    if texts:
        raise OutputError(
            f"not all of the {len(folders)} shards are complete: {'; '.join(texts)}; process these with "
            f"{argument('shard')}, then merge"
        )


def _require_same(folders: Sequence[Path]) -> None:
    """Raise `OutputError` where shards are parts of different lists, or have different settings."""
    first = _about(folders[0])
    for i, folder in enumerate(folders):
        about = _about(folder)
        why = ""
        if about["recordings"] != first["recordings"]:
            why = "made from another list of recordings"
        elif about["settings"] != first["settings"]:
            why = _differing_settings(first["settings"], about["settings"])
        if why:
            raise OutputError(
                f"shard {i + 1}/{len(folders)} cannot be merged with shard 1/{len(folders)}: {why}; process one of "
                f"them again with {argument('overwrite')}"
            )


def _about(folder: Path) -> dict[str, Mapping[str, Mapping[str, str]]]:
    """Read what a shard is a part of."""
    file = folder / SHARD
    try:
        about = json.loads(file.read_text(encoding="utf-8"))
        if {"recordings", "settings"} <= about.keys():
            return dict(about)
    except (OSError, ValueError, AttributeError):
        pass
    raise OutputError(f"{file}: missing or damaged; process this shard again")


def _differing_settings(
    first: Mapping[str, Mapping[str, str]], other: Mapping[str, Mapping[str, str]]
) -> str:
    """Name the robots or the settings in which two shards differ."""
    if first.keys() != other.keys():
        return "made with other robots"
    for robot, settings in first.items():
        if settings != other[robot]:
            return differing(other[robot], settings)
    return ""
