"""MVNX, the XML that Xsens' MVN writes: the origin of each segment, frame by frame."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from maniport.mocap.readers import ImportOptions, require_size
from maniport.mocap.readers.text import positive_number
from maniport.mocap.readers.times import FileTimes
from maniport.mocap.recording import Recording
from maniport.util.input_limits import NESTING, RECORDING_BYTES, existing_file, require_at_most
from maniport.util.validation import Array

ELEMENTS = 3_000_000
"""Most elements of a file. The largest file of positions alone has half of them."""


class _Content:
    """The frames of a file, as far as it is read."""

    def __init__(self) -> None:
        self.names: list[str] = []  # of the segments
        self.rows: list[Array] = []  # positions of the segments, (3 segments,) in each frame
        self.stamps: dict[str, list[float]] = {"time": [], "ms": [], "index": []}
        self.rate = 0.0
        self._positions: str | None = None  # those of the frame that is being read

    def begin(self, tag: str, element: ElementTree.Element) -> None:
        """Take the attributes of an element that begins."""
        if tag == "subject":
            self.rate = positive_number(element.get("frameRate", "")) or 0.0
        elif tag == "frame":
            self._positions = None
        elif tag == "segment":
            self.names.append(element.get("label", ""))
            require_at_most(len(self.names), 500, "segments")

    def add_positions(self, text: str) -> None:
        """Take the text of the positions in a frame, the first of which count."""
        if self._positions is None:
            self._positions = text

    def end_frame(self, element: ElementTree.Element) -> None:
        """Append a frame that ends."""
        number = len(self.rows) + 1
        width = 3 * len(self.names)
        require_size(number, len(self.names))
        text = self._positions
        if text is None:
            raise ValueError(
                f"frame {number} holds no <position>; export positions of segments, too"
            )
        if "," in text and "." not in text:
            text = text.replace(",", ".")  # decimals
        words = text.split(None, width)  # more words than that stay in one
        if len(words) != width:
            amount = f"more than {width}"
            if len(words) < width:
                amount = str(len(words))
            raise ValueError(
                f"frame {number} holds {amount} numbers for {len(self.names)} segments, not three each"
            )
        self.rows.append(np.array(words, dtype=np.float64))
        for name, values in self.stamps.items():
            values.append(_number(element.get(name, "")))

    def times(self) -> FileTimes:
        """Return the times and the rate of the file."""
        clocks = {}
        # times since the start, and of the day or since 1970, both in milliseconds
        for name in ("time", "ms"):
            stamp = np.array(self.stamps[name])
            if np.isfinite(stamp).any():
                clocks[name] = (stamp - stamp[np.isfinite(stamp)][0]) / 1000.0
        return FileTimes(clocks, np.array(self.stamps["index"]), {"frameRate": self.rate})


def read(file: Path, options: ImportOptions) -> Recording:
    """Read an MVNX file, dropping its elements as they end; see `maniport.mocap.readers.read_recording`."""
    existing_file(file, (), RECORDING_BYTES)
    content = _Content()
    count = 0
    path: list[ElementTree.Element] = []
    for event, element in ElementTree.iterparse(file, events=("start", "end")):
        tag = element.tag.rpartition("}")[2]
        if event == "start":
            if not path and tag != "mvnx":
                raise ValueError(f"this is no MVNX file: its root is <{tag[:40]}>")
            path.append(element)
            count += 1
            require_at_most(count, ELEMENTS, "elements")
            require_at_most(len(path), NESTING, "levels of elements within elements")
            content.begin(tag, element)
            continue
        path.pop()
        if tag == "position" and path[-1].tag.endswith("frame"):
            content.add_positions(element.text or "")
        if tag == "frame" and element.get("type", "normal") == "normal":
            content.end_frame(element)
        element.clear()
        if path:
            path[-1].remove(element)

    if not content.rows or not content.names:
        raise ValueError("the file holds no frames")
    positions = np.array(content.rows).reshape(len(content.rows), -1, 3)
    return options.recording(file, content.names, positions, content.times(), "m")


def _number(text: str) -> float:
    """Parse a number; nan where there is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")
