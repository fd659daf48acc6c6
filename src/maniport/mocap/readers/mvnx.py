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

ELEMENTS = (
    3_000_000  # Most elements of a file; the largest file of positions alone has half of them
)


def read(file: Path, options: ImportOptions) -> Recording:
    """Read an MVNX file, dropping its elements as they end; see `maniport.mocap.readers.read_recording`."""
    existing_file(file, (), RECORDING_BYTES)
    names: list[str] = []
    rows: list[Array] = []
    stamps: dict[str, list[float]] = {name: [] for name in ("time", "ms", "index")}
    rate = 0.0
    text: str | None = None
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
            if tag == "subject":
                rate = positive_number(element.get("frameRate", "")) or 0.0
            elif tag == "frame":
                text = None
            elif tag == "segment":
                names.append(element.get("label", ""))
                require_at_most(len(names), 500, "segments")
            continue
        path.pop()
        if tag == "position" and text is None and path[-1].tag.endswith("frame"):
            text = element.text or ""
        if tag == "frame" and element.get("type", "normal") == "normal":
            number = len(rows) + 1
            width = 3 * len(names)
            require_size(number, len(names))
            if text is None:
                raise ValueError(
                    f"frame {number} holds no <position>; export positions of segments, too"
                )
            if "," in text and "." not in text:
                text = text.replace(",", ".")  # decimals
            words = text.split(None, width)  # more words than that stay in one
            if len(words) != width:
                if len(words) < width:
                    amount = str(len(words))
                else:
                    amount = f"more than {width}"
                raise ValueError(
                    f"frame {number} holds {amount} numbers for {len(names)} segments, not three each"
                )
            rows.append(np.array(words, dtype=np.float64))
            for name, values in stamps.items():
                values.append(_number(element.get(name, "")))
        element.clear()
        if path:
            path[-1].remove(element)
    if not rows or not names:
        raise ValueError("the file holds no frames")
    clocks = {}
    for name in (
        "time",
        "ms",
    ):  # since the start, and of the day or since 1970, both in milliseconds
        stamp = np.array(stamps[name])
        if np.isfinite(stamp).any():
            clocks[name] = (stamp - stamp[np.isfinite(stamp)][0]) / 1000.0
    stated = FileTimes(clocks, np.array(stamps["index"]), {"frameRate": rate})
    positions = np.array(rows).reshape(len(rows), -1, 3)
    return options.recording(file, names, positions, stated, "m")


def _number(text: str) -> float:
    """Parse a number; nan where there is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")
