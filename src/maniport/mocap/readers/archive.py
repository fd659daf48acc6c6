"""ZIP archives with one recording, or with the frames of one in JSON, as data sets are delivered."""

import re
import zipfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from maniport.errors import FileFormatError, InvalidInputError
from maniport.mocap.readers import READERS, ImportOptions, read_with
from maniport.mocap.recording import Recording
from maniport.util.input_limits import (
    KEYPOINTS_BYTES,
    MEGABYTE,
    RECORDING_BYTES,
    existing_file,
    require_at_most,
)

MEMBERS = 100_000  # Most files in an archive
LISTED = 8  # Names of files in a message
BLOCK = 2**20  # Bytes that are unpacked at once


def read(file: Path, options: ImportOptions) -> Recording:
    """Read the one recording in a ZIP archive; see `maniport.mocap.readers.read_recording`."""
    existing_file(file, (), RECORDING_BYTES)
    try:
        with zipfile.ZipFile(file) as archive, TemporaryDirectory() as folder:
            frames = _frames(archive.infolist())
            if frames:
                for i, frame in enumerate(frames):
                    file_name = PurePosixPath(frame.filename).name
                    _unpack(archive, frame, Path(folder) / f"{i:08}-{file_name}")
                name = PurePosixPath(frames[0].filename).parent.name or file.stem
                return _read_unpacked(Path(folder), name, options)
            member = _only_recording(archive.infolist())
            name = PurePosixPath(member.filename).name
            unpacked = Path(folder) / f"recording{PurePosixPath(name).suffix.lower()}"
            _unpack(archive, member, unpacked)
            return _read_unpacked(unpacked, name, options)
    except (FileFormatError, InvalidInputError):
        raise
    except ValueError as error:
        raise ValueError(str(error)) from None
    except Exception as error:  # noqa: BLE001 - decompressors raise errors of a dozen types on damaged files
        raise ValueError(f"not a readable ZIP archive: {error}") from None


def _frames(members: list[zipfile.ZipInfo]) -> list[zipfile.ZipInfo]:
    """Return the JSON files of single frames in order, whose names differ in numbers only; empty where it is else."""
    require_at_most(len(members), MEMBERS, "files in the archive")
    recordings = [member for member in _files(members) if _ending(member) in READERS]
    patterns = set()
    size = 0
    for member in recordings:
        patterns.add(re.sub(r"\d+", "0", member.filename))
        size += member.file_size
    is_frames = len(recordings) > 1 and len(patterns) == 1
    if not is_frames or _ending(recordings[0]) != ".json":
        return []
    require_at_most(size, KEYPOINTS_BYTES, "bytes in its JSON files")
    return sorted(recordings, key=_numbers_in)


def _numbers_in(member: zipfile.ZipInfo) -> list[int]:
    """Return the numbers in a name, by which frames are in order."""
    return list(map(int, re.findall(r"\d+", member.filename)))


def _files(members: list[zipfile.ZipInfo]) -> list[zipfile.ZipInfo]:
    """Return the members that are files which a person put into the archive."""
    files = []
    for member in members:
        path = PurePosixPath(member.filename)
        is_hidden = path.name.startswith(".") or "__MACOSX" in path.parts
        if not member.is_dir() and not is_hidden:
            files.append(member)
    return files


def _only_recording(members: list[zipfile.ZipInfo]) -> zipfile.ZipInfo:
    """Return the one member that is a recording, by its ending, or the only file."""
    require_at_most(len(members), MEMBERS, "files in the archive")
    files = _files(members)
    endings = [ending for ending in READERS if ending != ".zip"]
    recordings = [member for member in files if _ending(member) in endings]
    candidates = recordings or files
    if len(candidates) == 1 and _ending(candidates[0]) != ".zip":
        return candidates[0]
    found = _listed(member.filename for member in candidates)
    if len(recordings) > 1:
        raise ValueError(
            f"the archive holds {len(recordings)} recordings; unpack it and give one of them: {found}"
        )
    raise ValueError(
        f"the archive holds no recording ({', '.join(endings)}); found: {found or 'no file'}"
    )


def _ending(member: zipfile.ZipInfo) -> str:
    return PurePosixPath(member.filename).suffix.lower()


def _listed(names: Iterable[str]) -> str:
    every = list(names)
    if len(every) > LISTED:
        more = f" and {len(every) - LISTED} more"
    else:
        more = ""
    return ", ".join(every[:LISTED])[:400] + more


def _unpack(archive: zipfile.ZipFile, member: zipfile.ZipInfo, target: Path) -> None:
    """Write a member to a file, no more of it than is read of other files."""
    if member.flag_bits & 1:
        raise ValueError(f"{member.filename} is encrypted; unpack the archive")
    size = member.file_size
    with archive.open(member) as source, open(target, "wb") as stream:
        written = 0
        while size <= RECORDING_BYTES and written <= RECORDING_BYTES:
            block = source.read(BLOCK)
            if not block:
                return
            stream.write(block)
            written += len(block)
    raise ValueError(
        f"{member.filename} has {max(size, written) / MEGABYTE:.4g} MB or more; at most "
        f"{RECORDING_BYTES / MEGABYTE:.4g} MB are read"
    )


def _read_unpacked(unpacked: Path, name: str, options: ImportOptions) -> Recording:
    """Read the file, under the name that it has in the archive."""
    try:
        recording = read_with(unpacked, options)
    except FileFormatError as error:
        text = str(error).replace(f"{unpacked}: ", "", 1).replace(f"{unpacked}/", "")
        raise ValueError(f"{name}: {text}") from None
    note = f"read from {name} in the archive"
    return replace(
        recording,
        source=recording.source.replace(unpacked.name, name),
        notes=(*recording.notes, note),
    )
