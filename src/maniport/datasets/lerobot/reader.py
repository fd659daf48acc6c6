"""Reader of LeRobot datasets of the versions 3.0 and 2.1."""

import json
import os
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maniport.datasets.joint_motion import UNKNOWN, JointMotion
from maniport.datasets.lerobot.layout import (
    ABOUT,
    DATA,
    EPISODES,
    FRAME_COLUMNS,
    INFO,
    STATE,
    VERSIONS,
    Feature,
)
from maniport.datasets.lerobot.writer import Episode
from maniport.errors import FileFormatError, some_of, unknown_name
from maniport.util.input_limits import KEYPOINTS_BYTES, existing_file, read_whole
from maniport.util.optional import arrow_of_datasets, parquet_of_datasets
from maniport.util.validation import Array

if TYPE_CHECKING:
    import pyarrow

DATA_BYTES = 2**31  # largest file of data that is read
OLD_DATA = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
PLACE = re.compile(r"\{(\w+)(?::0?(\d+)d)?\}")  # of a number in the name of a file
TIME_TOLERANCE = 0.2  # of timestamps and frame numbers, as a share of a frame


class LeRobotDataset:
    """A LeRobot dataset in a folder, as far as motions of joints need it.

    Parameters
    ----------
    folder : str or path

    Attributes
    ----------
    folder : Path
    version, robot_type : str
    fps : float
        Frames a second [Hz].
    count : int
        Number of episodes that the dataset states.
    names : mapping of str to tuple of str
        Names of the components of each feature, in one list; empty where there are none.
    sizes : mapping of str to int
        Numbers of components.
    units : mapping of str to tuple of str
        Units of features, as datasets of maniport state them; empty for others.

    Raises
    ------
    FileFormatError
        When the folder is no such dataset, or of another version.
    """

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = Path(folder)
        self._parquet = parquet_of_datasets()
        self._arrow = arrow_of_datasets()
        info = _read_json(self.folder / INFO)
        self.version = str(info.get("codebase_version"))
        if self.version not in VERSIONS:
            raise FileFormatError(
                f"{self.folder / INFO}: codebase_version must be {' or '.join(VERSIONS)}; found "
                f"{self.version!r}. LeRobot converts older ones"
            )
        self.robot_type = str(info.get("robot_type") or "")
        self.fps = self._number(info, "fps")
        self.count = int(self._number(info, "total_episodes"))
        self._chunk_size = int(self._number({"chunks_size": 1000, **info}, "chunks_size"))
        features = info.get("features")
        if not isinstance(features, dict):
            raise FileFormatError(f"{self.folder / INFO}: lacks features")
        self.sizes = {}
        self.names = {}
        for key, feature in features.items():
            shape = feature.get("shape") if isinstance(feature, dict) else None
            if isinstance(shape, list) and len(shape) == 1 and isinstance(shape[0], int):
                self.sizes[str(key)] = shape[0]
                self.names[str(key)] = _flat_names(feature.get("names"), shape[0])
        default = DATA if self.version == VERSIONS[0] else OLD_DATA
        self._data = str(info.get("data_path") or default)
        self.units = self._stated_units()

    def parts(self, feature: str = STATE) -> tuple[str, ...]:
        """Return the keys that a feature consists of: itself, or those that begin with it, in their order.

        `UnknownNameError` where there is none.
        """
        if feature in self.sizes:
            return (feature,)
        found = tuple(key for key in self.sizes if key.startswith(f"{feature}."))
        if not found:
            raise unknown_name("feature", feature, self.sizes, f"in {str(self.folder)!r}")
        return found

    def columns(self, feature: str = STATE) -> tuple[str, ...]:
        """Return the names of the components of a feature; empty where some have none.

        Names of several parts, such as ``observation.state.left_arm``, get the part as prefix where
        they would repeat.
        """
        parts = self.parts(feature)
        names: list[str] = []
        prefixed: list[str] = []
        for key in parts:
            names += self.names[key]
            part = key.removeprefix(f"{feature}.")
            prefixed += [f"{part}.{name}" for name in self.names[key]]
        if len(names) != sum(self.sizes[key] for key in parts):
            return ()
        if len(set(names)) < len(names):
            names = prefixed
        return tuple(names)

    def motions(
        self, feature: str = STATE, episodes: Collection[int] | None = None
    ) -> Iterator[tuple[int, JointMotion]]:
        """Yield the number and the motion of each episode, in their order.

        Parameters
        ----------
        feature : str
            Feature with the joint positions.
        episodes : collection of int, optional
            Numbers of episodes. Default: all.

        Raises
        ------
        FileFormatError
            When a file is damaged, a column is missing or has another size, a number is not finite,
            timestamps do not have the rate of the dataset, or an episode is missing.
        """
        parts = self.parts(feature)
        columns = self.columns(feature)
        units: list[str] = []
        for key in parts:
            units += self.units.get(key, (UNKNOWN,) * self.sizes[key])
        seen = set[int]()
        for path in self.data_files(episodes):
            for number, motion in self._episodes_of(path, parts, columns):
                if episodes is not None and number not in episodes:
                    continue
                if number in seen:
                    raise FileFormatError(f"{path}: episode {number} is in two places")
                seen.add(number)
                yield number, JointMotion(**{**vars(motion), "units": tuple(units)})
        wanted = set(range(self.count)) if episodes is None else set(episodes)
        missing = sorted(wanted - seen)
        if missing:
            listed = some_of(map(str, missing))
            raise FileFormatError(
                f"{self.folder}: the data lack {len(missing)} of {len(wanted)} episodes: {listed}"
            )

    def _number(self, info: Mapping[str, object], key: str) -> float:
        value = info.get(key)
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not 0.0 < float(str(value)) < np.inf:
            raise FileFormatError(
                f"{self.folder / INFO}: {key} must be a number above 0; found {value!r:.60}"
            )
        return float(str(value))

    def _stated_units(self) -> dict[str, tuple[str, ...]]:
        """Return the units that maniport wrote beside the dataset."""
        if not (self.folder / ABOUT).is_file():
            return {}
        units = _read_json(self.folder / ABOUT).get("units")
        found = {}
        for key, texts in units.items() if isinstance(units, dict) else ():
            if isinstance(texts, list) and len(texts) == self.sizes.get(str(key)):
                found[str(key)] = tuple(map(str, texts))
        return found

    def data_files(self, episodes: Collection[int] | None = None) -> Iterator[Path]:
        """Yield the files of data that hold some episodes, in their order."""
        if self.version != VERSIONS[0]:
            for number in sorted(episodes) if episodes is not None else range(self.count):
                numbers = {
                    "episode_chunk": number // self._chunk_size,
                    "episode_index": number,
                }
                yield self._path(numbers)
            return
        folder = self.folder / "data"
        files = sorted(folder.glob("chunk-*/file-*.parquet"))
        if not files:
            raise FileFormatError(f"{folder}: holds no files chunk-000/file-000.parquet")
        yield from files

    def _path(self, numbers: Mapping[str, int]) -> Path:
        """Return a file of data, which must be in the folder, by the template of its name."""

        def number(match: re.Match[str]) -> str:
            if match[1] not in numbers:
                raise FileFormatError(
                    f"{self.folder / INFO}: data_path has the unknown place {match[1]!r:.60}"
                )
            return f"{numbers[match[1]]:0{int(match[2] or 1)}d}"

        path = self.folder / PLACE.sub(number, self._data)
        if not path.resolve().is_relative_to(self.folder.resolve()):
            raise FileFormatError(f"{self.folder / INFO}: data_path leads out of the dataset")
        return path

    def _episodes_of(
        self, path: Path, parts: tuple[str, ...], columns: tuple[str, ...]
    ) -> Iterator[tuple[int, JointMotion]]:
        """Yield the episodes of a file of data."""
        file = existing_file(path, (".parquet",), DATA_BYTES)
        try:
            with self._parquet.ParquetFile(file) as opened:
                known = set(opened.schema_arrow.names)
                wanted = [*parts, "timestamp", "frame_index", "episode_index"]
                missing = [name for name in wanted if name not in known]
                if missing:
                    raise FileFormatError(
                        f"{path}: lacks the columns {', '.join(missing)}; found {some_of(known)}"
                    )
                table = opened.read(columns=wanted)
        except (self._arrow.ArrowException, OSError, ValueError) as error:
            if isinstance(error, FileFormatError):
                raise
            raise FileFormatError(f"{path}: cannot be read as Parquet: {error!s:.200}") from None

        values = [_vectors(table, key, self.sizes[key], path) for key in parts]
        positions = np.concatenate(values, axis=1)
        numbers = _scalars(table, "episode_index", path)
        frames = _scalars(table, "frame_index", path)
        stamps = _scalars(table, "timestamp", path)
        starts = np.flatnonzero(np.diff(numbers, prepend=numbers[:1] - 1))
        ends = np.append(starts[1:], len(numbers))
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            number = int(numbers[start])
            source = f"{path}, episode {number}"
            time = self._times(source, stamps[start:end], frames[start:end])
            motion = JointMotion.checked(
                source, positions[start:end], time, columns, name=f"episode {number}"
            )
            yield number, motion

    def _times(self, source: str, stamps: Array, frames: Array) -> Array:
        """Return times [s] of frames, whose timestamps must be at the rate of the dataset."""
        time = np.asarray(frames / self.fps, dtype=np.float64)
        late = np.abs(stamps - stamps[0] - (time - time[0])) * self.fps
        if not np.all(late <= TIME_TOLERANCE):
            row = int(np.argmax(~(late <= TIME_TOLERANCE)))
            raise FileFormatError(
                f"{source}: timestamps must be at {self.fps:g} Hz, the rate of the dataset; found "
                f"{stamps[row]:.6g} s in frame {frames[row]:.0f}"
            )
        return time


def _read_json(path: Path) -> dict[str, object]:
    try:
        content = json.loads(read_whole(path, (), KEYPOINTS_BYTES))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: is not readable JSON: {error}") from None
    if not isinstance(content, dict):
        raise FileFormatError(f"{path}: must hold a mapping; found {type(content).__name__}")
    return content


def _flat_names(names: object, size: int) -> tuple[str, ...]:
    """Return the names of components, which files have as a list, nested lists or a mapping of them."""
    found: list[str] = []
    waiting = [names]
    while waiting:
        item = waiting.pop(0)
        if isinstance(item, str):
            found.append(item)
        elif isinstance(item, list):
            waiting = [*item, *waiting]
        elif isinstance(item, dict):
            values = list(item.values())
            if all(isinstance(value, int) for value in values):  # names with their places
                ordered = sorted(item, key=lambda name: int(item[name]))
                waiting = [*ordered, *waiting]
            else:
                waiting = [*values, *waiting]
    return tuple(found) if len(found) == size else ()


def _vectors(table: "pyarrow.Table", key: str, size: int, path: Path) -> Array:
    """Return a column of vectors (n, size)."""
    column = table[key].combine_chunks()
    kind = str(column.type)
    if "list" in kind:
        flat = column.flatten() if column.null_count == 0 else None
        if flat is None or len(flat) != size * len(column):
            raise FileFormatError(f"{path}: {key} must have {size} numbers in each frame")
        lengths = column.value_lengths() if "fixed" not in kind else None
        if lengths is not None and not np.all(lengths.to_numpy(zero_copy_only=False) == size):
            raise FileFormatError(f"{path}: {key} must have {size} numbers in each frame")
        column = flat
    elif size != 1:
        raise FileFormatError(f"{path}: {key} must be lists of {size} numbers; found {kind}")
    return _numbers(column, key, path).reshape(-1, size)


def _scalars(table: "pyarrow.Table", key: str, path: Path) -> Array:
    column = table[key].combine_chunks()
    if "list" in str(column.type):
        column = column.flatten()
    values = _numbers(column, key, path)
    if len(values) != table.num_rows or not len(values):
        raise FileFormatError(
            f"{path}: {key} must have one number in each frame, and there must be frames"
        )
    return values


def _numbers(column: "pyarrow.Array", key: str, path: Path) -> Array:
    values = column.to_numpy(zero_copy_only=False)
    if values.dtype.kind not in "fiu":
        raise FileFormatError(f"{path}: {key} must be numbers; found {column.type}")
    return np.asarray(values, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Content:
    """All episodes of a dataset that maniport wrote, with its features."""

    features: tuple[Feature, ...]
    fps: int
    robot_type: str
    episodes: tuple[Episode, ...]


def read_episodes(folder: Path) -> Content:
    """Read a small dataset of maniport with all its columns."""
    dataset = LeRobotDataset(folder)
    about = _read_json(folder / ABOUT).get("episodes")
    described = about if isinstance(about, list) else []
    parquet = parquet_of_datasets()
    features = []
    for key, names in dataset.names.items():
        if key not in FRAME_COLUMNS:
            features.append(Feature(key, names, dataset.units.get(key, ())))
    rows = parquet.read_table(folder / EPISODES.format(chunk_index=0, file_index=0)).to_pylist()
    tables = [parquet.read_table(path) for path in dataset.data_files()]
    values: dict[str, Array] = {}
    for feature in features:
        parts = [_vectors(table, feature.key, feature.size, folder) for table in tables]
        values[feature.key] = np.concatenate(parts)
    episodes = []
    for row, entry in zip(rows, described, strict=True):
        own = slice(row["dataset_from_index"], row["dataset_to_index"])
        more = {key: value for key, value in entry.items() if key not in ("episode_index", "name")}
        columns = {key: array[own] for key, array in values.items()}
        episodes.append(Episode(str(entry.get("name")), row["tasks"][0], columns, more))
    return Content(tuple(features), int(dataset.fps), dataset.robot_type, tuple(episodes))
