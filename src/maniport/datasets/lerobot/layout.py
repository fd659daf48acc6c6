"""Names of files and columns of LeRobot datasets."""

from dataclasses import dataclass

VERSION = "v3.0"
VERSIONS = ("v3.0", "v2.1", "v2.0")  # that are read
INFO = "meta/info.json"
STATS = "meta/stats.json"
TASKS = "meta/tasks.parquet"
EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
ABOUT = "meta/about.json"  # units and results, which the format has no place for
OWN_FILES = frozenset(
    {"info.json", "stats.json", "tasks.parquet", "about.json"}
    | {f"file-{number:03d}.parquet" for number in range(1000)}
)
"""Names of the files of a dataset of maniport."""

FILES_PER_CHUNK = 1000
DATA_MEGABYTES = 100  # of a file of data, after which the next one begins
VIDEO_MEGABYTES = 200  # stated in every dataset

STATE = "observation.state"
ACTION = "action"
ENVIRONMENT = "observation.environment_state"
FRAME_COLUMNS = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""Columns of every dataset with their types."""


@dataclass(frozen=True)
class Feature:
    """A column of vectors.

    Attributes
    ----------
    key : str
        Policies take keys that begin with ``observation.`` as inputs, and ``action`` as output.
    names : tuple of str
        Names of the components.
    units : tuple of str
        Their units; empty where there is none.
    """

    key: str
    names: tuple[str, ...]
    units: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of components."""
        return len(self.names)
