"""C3D, the binary format of optical motion capture, through ezc3d."""

from pathlib import Path
from typing import Any

import numpy as np

from maniport.demonstrations.conventions import in_metres, numbered, upward
from maniport.demonstrations.readers.c3d_layout import require_whole
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError


def read(file: Path, scale: float | None, up: str | None) -> Recording:
    """Read a C3D file; see `maniport.demonstrations.readers.read_recording`.

    Points whose residual is negative, whose three coordinates are exactly zero or one of whose coordinates is nan are
    missing: recorders mark drop-outs in all three ways.
    """
    content = _load(file)
    parameters = content["parameters"]
    points = np.asarray(content["data"]["points"], dtype=np.float64)
    if points.size == 0:
        raise FileFormatError(f"{file}: the file holds no points ({points.shape[1]} points, {points.shape[2]} frames)")
    positions = np.moveaxis(points[:3], 0, -1).swapaxes(0, 1).copy()
    residuals = np.asarray(content["data"]["meta_points"]["residuals"])[0].T
    dropped = (residuals < 0) | (positions == 0).all(axis=-1) | ~np.isfinite(positions).all(axis=-1)
    positions[dropped] = np.nan
    rate = _number(parameters, "RATE", file)
    names, notes = _names(parameters, positions.shape[1])
    if dropped.any():
        gone = [name for name, all_gone in zip(names, dropped.all(axis=0), strict=True) if all_gone]
        notes.append(
            f"{dropped.mean():.1%} of all points dropped out" + (f"; never seen: {', '.join(gone)}" if gone else "")
        )
    tracks = {name: positions[:, i] for i, name in enumerate(names)}
    scale, unit_note = in_metres(tracks, scale, str(file), _text(parameters, "UNITS"))
    screen = _text(parameters, "Y_SCREEN").lower().replace("+", "")
    up, up_note = upward(tracks, up, "z", screen, "the file's Y_SCREEN")
    return Recording(
        names=names,
        positions=positions * scale,
        time=np.arange(len(positions)) / rate,
        up=up,
        source=file.name,
        notes=(unit_note, up_note, *notes),
    )


def _load(file: Path) -> Any:
    """Let ezc3d read the file, once it is known to be whole: damaged ones make the library crash or skip frames."""
    import ezc3d

    frames = require_whole(file)
    try:
        content = ezc3d.c3d(str(file))
    except Exception as error:  # noqa: BLE001  the library throws whatever its C++ side throws
        reason = str(error).strip().splitlines()
        raise FileFormatError(f"{file}: not readable as C3D: {reason[0] if reason else type(error).__name__}") from None
    points = content["data"]["points"]
    parameters = content["parameters"]["POINT"]
    word = 4 if float(parameters["SCALE"]["value"][0]) < 0 else 2
    start = 512 * (int(parameters["DATA_START"]["value"][0]) - 1)
    needed, found = start + frames * points.shape[1] * 4 * word, file.stat().st_size
    if points.shape[2] < frames or found < needed:
        raise FileFormatError(
            f"{file}: the file is cut off: its header announces {frames} frames, that is at least {needed} bytes; "
            f"it ends after {found}"
        )
    return content


def _number(parameters: Any, name: str, file: Path) -> float:
    value = np.ravel(parameters["POINT"].get(name, {}).get("value", []))
    if not len(value) or not np.isfinite(value[0]) or value[0] <= 0:
        raise FileFormatError(f"{file}: POINT:{name} must be a positive number; found {value.tolist()}")
    return float(value[0])


def _text(parameters: Any, name: str) -> str:
    value = parameters["POINT"].get(name, {}).get("value", [])
    return str(value[0]).strip() if len(value) else ""


def _names(parameters: Any, count: int) -> tuple[tuple[str, ...], list[str]]:
    """Clean the labels: quotes, blanks and the subject's prefix go, as long as the names stay different."""
    labels: list[str] = []
    for key in ("LABELS", *(f"LABELS{i}" for i in range(2, 100))):  # more than 255 labels continue in LABELS2, …
        labels += [
            str(label).strip().strip("\"'").strip() for label in parameters["POINT"].get(key, {}).get("value", [])
        ]
    labels = [labels[i] if i < len(labels) and labels[i] else f"point{i + 1}" for i in range(count)]
    bare = [label.rsplit(":", 1)[-1].strip().strip("\"'") for label in labels]
    names = bare if len(set(bare)) == len(bare) else labels
    prefixes = sorted({label.rsplit(":", 1)[0] for label in labels if ":" in label})
    notes = [f"prefix {', '.join(map(repr, prefixes))} taken off the names"] if prefixes and names is bare else []
    unique = numbered(names)
    if unique != names:
        notes.append("names that occur more than once were numbered")
    return tuple(unique), notes
