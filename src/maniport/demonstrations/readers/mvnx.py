"""MVNX, the XML that Xsens' MVN writes: where each segment begins, frame by frame."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias, cast
from xml.etree import ElementTree

import numpy as np

from maniport.demonstrations.given import Given
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.input_limits import FRAMES, NESTING, PLACES, RECORDING_BYTES, existing_file, require_at_most
from maniport.validation import Array

Parser: TypeAlias = "ElementTree.XMLPullParser[Any]"

AT_ONCE = 2**16
"""Bytes that are read at once."""
SEGMENTS = 500
"""No suit has more."""
ELEMENTS = 3_000_000
"""Of a file; one that is as large as may be read has half of it, if all that it holds of each frame is positions."""


def read(file: Path, given: Given) -> Recording:
    """Read an MVNX file; see `maniport.demonstrations.readers.read_recording`."""
    size = existing_file(file, (), RECORDING_BYTES).stat().st_size
    found = _Frames(file)
    parser: Parser = ElementTree.XMLPullParser(events=("start", "end"))
    try:
        with open(file, "rb") as stream:
            left = size
            while left > 0 and (part := stream.read(min(AT_ONCE, left))):
                left -= len(part)
                parser.feed(part)
                found.take(parser)
        parser.close()
        found.take(parser)
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # of encodings that are none
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(f"{file}: not readable as XML, perhaps cut off: {error}") from None
    return found.recording(given)


class _Frames:
    """What is kept of the elements as they pass."""

    def __init__(self, file: Path) -> None:
        self.file, self.rate = file, 0.0
        self.names: list[str] = []
        self.rows: list[Array] = []
        self.times: list[float] = []
        self.open: list[ElementTree.Element] = []
        self.count = 0
        self.place: str | None = None

    def take(self, parser: Parser) -> None:
        """Take in what the parser has so far, and let go of elements that are done."""
        for event, element in cast(Iterator[tuple[str, ElementTree.Element]], parser.read_events()):
            tag = element.tag.rpartition("}")[2]
            if event == "start":
                if not self.open and tag != "mvnx":
                    raise FileFormatError(f"{self.file}: this is no MVNX file: its root is <{tag[:40]}>")
                self.open.append(element)
                self.count += 1
                require_at_most(self.count, ELEMENTS, "elements", self.file)
                require_at_most(len(self.open), NESTING, "levels of elements within elements", self.file)
                if tag == "subject":
                    self.rate = self._number(element.get("frameRate", "0"))
                if tag == "frame":
                    self.place = None
                if tag == "segment":
                    self.names.append(element.get("label", ""))
                    require_at_most(len(self.names), SEGMENTS, "segments", self.file)
                continue
            self.open.pop()
            if tag == "position" and self.place is None and self.open[-1].tag.endswith("frame"):
                self.place = element.text or ""
            if tag == "frame" and element.get("type", "normal") == "normal":
                self._frame(element)
            element.clear()
            if self.open:
                self.open[-1].remove(element)

    def _number(self, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            raise FileFormatError(f"{self.file}: a number is wanted; found {text[:40]!r}") from None

    def _frame(self, element: ElementTree.Element) -> None:
        number = len(self.rows) + 1
        if self.place is None:
            raise FileFormatError(f"{self.file}: frame {number} holds no <position>; export positions of segments, too")
        wanted = 3 * len(self.names)
        words = self.place.split(None, wanted)  # and what is too much in one
        if len(words) != wanted:
            found = len(words) if len(words) < wanted else f"more than {wanted}"
            raise FileFormatError(
                f"{self.file}: frame {number} holds {found} numbers for {len(self.names)} segments, not three each"
            )
        require_at_most(number, FRAMES, "frames", self.file)
        require_at_most(number * len(self.names), PLACES, "places (frames × segments)", self.file)
        self.rows.append(np.array([self._number(word) for word in words]))
        self.times.append(self._number(element.get("time", "nan")) / 1000.0)

    def recording(self, given: Given) -> Recording:
        """The recording of all frames."""
        if not self.rows or not self.names:
            raise FileFormatError(f"{self.file}: the file holds no frames")
        time: Array | None = np.array(self.times)
        if 0 < self.rate < np.inf:
            time = np.arange(len(self.rows)) / self.rate
        elif not np.isfinite(self.times).all():
            time = None
        positions = np.array(self.rows).reshape(len(self.rows), -1, 3)
        return given.recording(
            self.file, self.names, positions, time, "m", "z", "as MVNX has it", unit_by="as MVNX has it"
        )
