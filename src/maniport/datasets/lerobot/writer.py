"""Writer of LeRobot datasets of version 3.0, without images.

Layout: https://huggingface.co/docs/lerobot/lerobot-dataset-v3
"""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from maniport.datasets.lerobot.layout import (
    ABOUT,
    DATA,
    DATA_MEGABYTES,
    EPISODES,
    FILES_PER_CHUNK,
    FRAME_COLUMNS,
    INFO,
    OWN_FILES,
    STATS,
    TASKS,
    VERSION,
    VIDEO_MEGABYTES,
    Feature,
)
from maniport.errors import InvalidInputError
from maniport.util.atomic_io import folder_written_whole
from maniport.util.input_limits import MEGABYTE
from maniport.util.optional import arrow_of_datasets, parquet_of_datasets
from maniport.util.parts import WrittenInParts
from maniport.util.validation import Array, as_count
from maniport.version import __version__

if TYPE_CHECKING:
    import pyarrow
    import pyarrow.parquet

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
Statistics = dict[str, Array]
"""Statistics of a column by name, each of shape (k,), ``count`` of shape (1,)."""


@dataclass(frozen=True, eq=False)
class Episode:
    """One motion of a dataset.

    Attributes
    ----------
    name : str
        For `about`, such as that of the recording.
    task : str
        Sentence that policies get.
    values : mapping of str to ndarray, shape (n, k)
        By the keys of the features.
    about : mapping of str to object
        Entries of the episode in ``meta/about.json``.
    """

    name: str
    task: str
    values: Mapping[str, Array]
    about: Mapping[str, object] = field(default_factory=dict)


class LeRobotWriter(WrittenInParts):
    """Writes episodes to an existing empty folder, one after the other; a context manager.

    Parameters
    ----------
    folder : Path
    features : sequence of Feature
    fps : int
        Frames a second of all episodes [Hz].
    robot_type : str
    """

    def __init__(self, folder: Path, features: Sequence[Feature], fps: int, robot_type: str):
        self.folder = folder
        self.features = tuple(features)
        self.fps = as_count(fps, "fps")
        self.robot_type = robot_type
        self.left_out: list[dict[str, str]] = []
        self._arrow = arrow_of_datasets()
        self._parquet = parquet_of_datasets()
        self._tasks: dict[str, int] = {}
        self._rows: list[dict[str, object]] = []
        self._episodes: list[dict[str, object]] = []
        self._statistics: list[dict[str, Statistics]] = []
        self._frames = 0
        self._file = -1
        self._writer: pyarrow.parquet.ParquetWriter | None = None
        self._schema = self._data_schema()

    def add(self, episode: Episode) -> None:
        """Append an episode; `InvalidInputError` where values are missing, of another shape or not finite."""
        values = self._checked(episode)
        count = len(next(iter(values.values())))
        index = len(self._rows)
        task = self._tasks.setdefault(episode.task, len(self._tasks))
        columns: dict[str, NDArray[np.generic]] = {
            "timestamp": (np.arange(count) / self.fps).astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, index),
            "index": np.arange(self._frames, self._frames + count),
            "task_index": np.full(count, task),
        }
        self._write_data(values, columns)

        statistics = {}
        for name, column in columns.items():
            statistics[name] = _statistics(column.reshape(-1, 1))
        for key, vectors in values.items():
            statistics[key] = _statistics(vectors)
        row: dict[str, object] = {
            "episode_index": index,
            "tasks": [episode.task],
            "length": count,
            "data/chunk_index": self._file // FILES_PER_CHUNK,
            "data/file_index": self._file % FILES_PER_CHUNK,
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + count,
        }
        for key, numbers in statistics.items():
            for name, value in numbers.items():
                row[f"stats/{key}/{name}"] = value.tolist()
        row["meta/episodes/chunk_index"] = 0
        row["meta/episodes/file_index"] = 0
        self._rows.append(row)
        self._statistics.append(statistics)
        self._episodes.append({"episode_index": index, "name": episode.name, **episode.about})
        self._frames += count

    def leave_out(self, name: str, reason: str) -> None:
        """List a motion that is not in the dataset."""
        self.left_out.append({"name": name, "reason": reason})

    def finish(self) -> None:
        """Write the files of the folder ``meta``; `InvalidInputError` without any episode."""
        self.close()
        if not self._rows:
            raise InvalidInputError("a LeRobot dataset must have at least one episode; found none")
        self._write_episodes()
        self._write_tasks()
        self._write_json(STATS, self._all_statistics())
        self._write_json(INFO, self._info())
        units = {}
        for feature in self.features:
            units[feature.key] = list(feature.units)
        about = {
            "maniport": __version__,
            "units": units,
            "episodes": self._episodes,
            "left_out": self.left_out,
        }
        self._write_json(ABOUT, about)

    def close(self) -> None:
        """Close the file of data."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def _checked(self, episode: Episode) -> dict[str, NDArray[np.float32]]:
        """Return the values of all features as float32, all with the same number of frames."""
        values = {}
        count = None
        for feature in self.features:
            if feature.key not in episode.values:
                raise InvalidInputError(f"episode {episode.name!r} lacks {feature.key!r}")
            array = np.asarray(episode.values[feature.key], dtype=np.float32)
            expected = (len(array) if count is None else count, feature.size)
            if array.shape != expected or not len(array):
                raise InvalidInputError(
                    f"episode {episode.name!r}: {feature.key!r} must have shape {expected}; found "
                    f"{array.shape}"
                )
            if not np.all(np.isfinite(array)):
                raise InvalidInputError(
                    f"episode {episode.name!r}: {feature.key!r} must be finite; found nan or infinity"
                )
            count = len(array)
            values[feature.key] = array
        return values

    def _data_schema(self) -> "pyarrow.Schema":
        arrow = self._arrow
        fields = []
        for feature in self.features:
            kind = arrow.float32()
            if feature.size > 1:  # vectors of one component are numbers
                kind = arrow.list_(arrow.float32(), feature.size)
            fields.append(arrow.field(feature.key, kind))
        for name, kind in FRAME_COLUMNS.items():
            fields.append(arrow.field(name, getattr(arrow, kind)()))
        return arrow.schema(fields)

    def _write_data(
        self, values: Mapping[str, NDArray[np.float32]], columns: Mapping[str, NDArray[np.generic]]
    ) -> None:
        """Append the frames of an episode to the file of data, or begin another one."""
        arrow = self._arrow
        arrays = []
        for feature in self.features:
            flat = arrow.array(values[feature.key].reshape(-1), arrow.float32())
            if feature.size > 1:
                flat = arrow.FixedSizeListArray.from_arrays(flat, feature.size)
            arrays.append(flat)
        for name, kind in FRAME_COLUMNS.items():
            arrays.append(arrow.array(columns[name], getattr(arrow, kind)()))
        table = arrow.Table.from_arrays(arrays, schema=self._schema)

        path = self._data_path()
        if self._writer is not None and path.stat().st_size > DATA_MEGABYTES * MEGABYTE:
            self.close()
        if self._writer is None:
            self._file += 1
            path = self._data_path()
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = self._parquet.ParquetWriter(path, self._schema, compression="snappy")
        self._writer.write_table(table)

    def _data_path(self) -> Path:
        chunk = self._file // FILES_PER_CHUNK
        file = self._file % FILES_PER_CHUNK
        return self.folder / DATA.format(chunk_index=chunk, file_index=file)

    def _write_episodes(self) -> None:
        path = self.folder / EPISODES.format(chunk_index=0, file_index=0)
        path.parent.mkdir(parents=True, exist_ok=True)
        columns = {}
        for name in self._rows[0]:
            columns[name] = [row[name] for row in self._rows]
        self._parquet.write_table(self._arrow.table(columns), path, compression="snappy")

    def _write_tasks(self) -> None:
        """Write the tasks, in a table whose index of pandas has the texts."""
        arrow = self._arrow
        table = arrow.table(
            {"task_index": list(self._tasks.values()), "task": list(self._tasks)},
            schema=arrow.schema([("task_index", arrow.int64()), ("task", arrow.string())]),
        )
        texts = {
            "name": "task",
            "field_name": "task",
            "pandas_type": "unicode",
            "numpy_type": "object",
        }
        numbers = {
            "name": "task_index",
            "field_name": "task_index",
            "pandas_type": "int64",
            "numpy_type": "int64",
        }
        described = {
            "index_columns": ["task"],
            "column_indexes": [],
            "columns": [{**numbers, "metadata": None}, {**texts, "metadata": None}],
            "creator": {"library": "pyarrow", "version": arrow.__version__},
            "pandas_version": "2.0.0",
        }
        table = table.replace_schema_metadata({"pandas": json.dumps(described)})
        self._parquet.write_table(table, self.folder / TASKS)

    def _info(self) -> dict[str, object]:
        features: dict[str, object] = {}
        for feature in self.features:
            features[feature.key] = {
                "dtype": "float32",
                "shape": [feature.size],
                "names": list(feature.names),
            }
        for name, kind in FRAME_COLUMNS.items():
            features[name] = {"dtype": kind, "shape": [1], "names": None}
        return {
            "codebase_version": VERSION,
            "robot_type": self.robot_type,
            "total_episodes": len(self._rows),
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": DATA_MEGABYTES,
            "video_files_size_in_mb": VIDEO_MEGABYTES,
            "fps": self.fps,
            "splits": {"train": f"0:{len(self._rows)}"},
            "data_path": DATA,
            "video_path": None,
            "features": features,
        }

    def _all_statistics(self) -> dict[str, dict[str, list[float]]]:
        """Combine the statistics of the episodes; quantiles are weighted means, as LeRobot has them."""
        combined: dict[str, dict[str, list[float]]] = {}
        for key in self._statistics[0]:
            parts = [statistics[key] for statistics in self._statistics]
            counts = np.array([part["count"][0] for part in parts])
            weights = (counts / counts.sum())[:, None]
            means = np.array([part["mean"] for part in parts])
            mean = np.sum(weights * means, axis=0)
            squares = np.array([part["std"] for part in parts]) ** 2 + (means - mean) ** 2
            numbers = {
                "min": np.min([part["min"] for part in parts], axis=0),
                "max": np.max([part["max"] for part in parts], axis=0),
                "mean": mean,
                "std": np.sqrt(np.sum(weights * squares, axis=0)),
                "count": np.array([counts.sum()]),
            }
            for name in QUANTILES:
                numbers[name] = np.sum(weights * [part[name] for part in parts], axis=0)
            combined[key] = {name: value.tolist() for name, value in numbers.items()}
        return combined

    def _write_json(self, name: str, content: object) -> None:
        text = json.dumps(content, indent=4, ensure_ascii=False, allow_nan=False)
        (self.folder / name).write_text(text + "\n", encoding="utf-8")


def write_lerobot(
    folder: str | os.PathLike[str],
    episodes: Iterable[Episode],
    features: Sequence[Feature],
    fps: int,
    robot_type: str,
    overwrite: bool = False,
) -> None:
    """Write a dataset to a folder, whole or not at all.

    Parameters
    ----------
    folder : str or path
    episodes : iterable of Episode
        At least one.
    features, fps, robot_type
        As for `LeRobotWriter`.
    overwrite : bool
        Whether an earlier dataset in the folder is replaced.

    Raises
    ------
    InvalidInputError
        When an episode does not fit the features, or there is none.
    MissingPackageError, OutputError
        When pyarrow is missing, or the folder cannot be written.
    """
    arrow_of_datasets()
    with (
        folder_written_whole(folder, OWN_FILES, overwrite) as staging,
        LeRobotWriter(staging, features, fps, robot_type) as writer,
    ):
        for episode in episodes:
            writer.add(episode)


def _statistics(column: NDArray[np.generic]) -> Statistics:
    """Statistics of values (n, k)."""
    values = np.asarray(column, dtype=np.float64)
    numbers = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        "count": np.array([len(values)]),
    }
    levels = np.quantile(values, list(QUANTILES.values()), axis=0)
    for name, level in zip(QUANTILES, levels, strict=True):
        numbers[name] = level
    return numbers
