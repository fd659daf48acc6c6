"""The Parquet tables of a packed batch, sorted by recording and robot, and the results that they are made of.

    manifest   a row per pair: what was done with which file, settings and processor time
    metrics    a row per pair that is done: the columns of the table of a batch
    joints     a row per control step
    targets    a row per target ellipsoid

Equal results give equal bytes, but for the processor times, which are in the manifest alone.
"""

import heapq
import itertools
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from maniport.batch.table import COLUMNS, COMPUTING, TEXTS, Row
from maniport.errors import FileFormatError
from maniport.pipeline.results import ArmTransfer, TransferResult
from maniport.util.atomic_io import written_whole
from maniport.util.optional import arrow_of_batches, parquet_of_batches
from maniport.util.validation import Array

if TYPE_CHECKING:
    import pyarrow

MANIFEST = "manifest"
METRICS = "metrics"
JOINTS = "joints"
TARGETS = "targets"
NAMES = (JOINTS, TARGETS, METRICS, MANIFEST)
"""Tables in the order in which they are written: where the metrics have a pair, the joints and targets have it."""

GROUP_ROWS = 16_384
"""Rows of a row group, and a pair more: 1.5 MB of joints, so that a merge of 100 shards takes 150 MB of memory."""

Key = tuple[str, str]
"""Names of recording and robot."""
Tables = Mapping[str, "pyarrow.Table"]
"""The tables of one pair by name."""


def file_of(folder: Path, name: str) -> Path:
    """Return the file of a table."""
    return folder / f"{name}.parquet"


def require_pyarrow() -> None:
    """Raise `MissingPackageError` where pyarrow is not installed."""
    parquet_of_batches()


class FileStamp(NamedTuple):
    """Size and time of a recording, by which a later call finds it unchanged without reading it."""

    size: int  # [B]
    modified_ns: int  # latest modification since 1970 [ns]

    @classmethod
    def of(cls, path: Path) -> "FileStamp":
        """Return the stamp of a file, or of the frames in a folder; zeros where it cannot be read."""
        files = [path]
        if path.is_dir():
            files = sorted(path.glob("*.json"))
        size = 0
        modified_ns = 0
        try:
            for file in files:
                status = file.stat()
                size += status.st_size
                modified_ns = max(modified_ns, status.st_mtime_ns)
        except OSError:
            return cls(0, 0)
        return cls(size, modified_ns)


class ArmSamples(NamedTuple):
    """Targets of one arm."""

    arm: str
    time: Array  # (n,), from the first control step of the robot, where it was moved [s]
    targets: Array  # (n, d, d), in the robot's base frame
    path: Array | None  # (n, 3), target positions of the end effector [m]
    distance: Array | None  # (n,), of achieved from target ellipsoids


class PackedResult(NamedTuple):
    """What a worker returns of a pair instead of a folder."""

    joints: tuple[str, ...]  # names of the joints; none where the robot was not moved
    time: Array  # (m,), of the control steps, from the first [s]
    positions: Array  # (m, dof) [rad] or [m]
    velocities: Array  # (m, dof)
    arms: tuple[ArmSamples, ...]

    @classmethod
    def of(cls, result: TransferResult) -> "PackedResult":
        """Return the joints and targets of a result."""
        if result.motion is None:
            empty = np.empty((0, 0))
            return cls((), np.empty(0), empty, empty, tuple(map(_mapped_targets, result.arms)))
        trajectory = result.motion.trajectory
        begin = float(trajectory.control_time[0])
        return cls(
            joints=tuple(trajectory.joint_names),
            time=trajectory.control_time - begin,
            positions=trajectory.control_positions,
            velocities=trajectory.control_velocities,
            arms=tuple(_placed_targets(arm, begin) for arm in result.arms),
        )


def _mapped_targets(arm: ArmTransfer) -> ArmSamples:
    """Return targets that were not placed, since the robot was not moved."""
    return ArmSamples(arm.name, arm.time, arm.target_profile, None, None)


def _placed_targets(arm: ArmTransfer, begin: float) -> ArmSamples:
    """Return the targets of a motion, which begins at a time [s]."""
    motion = arm.motion
    assert motion is not None
    targets = arm.spec.of_bounded(motion.target)
    return ArmSamples(arm.name, motion.time - begin, targets, motion.path, motion.distance)


def schema_of(name: str) -> "pyarrow.Schema":
    """Return the columns of a table, with their units."""
    arrow = arrow_of_batches()

    text = arrow.string()
    number = arrow.float64()
    numbers = arrow.list_(number)
    fields = [arrow.field("recording", text), arrow.field("robot", text)]
    if name == MANIFEST:
        fields += [
            arrow.field("state", text),
            arrow.field("reason", text),
            arrow.field("path", text),
            arrow.field("size", arrow.int64(), metadata={"unit": "B"}),
            arrow.field("modified_ns", arrow.int64(), metadata={"unit": "ns"}),
            arrow.field("content", text),
            arrow.field("settings", text),
            arrow.field("joints", arrow.list_(text)),
            arrow.field(COMPUTING, number, metadata={"unit": "s"}),
        ]
    if name == METRICS:
        fields = []
        for column in COLUMNS:
            if column != COMPUTING:
                fields.append(arrow.field(column, text if column in TEXTS else number))
    if name == JOINTS:
        fields += [
            arrow.field("time_s", number, metadata={"unit": "s"}),
            arrow.field("position", numbers, metadata={"unit": "rad or m"}),
            arrow.field("velocity", arrow.list_(arrow.float32()), metadata={"unit": "1/s"}),
        ]
    if name == TARGETS:
        fields += [
            arrow.field("arm", text),
            arrow.field("time_s", number, metadata={"unit": "s"}),
            arrow.field("ellipsoid", numbers),
            arrow.field("position", numbers, metadata={"unit": "m"}),
            arrow.field("distance", number),
        ]
    return arrow.schema(fields)


def tables_of(
    manifest: Row, metrics: Row | None, result: PackedResult | None
) -> dict[str, "pyarrow.Table"]:
    """Return the tables of a pair; of a failure the manifest alone has a row."""
    arrow = arrow_of_batches()

    tables = {name: schema_of(name).empty_table() for name in NAMES}
    tables[MANIFEST] = arrow.Table.from_pylist([manifest], schema_of(MANIFEST))
    if metrics is not None:
        tables[METRICS] = arrow.Table.from_pylist([metrics], schema_of(METRICS))
    if result is not None:
        key = manifest["recording"], manifest["robot"]
        tables[JOINTS] = _joint_table(key, result)
        tables[TARGETS] = arrow.concat_tables([_target_table(key, arm) for arm in result.arms])
    return tables


def _joint_table(key: Key, result: PackedResult) -> "pyarrow.Table":
    """Return a row for each control step."""
    columns: dict[str, object] = {
        "time_s": result.time,
        "position": _lists(result.positions),
        "velocity": _lists(result.velocities.astype(np.float32)),
    }
    return _table(JOINTS, key, len(result.time), columns)


def _target_table(key: Key, arm: ArmSamples) -> "pyarrow.Table":
    """Return a row for each target of an arm."""
    count = len(arm.time)
    columns: dict[str, object] = {
        "arm": [arm.arm] * count,
        "time_s": arm.time,
        "ellipsoid": _lists(arm.targets.reshape(count, -1)),
    }
    if arm.path is not None:
        columns["position"] = _lists(arm.path)
    if arm.distance is not None:
        columns["distance"] = arm.distance
    return _table(TARGETS, key, count, columns)


def _table(name: str, key: Key, count: int, columns: Mapping[str, object]) -> "pyarrow.Table":
    """Return rows of one pair; columns that are not given are null."""
    arrow = arrow_of_batches()

    schema = schema_of(name)
    given = {"recording": [key[0]] * count, "robot": [key[1]] * count, **columns}
    arrays = []
    for field in schema:
        values = given.get(field.name, [None] * count)
        arrays.append(arrow.array(values, field.type))
    return arrow.Table.from_arrays(arrays, schema=schema)


def _lists(values: Array) -> "pyarrow.ListArray":
    """Return the rows of an array (n, k) as lists."""
    arrow = arrow_of_batches()

    count, size = values.shape
    offsets = np.arange(count + 1, dtype=np.int32) * size
    return arrow.ListArray.from_arrays(offsets, arrow.array(np.ravel(values)))


def read_rows(file: Path) -> list[Row]:
    """Read all rows of a table; `FileFormatError` where it is damaged."""
    parquet = parquet_of_batches()

    with _readable(file), parquet.ParquetFile(file) as stored:
        rows: list[Row] = stored.read().to_pylist()
    return rows


def require_table(file: Path) -> None:
    """Raise `FileFormatError` where a table is missing or cut off."""
    parquet = parquet_of_batches()

    with _readable(file):
        parquet.read_metadata(file)


def read_keys(file: Path) -> set[Key]:
    """Return the pairs of a table; `FileFormatError` where it is damaged."""
    parquet = parquet_of_batches()

    with _readable(file), parquet.ParquetFile(file) as stored:
        table = stored.read(["recording", "robot"])
    return set(zip(table["recording"].to_pylist(), table["robot"].to_pylist(), strict=True))


def pairs_in(
    file: Path, wanted: Container[Key] | None = None
) -> Iterator[tuple[Key, "pyarrow.Table"]]:
    """Yield the rows of each pair of a sorted table, or of those wanted; a pair is in one row group.

    The file is open only while a row group is read: a merge has many files.
    """
    parquet = parquet_of_batches()

    with _readable(file), parquet.ParquetFile(file) as stored:
        count = stored.num_row_groups
    for i in range(count):
        with _readable(file), parquet.ParquetFile(file) as stored:
            group = stored.read_row_group(i)
        keys = zip(group["recording"].to_pylist(), group["robot"].to_pylist(), strict=True)
        begin = 0
        for key, rows in itertools.groupby(keys):
            length = len(list(rows))
            if wanted is None or key in wanted:
                yield key, group.slice(begin, length)
            begin += length


@contextmanager
def _readable(file: Path) -> Iterator[None]:
    """Raise `FileFormatError` where a table is damaged."""
    arrow = arrow_of_batches()

    try:
        yield
    except (arrow.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0]
        raise FileFormatError(f"{file}: damaged, it cannot be read as Parquet: {reason}") from None


def write_table(
    file: Path, name: str, sources: Iterable[Iterator[tuple[Key, "pyarrow.Table"]]]
) -> None:
    """Write a table of sorted pairs from several sorted sources, whole or not at all.

    Row groups depend on the pairs alone, not on the sources. Of a pair in several sources the first counts.
    """
    arrow = arrow_of_batches()
    parquet = parquet_of_batches()

    schema = schema_of(name)
    with (
        written_whole(file) as temporary,
        parquet.ParquetWriter(
            temporary, schema, compression="zstd", **_encodings(schema)
        ) as writer,
    ):
        waiting: list[pyarrow.Table] = []
        count = 0
        last = None
        for key, table in heapq.merge(*sources, key=_key):
            if key == last:
                continue
            last = key
            waiting.append(table)
            count += len(table)
            if count >= GROUP_ROWS:
                writer.write_table(arrow.concat_tables(waiting).combine_chunks(), count)
                waiting = []
                count = 0
        if count:
            writer.write_table(arrow.concat_tables(waiting).combine_chunks(), count)


def _encodings(schema: "pyarrow.Schema") -> dict[str, list[str]]:
    """Return dictionaries for texts, and split bytes for numbers: with them joints take a third less space."""
    arrow = arrow_of_batches()
    texts = []
    numbers = []
    for field in schema:
        kind = field.type
        path = field.name
        if arrow.types.is_list(kind):
            kind = kind.value_type
            path += ".list.element"
        if arrow.types.is_floating(kind):
            numbers.append(path)
        if arrow.types.is_string(kind):
            texts.append(path)
    return {"use_dictionary": texts, "use_byte_stream_split": numbers}


def _key(pair: tuple[Key, "pyarrow.Table"]) -> Key:
    return pair[0]


def write_manifest(file: Path, rows: Mapping[Key, Row]) -> None:
    """Write the manifest of all pairs, sorted, whole or not at all."""
    arrow = arrow_of_batches()
    parquet = parquet_of_batches()

    in_order = [rows[key] for key in sorted(rows)]
    table = arrow.Table.from_pylist(in_order, schema_of(MANIFEST))
    with written_whole(file) as temporary:
        parquet.write_table(table, temporary, GROUP_ROWS, compression="zstd")
