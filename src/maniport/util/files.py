"""Read and write data files: arrays (.npz), ellipsoids and paths, and settings in YAML."""

import math
import os
import re
import zipfile
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, ClassVar

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from maniport.errors import FileFormatError, nearest_first, shown, some_of
from maniport.util.atomic_io import written_whole
from maniport.util.input_limits import (
    ARRAYS_BYTES,
    MEGABYTE,
    SETTINGS_BYTES,
    existing_file,
    read_whole,
)
from maniport.util.validation import (
    Array,
    Shape,
    as_finite,
    as_positive_semidefinite,
    as_times,
    require_shape,
)


def spreadsheet_cell(value: object) -> object:
    """Return a value for CSV, where many readers take each line for a row.

    In a text, `` | `` replaces line breaks, and an apostrophe precedes what spreadsheets would evaluate as a formula.
    """
    if not isinstance(value, str):
        return value
    line = " | ".join(filter(None, value.splitlines()))
    if line.startswith(("=", "+", "-", "@", "\t")):
        return f"'{line}"
    return line


def save_arrays(
    path: str | os.PathLike[str], arrays: Mapping[str, ArrayLike], compress: bool = True
) -> None:
    """Write named arrays to an ``.npz`` file, whole or not at all."""
    write: Callable[..., None] = np.savez
    if compress:
        write = np.savez_compressed
    with written_whole(path) as temporary, open(temporary, "wb") as stream:
        write(stream, **arrays)


def load_arrays(
    path: str | os.PathLike[str], what: str, names: Collection[str] | None = None
) -> dict[str, NDArray[np.generic]]:
    """Read arrays of an ``.npz`` file."""
    with _archive(path, what) as archive:
        chosen = _members(archive)
        if names is not None:
            chosen = {name: info for name, info in chosen.items() if name in names}
        unpacked = sum(info.file_size for info in chosen.values())
        if unpacked > ARRAYS_BYTES:
            raise FileFormatError(
                f"{what} {str(path)!r}: its arrays have {unpacked / MEGABYTE:.4g} MB; at most "
                f"{ARRAYS_BYTES / MEGABYTE:.4g} MB are read"
            )
        arrays = {}
        for name, info in chosen.items():
            with archive.open(info) as stream:
                arrays[name] = read_npy(stream, info.file_size)
        return arrays


def array_names(path: str | os.PathLike[str], what: str) -> list[str]:
    """Names of the arrays in an ``.npz`` file; raises as `load_arrays` does."""
    with _archive(path, what) as archive:
        return sorted(_members(archive))


@contextmanager
def _archive(path: str | os.PathLike[str], what: str) -> Iterator[zipfile.ZipFile]:
    """Open an ``.npz`` file; every error of zipfile and NumPy becomes a `FileFormatError`."""
    file = existing_file(path, (), ARRAYS_BYTES)
    try:
        with zipfile.ZipFile(file) as archive:
            yield archive
    except FileFormatError:
        raise
    except Exception as error:  # noqa: BLE001 - decompressors and NumPy raise errors of a dozen types on damaged files
        raise FileFormatError(
            f"{what} {str(path)!r} is not a readable .npz file: {error}"
        ) from None


def _members(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Members by the names of their arrays; a name with the ending ``.npy`` precedes one without."""
    infos = sorted(archive.infolist(), key=lambda info: info.filename.endswith(".npy"))
    return {info.filename.removesuffix(".npy"): info for info in infos}


def read_npy(stream: IO[bytes], size: int) -> NDArray[np.generic]:
    """Read an array from a stream of `size` bytes in NumPy's format; may raise errors of any type."""
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        read = np.lib.format.read_array_header_1_0
    else:
        read = np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    if math.prod(shape) * max(dtype.itemsize, 1) > size:
        raise ValueError(f"its header declares the shape {shape} of {dtype}, more than there is")
    stream.seek(0)
    array = np.asarray(np.lib.format.read_array(stream, allow_pickle=False))
    if array.dtype.kind in "UV":
        array.tolist()  # raises an error where characters are no Unicode, which is not checked in reading
    return array


def save_ellipsoids(
    path: str | os.PathLike[str], manipulability: ArrayLike, time: ArrayLike | None = None
) -> None:
    """Write ellipsoids (n, d, d), and their times (n,) in seconds where there are any, to an ``.npz`` file."""
    points = as_finite(manipulability, "manipulability")
    require_shape(points, "manipulability", ("n", "d", "d"), " with n ≥ 1")
    _save(path, "manipulability", as_positive_semidefinite(points, "manipulability"), time)


def load_ellipsoids(path: str | os.PathLike[str]) -> tuple[Array, Array | None]:
    """Read ellipsoids (n, d, d) and, where the file has them, their times (n,) in seconds."""
    points, time = _load(path, "ellipsoid file", "manipulability", ("n", "d", "d"))
    return as_positive_semidefinite(points, f"manipulability in {str(path)!r}"), time


def save_path(
    path: str | os.PathLike[str], positions: ArrayLike, time: ArrayLike | None = None
) -> None:
    """Write positions (n, 3) [m], and their times (n,) in seconds where there are any, to an ``.npz`` file."""
    points = as_finite(positions, "path")
    require_shape(points, "path", ("n", 3))
    _save(path, "path", points, time)


def load_path(path: str | os.PathLike[str]) -> tuple[Array, Array | None]:
    """Read positions (n, 3) [m] and, where the file has them, their times (n,) in seconds."""
    return _load(path, "path file", "path", ("n", 3))


def _save(path: str | os.PathLike[str], name: str, points: Array, time: ArrayLike | None) -> None:
    """Write an array, and its times where there are any."""
    times = {} if time is None else {"time": as_times(time, count=len(points))}
    save_arrays(path, {name: points} | times)


def _load(
    path: str | os.PathLike[str], what: str, name: str, shape: Shape
) -> tuple[Array, Array | None]:
    """Return the array of that name, and its times where there are any."""
    arrays = load_arrays(path, what, (name, "time"))
    where = f"in {str(path)!r}"
    if name not in arrays:
        names = some_of(array_names(path, what))
        raise FileFormatError(f"{what} {str(path)!r} has no array {name!r}; it holds {names}")
    points = as_finite(arrays[name], f"{name} {where}")
    require_shape(points, f"{name} {where}", shape)
    if "time" not in arrays:
        return points, None
    return points, as_times(arrays["time"], f"time {where}", len(points))


def read_settings(path: str | os.PathLike[str], keys: Collection[str]) -> dict[str, Any]:
    """Read a YAML 1.2 or JSON file that holds one mapping."""
    file = Path(path)
    text = read_whole(file, (".yaml", ".yml", ".json"), SETTINGS_BYTES)
    try:
        content = yaml.load(text.decode("utf-8-sig"), Loader=_StrictLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f" in line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise FileFormatError(f"{file}: not readable as YAML{where}: {error.problem}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise FileFormatError(f"{file}: not readable as YAML: {error}") from None
    return require_mapping(content, keys, str(file))


def settings_text(content: Mapping[str, object]) -> str:
    """Write a mapping as YAML that `read_settings` and readers of YAML 1.1 read alike."""
    text = yaml.dump(content, Dumper=_CarefulDumper, sort_keys=False, allow_unicode=True, width=110)
    return str(text)


def line_of(path: str | os.PathLike[str], *keys: str) -> str:
    """Return the line of a key in a YAML file, for messages; `keys` lead to it from the root."""
    node = yaml.compose(read_whole(path, (), SETTINGS_BYTES))
    line = ""
    for key in filter(None, keys):
        entries = {name.value: (name, value) for name, value in node.value}
        if key not in entries:
            return ""
        name, node = entries[key]
        line = f", line {name.start_mark.line + 1}"
    return line


def require_mapping(content: object, keys: Collection[str], where: str) -> dict[str, Any]:
    """Require a mapping that has no keys but some; `where` names it, such as ``"limits.yaml: joints"``."""
    allowed = ", ".join(keys)
    if not isinstance(content, dict):
        kind = type(content).__name__
        if content is None:
            kind = "nothing"
        raise FileFormatError(f"{where} must be a mapping with the keys {allowed}; found {kind}")
    for key in content:
        if key not in keys:
            near = ", ".join(nearest_first(key, keys))
            raise FileFormatError(
                f"{where}: unknown key {shown(key, 60)}; allowed are, nearest first: {near}"
            )
    return content


CORE_SCHEMA = {
    "null": (r"~|null|Null|NULL|", "~nN"),
    "bool": (r"true|True|TRUE|false|False|FALSE", "tTfF"),
    "int": (r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789"),
    "float": (
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        "-+.0123456789",
    ),
}
"""Plain scalars of YAML 1.2 by type: pattern, and the characters that they begin with (specification, 10.3.2)."""

LARGEST_INTEGER = 2**63
"""Integers of files are below it, as those of other programs."""


def _tag(name: str) -> str:
    return f"tag:yaml.org,2002:{name}"


class _StrictLoader(yaml.SafeLoader):
    """Reads the core schema of YAML 1.2, where PyYAML reads YAML 1.1 with ``1:30`` as 90 and ``no`` as false.

    Refuses aliases, which make a small file grow without bounds, duplicate keys, and tags of other types.
    """

    yaml_implicit_resolvers: ClassVar[dict[str, list[tuple[str, re.Pattern[str]]]]] = {}
    yaml_constructors: ClassVar[dict[str | None, Callable[..., object]]] = {
        tag: yaml.SafeLoader.yaml_constructors[tag]
        for tag in (None, _tag("str"), _tag("seq"), _tag("map"))
    }

    def compose_node(
        self, parent: yaml.Node | None, index: int | yaml.Node | None
    ) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.composer.ComposerError(
                None, None, f"aliases (*{event.anchor}) are not read", event.start_mark
            )
        return super().compose_node(parent, index)

    def construct_mapping(
        self, node: yaml.MappingNode, deep: bool = False
    ) -> dict[Hashable, object]:
        seen: set[Hashable] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable) and key in seen:
                problem = f"the key {shown(key, 60)} occurs twice"
                raise yaml.constructor.ConstructorError(None, None, problem, key_node.start_mark)
            if isinstance(key, Hashable):
                seen.add(key)
        mapping: dict[Hashable, object] = super().construct_mapping(node, deep)
        return mapping

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Leave ``<<`` a key like others: YAML 1.2 merges no mappings."""

    def construct_core(self, node: yaml.ScalarNode) -> bool | int | float | None:
        """Convert a scalar of `CORE_SCHEMA`; an error where a tag such as ``!!int`` does not fit its text."""
        kind = node.tag.rpartition(":")[2]
        text = str(self.construct_scalar(node))
        if not re.fullmatch(CORE_SCHEMA[kind][0], text):
            raise self._fault(node, f"{text[:40]!r} is no {kind} of YAML 1.2")
        if kind == "null":
            return None
        if kind == "bool":
            return text.lower() == "true"
        if kind == "float":
            return float(re.sub(r"\.(?=[iInN])", "", text))
        return self._integer(node, text)

    def _integer(self, node: yaml.ScalarNode, text: str) -> int:
        base = {"0o": 8, "0x": 16}.get(text[:2], 10)
        if base == 10:
            digits = text.lstrip("+-0")
        else:
            digits = text[2:].lstrip("0")
        if len(digits) > LARGEST_INTEGER.bit_length():  # Python converts no text of any length
            raise self._fault(node, f"an integer of {len(digits)} digits is too large")
        if base != 10:
            value = int(text[2:], base)
        else:
            value = int(text)
        if abs(value) >= LARGEST_INTEGER:
            raise self._fault(
                node, f"the integer {value} is too large; allowed are those below 2^63"
            )
        return value

    def _fault(self, node: yaml.Node, problem: str) -> yaml.MarkedYAMLError:
        return yaml.constructor.ConstructorError(None, None, problem, node.start_mark)


class _CarefulDumper(yaml.SafeDumper):
    """Quotes texts that YAML 1.1 or YAML 1.2 would read as another type."""


for _name, (_pattern, _initials) in CORE_SCHEMA.items():
    _StrictLoader.add_constructor(_tag(_name), _StrictLoader.construct_core)
    for _class in (_StrictLoader, _CarefulDumper):
        if _name == "null":
            _first = [*_initials, ""]
        else:
            _first = list(_initials)
        _class.add_implicit_resolver(_tag(_name), re.compile(rf"(?:{_pattern})\Z"), _first)
