"""MVNX, the XML that Xsens' MVN writes: the origin of each segment, frame by frame."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from maniport.mocap.readers import ImportOptions, require_size
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
    times: list[float] = []
    rate, text, count = 0.0, None, 0
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
                rate = float(element.get("frameRate", "0"))
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
            number, width = len(rows) + 1, 3 * len(names)
            require_size(number, len(names))
            if text is None:
                raise ValueError(
                    f"frame {number} holds no <position>; export positions of segments, too"
                )
            words = text.split(None, width)  # more words than that stay in one
            if len(words) != width:
                amount = len(words) if len(words) < width else f"more than {width}"
                raise ValueError(
                    f"frame {number} holds {amount} numbers for {len(names)} segments, not three each"
                )
            rows.append(np.array(words, dtype=np.float64))
            times.append(float(element.get("time", "nan")) / 1000.0)
        element.clear()
        if path:
            path[-1].remove(element)
    if not rows or not names:
        raise ValueError("the file holds no frames")
    time = (
        np.arange(len(rows)) / rate
        if 0 < rate < np.inf
        else times
        if np.isfinite(times).all()
        else None
    )
    positions = np.array(rows).reshape(len(rows), -1, 3)
    return options.recording(file, names, positions, time, "m")
