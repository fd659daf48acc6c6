"""Lines and tables of text, as most formats of recordings are written.

Files are read line by line, and numbers in blocks, so that little more than the array is in memory.
"""

import codecs
import csv
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import compress, repeat
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from maniport.util.input_limits import (
    FRAMES,
    LINE,
    PLACES,
    RECORDING_BYTES,
    existing_file,
    require_at_most,
)
from maniport.util.validation import Array

Row = tuple[int, str]  # The number of a line, from one, and the line

LARGEST_ANGLE = 1e3  # Joint angles beyond this count as missing [rad]

BLOCK_CHARACTERS = 2**20  # Of lines that are parsed at once: small beside an array that matters
HEAD = 2**16  # Bytes from which the encoding of a file is recognized
BYTE_ORDER_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",  # before UTF-16, whose mark it begins with
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
WIDE = {  # the number of bytes of a letter, and which are zero in letters of ASCII
    "utf-32-le": (4, (1, 2, 3)),
    "utf-32-be": (4, (0, 1, 2)),
    "utf-16-le": (2, (1,)),
    "utf-16-be": (2, (0,)),
}
JAPANESE = ("cp932", "euc_jp")
COMMON_KANJI = "右左上下半身首頭肩腕手足指親人中薬小目両全体腰捩先操作骨股膝肘胸"
MISSING = (  # Placeholders of missing numbers; those with # or brackets are written by programs for Windows
    "",
    "na",
    "n/a",
    "null",
    "none",
    "-",
    "1.#qnan",
    "-1.#qnan",
    "1.#ind",
    "-1.#ind",
    "1.#inf",
    "-1.#inf",
    "nan(ind)",
    "-nan(ind)",
)


class Block(NamedTuple):
    """Some lines of a file in a row, but for blank ones."""

    numbers: Sequence[int]  # of the lines, from one
    lines: list[str]


def lines_of(file: Path) -> Iterator[Row]:
    """Iterate over the lines of a text file, with any line ends; the number of a line comes first.

    Raises
    ------
    FileFormatError
        When the file cannot be read or is too large.
    InvalidInputError
        When it has too many lines, or too long ones.
    """
    with _opened(file) as stream:
        for number in range(1, 3 * FRAMES + 2):
            line = stream.readline(LINE + 2)
            if not line:
                return
            require_at_most(number, 3 * FRAMES, "lines")
            if len(line) > LINE:
                require_at_most(_rest_of_line(stream, line), LINE, "characters in a line")
            yield number, line.rstrip("\n")


def rows_of(file: Path) -> Iterator[Row]:
    """Iterate over the lines of a text file that are not blank."""
    return (row for row in lines_of(file) if row[1] and not row[1].isspace())


def row_blocks(
    file: Path, first: int = 1, comments: bool = False, end: str | None = None
) -> Iterator[Block]:
    """Iterate over the rows of a table, faster than line by line; raises as `lines_of`.

    Parameters
    ----------
    file : Path
    first : int
        Number of the line at which the rows begin.
    comments : bool
        Whether lines that begin with # are none.
    end : str, optional
        Characters that alone make up the line that ends the table; default: the rest of the file.
    """
    number = 1
    with _opened(file) as stream:
        while True:
            lines = stream.readlines(BLOCK_CHARACTERS)
            if not lines:
                return
            numbers = range(number, number + len(lines))
            number += len(lines)
            require_at_most(number - 1, 3 * FRAMES, "lines")
            require_at_most(max(map(len, lines)) - 1, LINE, "characters in a line")
            before = max(first - numbers.start, 0)
            block = Block(numbers[before:], lines[before:])
            ends_here = False
            if end is not None:
                last = _first_of(block.lines, end)
                ends_here = last is not None
                block = Block(block.numbers[:last], block.lines[:last])
            if any(map(str.isspace, block.lines)):
                block = _kept(block, [not line.isspace() for line in block.lines])
            if comments and "#" in "".join(block.lines):
                block = _kept(block, [line.lstrip()[:1] != "#" for line in block.lines])
            if block.lines:
                yield block
            if ends_here:
                return


def _first_of(lines: Sequence[str], characters: str) -> int | None:
    """Return the index of the first line that is made up of some characters; None where there is none."""
    for i, line in enumerate(lines):
        if not line.strip(characters):
            return i
    return None


def sliced(blocks: Iterable[Block], rows: slice) -> Iterator[Block]:
    """Iterate over some rows of a table, start and stop of which are given."""
    first = 0
    for block in blocks:
        if first >= rows.stop:
            return
        part = slice(max(rows.start - first, 0), rows.stop - first)
        first += len(block.lines)
        if part.start < len(block.lines):
            yield Block(block.numbers[part], block.lines[part])


def _opened(file: Path) -> TextIO:
    """Open a text file in its encoding."""
    existing_file(file, (), RECORDING_BYTES)
    with open(file, "rb") as binary:
        start = binary.read(HEAD)
    return open(file, encoding=encoding_of(start), errors="replace")


def encoding_of(content: bytes) -> str:
    """Recognize the encoding of a text by its beginning.

    UTF-8, UTF-16 and UTF-32 with a byte order mark or without it; else an encoding of Japanese, which programs for
    MikuMikuDance write, if all of it can be decoded so and contains kana or kanji; else UTF-8.
    """
    for mark, encoding in BYTE_ORDER_MARKS.items():
        if content.startswith(mark):
            return encoding
    content = content[:HEAD]
    for encoding, (period, places) in WIDE.items():
        if _is_wide(content[:256], period, places):
            return encoding
    if content.isascii() or _is_decodable(content, "utf-8"):
        return "utf-8-sig"
    for encoding in JAPANESE:
        if _is_decodable(content, encoding) and _is_japanese(content, encoding):
            return encoding
    return "utf-8-sig"


def _is_wide(letters: bytes, period: int, places: Sequence[int]) -> bool:
    """Whether letters of so many bytes have most zeros where those of ASCII have them."""
    if len(letters) < 2 * period or letters[:period].strip(b"\0") == b"":
        return False
    for place in places:
        zeros = letters[place::period]
        if zeros.count(0) <= 0.6 * len(zeros):
            return False
    return True


def _decoded_part(content: bytes, encoding: str) -> str:
    """Decode the beginning of a text, which may end within a character; raises `UnicodeDecodeError`."""
    decoder = codecs.getincrementaldecoder(encoding)()
    return decoder.decode(content)


def _is_decodable(content: bytes, encoding: str) -> bool:
    with suppress(UnicodeDecodeError):
        _decoded_part(content, encoding)
        return True
    return False


def _is_japanese(content: bytes, encoding: str) -> bool:
    """Whether letters beyond ASCII are those of Japanese, most of them kana or the words of sides and limbs."""
    count = 0
    usual = 0
    for letter in _decoded_part(content, encoding):
        if not letter.isascii():
            count += 1
            usual += letter in COMMON_KANJI or "\u3040" <= letter <= "\u30ff"
    return usual > 0.5 * count


def _kept(block: Block, flags: Sequence[bool]) -> Block:
    return Block(list(compress(block.numbers, flags)), list(compress(block.lines, flags)))


def _rest_of_line(stream: TextIO, line: str) -> int:
    """Return the number of characters of a line of which only the beginning was read."""
    length = len(line.rstrip("\n"))
    while not line.endswith("\n"):
        line = stream.readline(LINE)
        if not line:
            break
        length += len(line.rstrip("\n"))
    return length


def decoded(content: bytes) -> str:
    """Decode a text in its encoding, without the byte order mark."""
    return content.decode(encoding_of(content), errors="replace").lstrip("\ufeff")


def separator_of(line: str) -> str:
    """Return the separator of the fields of a line: comma, semicolon or tab."""
    return max(",;\t", key=line.count)


def fields_of(line: str, separator: str | None) -> list[str]:
    """Split a line into fields without surrounding blanks; None splits at blanks."""
    fields = line.split(separator)
    if separator and '"' in line:
        with suppress(csv.Error):  # a quoted field of 131 072 characters and more
            fields = next(csv.reader([line], delimiter=separator))
    return [field.strip() for field in fields]


def field_of(line: str, separator: str | None, column: int) -> str:
    """Return one field of a line, faster than all of them; empty where the line is shorter."""
    if separator and '"' in line:
        fields = fields_of(line, separator)
    else:
        fields = line.split(separator, column + 1)
    if column < len(fields):
        return fields[column].strip()
    return ""


def column_of(lines: Sequence[str], separator: str, column: int) -> list[str]:
    """Return one field of each line, as `field_of` does."""
    if '"' not in "".join(lines):
        with suppress(IndexError):  # of a short line
            fields = [line.split(separator, column + 1)[column] for line in lines]
            return list(map(str.strip, fields))
    return [field_of(line, separator, column) for line in lines]


class Labels(dict[str, int]):
    """The texts of a column and their indices; those that differ by blanks have one index.

    Attributes
    ----------
    names : dict
        The index of each text without blanks, in the order of indices.
    rows : list of ndarray
        The indices of the rows, block by block.
    """

    def __init__(self) -> None:
        super().__init__()
        self.names: dict[str, int] = {}
        self.rows: list[NDArray[np.int64]] = []
        self._frame: NDArray[np.str_] = np.empty(0, dtype="U1")  # as the next rows probably are

    def __missing__(self, text: str) -> int:
        index = self.names.setdefault(text.strip(), len(self.names))
        self[text] = index
        return index

    def add(self, texts: list[str]) -> None:
        """Append the texts of some rows."""
        rows = map(self.__getitem__, texts)
        self.rows.append(np.fromiter(rows, dtype=np.int64, count=len(texts)))

    def add_repeated(self, texts: NDArray[np.str_]) -> bool:
        """Append texts that repeat those of one frame, which is faster than `add`; False where they do not."""
        if not len(self._frame):
            return False
        places = np.arange(len(texts)) % len(self._frame)
        if not np.array_equal(texts, self._frame[places]):
            return False
        frame = map(self.__getitem__, self._frame.tolist())
        indices = np.fromiter(frame, dtype=np.int64, count=len(self._frame))
        self.rows.append(indices[places])
        self._frame = np.roll(self._frame, -len(texts))
        return True

    def expect(self, texts: NDArray[np.str_]) -> None:
        """Take the texts since the second last occurrence of the last one as those of a frame."""
        occurrences = np.flatnonzero(texts == texts[-1])
        self._frame = texts[occurrences[-2] + 1 :] if len(occurrences) > 1 else texts[:0]

    def indices(self) -> NDArray[np.int64]:
        """Return the indices of all rows, which are not kept."""
        indices = np.concatenate(self.rows)
        self.rows.clear()
        return indices


class NumberTable:
    """Collects the numbers of some columns of a table, in one array for each group of columns.

    Parameters
    ----------
    width : int
        Number of columns of the table.
    groups : sequence of sequences of int
        Columns of each array.
    separator : str, optional
        Separator of the fields; default: blanks.
    short : bool
        Whether fields may be missing at the end of a row.
    expected : int
        Number of rows for which memory is reserved; there may be more or fewer.
    texts : sequence of int
        Columns of texts, as of names; `labels` has those of each.
    """

    def __init__(
        self,
        width: int,
        groups: Sequence[Sequence[int]],
        separator: str | None = None,
        short: bool = False,
        expected: int = 0,
        texts: Sequence[int] = (),
    ) -> None:
        self.texts = texts
        self.labels = [Labels() for _ in texts]
        self._label_length = 16  # least number of letters for which memory is reserved
        self._is_all_numbers = True  # whether the whole table is expected to be numbers
        self.width = width
        self.groups = groups
        self.separator = separator
        self.short = short
        self.used = [column for group in groups for column in group]
        self.count = 0
        self._has_gaps = False  # whether empty fields are to be expected
        self.arrays = self._empty_arrays(expected)

    def read(self, blocks: Iterable[Block], size: int = 0) -> list[Array]:
        """Return the arrays, each of shape (n_rows, len(group)); placeholders are nan.

        Parameters
        ----------
        blocks : iterable of Block
        size : int
            Characters of all blocks, from which the number of rows is estimated; zero where unknown.

        Raises
        ------
        ValueError
            When there are no rows, or a row has a wrong number of fields or a text instead of a number.
        """
        before: Block | None = None  # the last block is special
        for block in blocks:
            if before is None and size:
                self._reserve(block, size)
            if before is not None:
                self._append(before, is_last=False)
            before = block
        if before is None:
            raise ValueError("the file holds no frames")
        self._append(before, is_last=True)
        for array in self.arrays:
            array.resize((self.count, array.shape[1]), refcheck=False)
        return self.arrays

    def _reserve(self, block: Block, size: int) -> None:
        """Reserve memory for all rows, if they are as long as those of a block."""
        characters = sum(map(len, block.lines))
        rows = int(1.01 * size * len(block.lines) / max(characters, 1)) + 1
        rows = min(rows, 3 * PLACES // self.width)
        self.arrays = self._empty_arrays(rows)

    def _empty_arrays(self, rows: int) -> list[Array]:
        return [np.empty((rows, len(group))) for group in self.groups]

    def _append(self, block: Block, is_last: bool) -> None:
        end = self.count + len(block.lines)
        require_at_most(end * self.width, 3 * PLACES, "numbers")
        numbers = self._parsed_with_labels(block.lines)
        if numbers is None:
            numbers = self._parsed(block.lines)
            if numbers is None:
                numbers = self._parsed_by_row(block, is_last)
            for labels, column in zip(self.labels, self.texts, strict=True):
                labels.add(column_of(block.lines, str(self.separator), column))
        first = 0
        for array, group in zip(self.arrays, self.groups, strict=True):
            if end > len(array):  # `resize` moves large arrays without a second copy
                if is_last:
                    rows = end
                else:
                    rows = max(end, len(array) * 5 // 4)
                array.resize((rows, len(group)), refcheck=False)
            array[self.count : end] = numbers[:, first : first + len(group)]
            first += len(group)
        self.count = end

    def _parsed_with_labels(self, lines: list[str]) -> Array | None:
        """Parse rows of numbers and labels at once; None where there are no labels or a row is unusual."""
        if not self.texts:
            return None
        lines = self._with_points(lines)
        table = self._structured(lines)
        if table is None:
            return None
        if not self._add_repeated(table):
            labeled = self._add_labels(lines, table)
            if labeled is None:
                return None
            table = labeled
        numbers = np.empty((len(lines), len(self.used)))
        for i, column in enumerate(self.used):
            numbers[:, i] = table[f"f{column}"]
        return numbers

    def _add_repeated(self, table: NDArray[np.void]) -> bool:
        """Append labels that repeat those of the frame before; False, and nothing appended, where one does not."""
        for i, (labels, column) in enumerate(zip(self.labels, self.texts, strict=True)):
            if not labels.add_repeated(table[f"f{column}"]):
                for added in self.labels[:i]:
                    added.rows.pop()
                return False
        return True

    def _add_labels(self, lines: list[str], table: NDArray[np.void]) -> NDArray[np.void] | None:
        """Append labels, and return the table, parsed again where one may be cut off; None where that fails."""
        if self._longest(table) >= self._label_length:  # perhaps cut off
            self._label_length = max(map(len, lines))
            parsed_again = self._structured(lines)
            if parsed_again is None:
                return None
            table = parsed_again
            self._label_length = 2 * self._longest(table)

        for labels, column in zip(self.labels, self.texts, strict=True):
            texts = table[f"f{column}"]
            labels.add(texts.tolist())
            labels.expect(texts)
        return table

    def _longest(self, table: NDArray[np.void]) -> int:
        """Return the number of letters of the longest label."""
        longest = 0
        for column in self.texts:
            longest = max(longest, int(np.char.str_len(table[f"f{column}"]).max()))
        return longest

    def _structured(self, lines: list[str]) -> NDArray[np.void] | None:
        """Parse rows as numbers, labels and, in the other columns, the first letter; None where it fails."""
        types = ["U1"] * self.width
        for column in self.used:
            types[column] = "f8"
        for column in self.texts:
            types[column] = f"U{self._label_length}"
        fields = np.dtype([(f"f{i}", kind) for i, kind in enumerate(types)])
        try:
            table = np.loadtxt(
                lines,
                dtype=fields,
                delimiter=self.separator,
                comments=None,
                quotechar='"',
                ndmin=1,
            )
        except ValueError:
            return None
        if len(table) == len(lines):
            return table
        return None

    def _parsed(self, lines: list[str]) -> Array | None:
        """Parse rows at once, shape (len(lines), columns in use); None where a row is unusual."""
        if self.separator is None:
            return self._whole_table(self._with_points(lines))

        if self._is_all_numbers and 2 * len(self.used) > self.width:
            numbers = self._whole_table(lines)
            if numbers is not None:
                return numbers
            self._is_all_numbers = False

        separators = self.width - 1
        if set(map(str.count, lines, repeat(self.separator))) != {separators}:
            fitted = self._fitted(lines)
            if fitted is None:
                return None
            lines = fitted
        lines = self._with_points(lines)
        numbers = None
        if not self._has_gaps:
            numbers = _loaded(lines, self.separator, self.used)
        if numbers is None:
            numbers = _loaded(self._with_nan(lines), self.separator, self.used)
            self._has_gaps = numbers is not None
        return numbers

    def _with_points(self, lines: list[str]) -> list[str]:
        """Return lines with points in place of decimal commas."""
        if self.separator == "," or "," not in lines[0]:
            return lines
        return [line.replace(",", ".") for line in lines]

    def _whole_table(self, lines: list[str]) -> Array | None:
        """Parse all fields, and return the columns in use; None where a row is unusual."""
        # without usecols `loadtxt` counts the fields
        numbers = _loaded(lines, self.separator, None)
        if numbers is None or numbers.shape[1] != self.width:
            return None
        if self.used == [*range(self.width)]:
            return numbers
        return numbers[:, self.used]

    def _fitted(self, lines: list[str]) -> list[str] | None:
        """Return lines with the right number of separators; None where fields are missing or too many."""
        fitted = []
        for line in map(str.rstrip, lines, repeat("\n")):
            missing = self.width - 1 - line.count(str(self.separator))
            if missing > 0 and not self.short:
                return None
            if missing < 0:
                surplus = line[missing:]
                if surplus.strip(str(self.separator)):
                    return None
                line = line[:missing]
            fitted.append(line + str(self.separator) * max(missing, 0))
        return fitted

    def _with_nan(self, lines: list[str]) -> list[str]:
        """Return lines with nan in their empty fields."""
        separator = str(self.separator)
        filled = []
        for line in map(str.rstrip, lines, repeat("\n")):
            text = f"{separator}{line}{separator}"
            if separator * 2 in text:
                text = text.replace(separator * 2, f"{separator}nan{separator}")
                text = text.replace(separator * 2, f"{separator}nan{separator}")
            filled.append(text[1:-1])
        return filled

    def _parsed_by_row(self, block: Block, is_last: bool) -> Array:
        """Parse row by row, with an error for the first faulty one."""
        count = len(block.lines)
        numbers = np.empty((count, len(self.used)))
        for i, (number, line) in enumerate(zip(block.numbers, block.lines, strict=True)):
            fields = fields_of(line, self.separator)
            while len(fields) > self.width and not fields[-1]:
                fields.pop()
            if self.short:
                fields += [""] * (self.width - len(fields))
            if len(fields) != self.width:
                cut = is_last and i == count - 1 and len(fields) < self.width
                if cut:
                    fault = "the file is cut off"
                else:
                    fault = "the table is broken"
                raise ValueError(
                    f"{fault} at line {number}: {len(fields)} values instead of {self.width}"
                )
            try:
                numbers[i] = [as_float(fields[column]) for column in self.used]
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
        return numbers


def _loaded(lines: list[str], separator: str | None, used: list[int] | None) -> Array | None:
    """Parse lines of plain numbers; None where one is none."""
    try:
        return np.loadtxt(lines, delimiter=separator, comments=None, usecols=used, ndmin=2)
    except ValueError:
        return None


def positive_number(text: str) -> float | None:
    """Parse a positive finite number; None where there is none."""
    with suppress(ValueError):
        value = as_float(text)
        if 0 < value < np.inf:
            return value
    return None


def is_cut_off(declared: str, count: int) -> bool:
    """Whether a header declares at least two rows more than there are."""
    declared = declared.strip()[:15]
    return declared.isdecimal() and int(declared) > count + 1


def as_float(field: str) -> float:
    """Parse a number with a point or a decimal comma; nan for the placeholders of missing numbers."""
    try:
        return float(field)
    except ValueError:
        missing = field.lower() in MISSING
        if missing:
            return np.nan
        return float(field.replace(",", "."))
