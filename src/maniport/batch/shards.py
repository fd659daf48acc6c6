"""Lists of recordings, and the part of them that one of several jobs processes."""

import os
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from maniport.batch.inputs import Clip, Source, resolved
from maniport.errors import (
    FileFormatError,
    InvalidInputError,
    ManiportWarning,
    argument,
    counted,
    shown,
    some_of,
)
from maniport.util.defaults import SHIPPED
from maniport.util.input_limits import read_whole

LIST_BYTES = 1 << 28
"""Largest list [B]: a million paths of 256 characters."""
MOST_SHARDS = 100_000
SLURM = "SLURM_ARRAY_TASK_"
"""Start of the environment variables of a Slurm array."""


def read_list(path: str | os.PathLike[str]) -> list[Clip]:
    """Read a list of recordings.

    Parameters
    ----------
    path : str or path
        A text file with a recording in each line: a path, relative to the working folder, or a bundled name. A tab and
        the name of the person may follow. Empty lines are skipped.

    Returns
    -------
    list of Clip
        Each recording once.

    Raises
    ------
    FileFormatError
        When the file cannot be read, is no text, or names no recording.
    InvalidInputError
        When a recording does not exist, or is listed with two persons.
    """
    file = Path(path)
    try:
        text = read_whole(file, (), LIST_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FileFormatError(f"{file}: a list must be UTF-8 text; found other bytes") from None

    clips = dict[Path, Clip]()
    folders = dict[Path, Path]()
    missing = []
    repeated = 0
    for number, line in enumerate(text.split("\n"), start=1):
        name, _, person = line.strip().partition("\t")
        clip = Clip(name.strip(), person.strip())
        if not clip.path:
            continue
        if clip.path not in SHIPPED and not os.path.exists(clip.path):
            missing.append(f"line {number} {clip.path!r}")
            continue
        place = resolved(Path(clip.path), folders)
        earlier = clips.setdefault(place, clip)
        if earlier.person != clip.person:
            raise InvalidInputError(
                f"{file}, line {number}: {clip.path!r} has the person {clip.person!r}, but {earlier.person!r} in a "
                "line before; name one of them"
            )
        repeated += earlier is not clip
    if missing:
        raise InvalidInputError(
            f"{file}: {counted(len(missing), 'recording')} of the list not found from the working folder "
            f"{os.getcwd()!r}: {some_of(missing)}"
        )
    if not clips:
        raise FileFormatError(f"{file}: the list names no recording; write a path in each line")
    if repeated:
        text = f"{file}: {counted(repeated, 'line')} of the list repeated a recording; each is processed once"
        warnings.warn(text, ManiportWarning, stacklevel=2)
    return list(clips.values())


@dataclass(frozen=True)
class Shard:
    """One of several parts of a batch; parts are counted from 1."""

    index: int = 1
    count: int = 1

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"

    @classmethod
    def parse(cls, text: str) -> "Shard":
        """Read "i/n" with 1 <= i <= n; raises `InvalidInputError`."""
        found = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text.strip(), re.ASCII)
        if found is not None:
            shard = cls(int(found[1]), int(found[2]))
            if 1 <= shard.index <= shard.count <= MOST_SHARDS:
                return shard
        raise InvalidInputError(
            f"{argument('shard')} must be i/n with whole numbers 1 <= i <= n <= {MOST_SHARDS}, such as 3/100; "
            f"found {shown(text)}"
        )

    @classmethod
    def of_slurm(cls, environment: Mapping[str, str]) -> "Shard":
        """Return the part of this task of a Slurm array; all, where this is none.

        The first task of an array has the number ``SLURM_ARRAY_TASK_MIN``, 1 where that is not set.
        """
        if f"{SLURM}ID" not in environment or f"{SLURM}COUNT" not in environment:
            return cls()
        values = {"MIN": "1", **_of_array(environment)}
        try:
            task = int(values["ID"])
            count = int(values["COUNT"])
            first = int(values["MIN"])
            last = int(values.get("MAX", first + count - 1))
        except ValueError:
            raise InvalidInputError(
                f"{SLURM}… must be whole numbers; found {values}; give {argument('shard')}"
            ) from None
        if last - first + 1 != count or not first <= task <= last:
            raise InvalidInputError(
                f"task {task} of a Slurm array of {count} tasks from {first} to {last} is no part of a batch: number "
                f"the tasks from 1 to n without gaps, such as --array=1-100, or give {argument('shard')}"
            )
        return cls.parse(f"{task - first + 1}/{count}")

    def select(self, sources: Sequence[Source]) -> list[Source]:
        """Return the sources of this part; those of one person are in one part, and follow one another.

        Persons are sorted, and the part of each is where the middle of its recordings is in the list of all. The person
        of a recording is the one that the list names, or else its folder. Where all recordings are in one folder and no
        person is named, each counts by itself.
        """
        persons = dict[str, list[Source]]()
        for source in sources:
            person = source.person or str(source.path.parent)
            persons.setdefault(person, []).append(source)
        groups = [persons[name] for name in sorted(persons)]
        if len(groups) == 1 and not sources[0].person:
            groups = [[source] for source in groups[0]]

        chosen = []
        begin = 0
        for group in groups:
            middle = 2 * begin + len(group)
            if middle * self.count // (2 * len(sources)) == self.index - 1:
                chosen += group
            begin += len(group)
        return chosen


def _of_array(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables of a Slurm array by the end of their name."""
    values = {}
    for name, value in environment.items():
        if name.startswith(SLURM):
            values[name.removeprefix(SLURM)] = value
    return values
