"""C3D, the binary format of optical motion capture: names, what dropped out, unit and axes."""

from pathlib import Path

import numpy as np

from maniport.demonstrations.given import Given
from maniport.demonstrations.readers.c3d_file import Parameters, read_c3d
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError


def read(file: Path, given: Given) -> Recording:
    """Read a C3D file; see `maniport.demonstrations.readers.read_recording`."""
    content = read_c3d(file)
    parameters, positions = content.parameters, content.points
    dropped = ~content.seen | (positions == 0).all(axis=-1) | ~np.isfinite(positions).all(axis=-1)
    positions[dropped] = np.nan
    rate = _number(parameters, "RATE", file)
    names, notes = _names(parameters, positions.shape[1])
    if dropped.any():
        gone = [name for name, all_gone in zip(names, dropped.all(axis=0), strict=True) if all_gone]
        notes.append(
            f"{dropped.mean():.1%} of all points dropped out" + (f"; never seen: {', '.join(gone)}" if gone else "")
        )
    screen = _text(parameters, "Y_SCREEN").lower().replace("+", "")
    time, unit = np.arange(len(positions)) / rate, _text(parameters, "UNITS")
    return given.recording(file, names, positions, time, unit, screen, "the file's Y_SCREEN", notes=notes)


def _number(parameters: Parameters, name: str, file: Path) -> float:
    value = float(parameters[name][0])
    if not np.isfinite(value) or value <= 0:
        raise FileFormatError(f"{file}: POINT:{name} must be a positive number; found {value}")
    return value


def _text(parameters: Parameters, name: str) -> str:
    value = parameters.get(name, [])
    return str(value[0]).strip() if len(value) else ""


def _names(parameters: Parameters, count: int) -> tuple[tuple[str, ...], list[str]]:
    """Clean the labels: quotes, blanks and the subject's prefix go, as long as the names stay different."""
    labels: list[str] = []
    for key in ("LABELS", *(f"LABELS{i}" for i in range(2, 100))):  # more than 255 labels continue in LABELS2, …
        labels += [str(label).strip().strip("\"'").strip() for label in parameters.get(key, [])]
    labels = [labels[i] if i < len(labels) and labels[i] else f"point{i + 1}" for i in range(count)]
    bare = [label.rsplit(":", 1)[-1].strip().strip("\"'") for label in labels]
    names = bare if len(set(bare)) == len(bare) else labels
    prefixes = sorted({label.rsplit(":", 1)[0] for label in labels if ":" in label})
    notes = [f"prefix {', '.join(map(repr, prefixes))} taken off the names"] if prefixes and names is bare else []
    return tuple(names), notes
