"""A file to which the results of a batch are appended as they come, since a Parquet file cannot be extended.

An entry is a header (mark, checksum, length) and the tables of a pair as Arrow streams. A process that is killed leaves
at most the last entry incomplete; the file is cut there when it is opened again.
"""

import os
import struct
import zlib
from collections.abc import Collection, Iterator, Set
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from maniport.batch.parquet_tables import MANIFEST, NAMES, Key, Tables
from maniport.batch.table import Row
from maniport.util.optional import arrow_of_batches

if TYPE_CHECKING:
    import pyarrow

MARK = b"MPJ1"
HEADER = struct.Struct("<4sIQ")  # mark, CRC-32 and length of the tables


class Journal:
    """Results by pair, of which the last of each pair counts; a context manager.

    Parameters
    ----------
    path : Path
        A new file, or that of a batch that was interrupted.

    Attributes
    ----------
    rows : dict
        Row of the manifest by pair.
    """

    def __init__(self, path: Path):
        self.path = path
        self.rows: dict[Key, Row] = {}
        self._places: dict[Key, tuple[int, int]] = {}  # begin and length of tables [B]
        self._stream: BinaryIO = open(path, "a+b")  # noqa: SIM115 - closed by `close`
        self._stream.truncate(self._load())

    def __contains__(self, key: Key) -> bool:
        return key in self._places

    def __len__(self) -> int:
        return len(self._places)

    def append(self, tables: Tables) -> None:
        """Append the tables of a pair; they are on the disk when this returns."""
        arrow = arrow_of_batches()

        content = BytesIO()
        for name in NAMES:
            with arrow.ipc.new_stream(content, tables[name].schema) as writer:
                writer.write_table(tables[name])
        data = content.getvalue()
        begin = self._stream.seek(0, os.SEEK_END)
        self._stream.write(HEADER.pack(MARK, zlib.crc32(data), len(data)) + data)
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._index(begin + HEADER.size, len(data), tables)

    def pairs(self, name: str, wanted: Set[Key]) -> Iterator[tuple[Key, "pyarrow.Table"]]:
        """Yield the rows that each pair of those wanted has in a table, sorted by pair."""
        for key in sorted(self._places.keys() & wanted):
            begin, length = self._places[key]
            self._stream.seek(begin)
            table = _tables(self._stream.read(length), [name])[name]
            if len(table):
                yield key, table

    def close(self) -> None:
        """Close the file, which stays."""
        self._stream.close()

    def _load(self) -> int:
        """Read all complete entries; return where they end [B]."""
        end = 0
        self._stream.seek(0)
        while True:
            header = self._stream.read(HEADER.size)
            if len(header) < HEADER.size:
                return end
            mark, checksum, length = HEADER.unpack(header)
            data = b""
            if mark == MARK:
                data = self._stream.read(length)
            if len(data) != length or zlib.crc32(data) != checksum:
                return end
            begin = end + HEADER.size
            self._index(begin, length, _tables(data, [MANIFEST]))
            end = begin + length

    def _index(self, begin: int, length: int, tables: Tables) -> None:
        """Remember the place of the tables of a pair."""
        (row,) = tables[MANIFEST].to_pylist()
        key = row["recording"], row["robot"]
        self.rows[key] = row
        self._places[key] = (begin, length)


def _tables(data: bytes, wanted: Collection[str]) -> dict[str, "pyarrow.Table"]:
    """Read some tables of an entry."""
    arrow = arrow_of_batches()

    stream = arrow.BufferReader(data)
    tables = {}
    for name in NAMES:
        with arrow.ipc.open_stream(stream) as reader:
            table = reader.read_all()
        if name in wanted:
            tables[name] = table
    return tables
