"""Datasets of any of the formats as a sequence of motions."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from maniport.datasets.gmr_pickle import read_gmr_pickle
from maniport.datasets.joint_files import TIME, read_joints_csv, read_joints_npz
from maniport.datasets.joint_motion import JointMotion
from maniport.datasets.lerobot import STATE, LeRobotDataset
from maniport.datasets.lerobot.layout import INFO
from maniport.datasets.mjlab_npz import read_mjlab_npz
from maniport.datasets.ros_bag import read_ros_bag
from maniport.datasets.unitree_csv import G1_JOINTS, RATE, ROOT, read_unitree_csv
from maniport.errors import FileFormatError, InvalidInputError
from maniport.util.files import array_names
from maniport.util.input_limits import as_path, existing_file

SUFFIXES = (".csv", ".npz", ".pkl", ".pickle", ".mcap")


@dataclass(frozen=True)
class ReadOptions:
    """What a caller states of a dataset.

    Attributes
    ----------
    feature : str or None
        Feature of a LeRobot dataset, by default ``observation.state``, or topic of a ROS bag.
    joint_names : tuple of str
        Names of the columns where the file has none, in their order.
    robot : str or None
        Robot that identifies the order of joints of BeyondMimic and mjlab.
    rate : float or None
        Frames a second of Unitree's CSV [Hz].
    """

    feature: str | None = None
    joint_names: tuple[str, ...] = ()
    robot: str | None = None
    rate: float | None = None


@dataclass(frozen=True, eq=False)
class Source:
    """A dataset that was opened.

    Attributes
    ----------
    name : str
        Its path.
    kind : str
        Format, for reports.
    count : int
        Number of motions.
    motions : callable
        Returns an iterator over the number and the motion of each episode.
    """

    name: str
    kind: str
    count: int
    motions: Callable[[], Iterator[tuple[int, JointMotion]]]


def open_dataset(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> Source:
    """Open a dataset, whose format is recognized by its content.

    Parameters
    ----------
    path : str or path
        Folder of a LeRobot dataset or of a result of maniport, a file of a motion, or a folder of
        such files.
    options : ReadOptions

    Raises
    ------
    FileFormatError
        When the format is not known.
    """
    place = as_path(path, "dataset")
    if (place / INFO).is_file():
        dataset = LeRobotDataset(place)
        feature = options.feature or STATE
        kind = f"LeRobot {dataset.version}"
        dataset.parts(feature)  # raises where there is none
        return Source(str(place), kind, dataset.count, partial(dataset.motions, feature))
    if place.is_dir():
        files = _files_in(place)
    else:
        files = [existing_file(place, SUFFIXES, 2**40)]
    readers = [_reader(file, options) for file in files]
    kinds = list(dict.fromkeys(kind for kind, _ in readers))

    def motions() -> Iterator[tuple[int, JointMotion]]:
        for number, (_, read) in enumerate(readers):
            yield number, read()

    return Source(str(place), ", ".join(kinds), len(files), motions)


def _files_in(folder: Path) -> list[Path]:
    """Return the files of a folder with motions; of a result of maniport its joints alone."""
    joints = folder / "joints.npz"
    if joints.is_file():
        return [joints]
    files = sorted(file for file in folder.rglob("*") if file.suffix.lower() in SUFFIXES)
    results = [file for file in files if file.name == "joints.npz"]  # of a batch
    if results:
        return results
    if not files:
        raise FileFormatError(
            f"{folder}: holds neither {INFO} of a LeRobot dataset nor files ending in "
            f"{', '.join(SUFFIXES)}"
        )
    return files


def _reader(file: Path, options: ReadOptions) -> tuple[str, Callable[[], JointMotion]]:
    """Return the format of a file, and a function that reads it."""
    suffix = file.suffix.lower()
    if suffix == ".mcap":
        return "ROS 2 bag", partial(read_ros_bag, file, options.feature)
    if suffix in (".pkl", ".pickle"):
        return "GMR", partial(read_gmr_pickle, file, options.joint_names)
    if suffix == ".npz":
        names = array_names(file, "dataset")
        if "control_positions" in names:
            return "joints of maniport", partial(read_joints_npz, file)
        if "joint_pos" in names:
            return "mjlab", partial(read_mjlab_npz, file, options.joint_names, options.robot)
        raise FileFormatError(
            f"{file}: has neither control_positions of maniport nor joint_pos of mjlab"
        )
    with open(file, encoding="utf-8", errors="replace") as stream:
        head = stream.readline(4096)
    if TIME in head:
        return "joints of maniport", partial(read_joints_csv, file)
    joints: Sequence[str] = options.joint_names or _joints_of(head.count(",") + 1, file)
    rate = RATE if options.rate is None else options.rate
    return "Unitree CSV", partial(read_unitree_csv, file, joints, rate)


def _joints_of(columns: int, file: Path) -> Sequence[str]:
    """Return the joints of a CSV by its number of columns; `InvalidInputError` for one that is not known."""
    if columns - ROOT in (len(G1_JOINTS), len(G1_JOINTS) + 1):
        return G1_JOINTS
    raise InvalidInputError(
        f"{file}: {columns} columns are not those of a Unitree G1 ({ROOT + len(G1_JOINTS)}): name the "
        "joints in the order of the columns"
    )
