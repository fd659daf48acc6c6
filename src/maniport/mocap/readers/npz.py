"""NPZ and NPY, NumPy arrays: what `Recording.save` writes, joint positions of other programs, pose parameters.

Arrays without names are recognized as a skeleton by the number of their joints, but only when the arms of that
skeleton are arms in these positions: their bones keep their lengths and are as long as on the other side.
"""

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from maniport.errors import FileFormatError
from maniport.mocap.import_options import ImportOptions
from maniport.mocap.marker_sets import load_names
from maniport.mocap.readers.smpl_pose import posed
from maniport.mocap.readers.text import decoded
from maniport.mocap.recording import Recording
from maniport.util.files import array_names, load_arrays, read_npy
from maniport.util.input_limits import (
    PLACES,
    RECORDING_BYTES,
    SETTINGS_BYTES,
    existing_file,
    read_whole,
    require_at_most,
)
from maniport.util.validation import Array

KEYS = {
    "names": "names joint_names joints_names keypoint_names marker_names labels",
    "positions": "positions joints joint_positions global_joint_positions joints3d keypoints3d keypoints_3d keypoints "
    "markers points xyz",
    "time": "time times t timestamps",
    "rate": "rate fps mocap_framerate mocap_frame_rate frame_rate framerate",
    "poses": "poses",
    "root": "root_orient global_orient",
    "body": "pose_body body_pose",
    "trans": "trans transl",
    "unit": "unit units",
    "up": "up",
}
"""Names of arrays: the first that is in the file counts."""


def read(file: Path, options: ImportOptions) -> Recording:
    """Read an ``.npz`` or ``.npy`` file; see `maniport.mocap.readers.read_recording`."""
    size = existing_file(file, (), RECORDING_BYTES).stat().st_size
    with open(file, "rb") as stream:
        if stream.read(6) == b"\x93NUMPY":
            stream.seek(0)
            try:
                positions = read_npy(stream, size)
            except Exception as error:  # noqa: BLE001 - NumPy raises errors of many types on damaged files
                raise FileFormatError(f"{file}: not a readable .npy file: {error}") from None
            return _positions(file, options, {"positions": positions}, None)
    if file.suffix.lower() == ".npy":
        raise FileFormatError(f"{file}: not a readable .npy file: it does not begin as one")
    found = array_names(file, "recording")
    keys = {what: next((key for key in known.split() if key in found), None) for what, known in KEYS.items()}
    loaded = load_arrays(file, "recording", [key for key in keys.values() if key])
    arrays = {what: loaded[key] for what, key in keys.items() if key}
    parted = "poses" not in arrays and {"root", "body"} <= arrays.keys()
    if parted:
        arrays["poses"] = _joined(file, arrays["root"], arrays["body"])
    if "positions" not in arrays and "poses" not in arrays:
        raise FileFormatError(
            f"{file}: a recording needs the arrays names (k,), positions (n, k, 3), and time (n,) or rate; "
            f"missing: {', '.join(what for what in ('names', 'positions') if what not in arrays)}; "
            f"found: {', '.join(found) or 'nothing'}"
        )
    if "positions" not in arrays or ("poses" in arrays and "names" not in arrays):
        time = _time(file, arrays, len(np.atleast_1d(arrays["poses"])), options)
        return posed(file, options, arrays["poses"], arrays.get("trans"), time, "" if parted else "z")
    return _positions(file, options, arrays, _time(file, arrays, len(np.atleast_1d(arrays["positions"])), options))


def _positions(file: Path, options: ImportOptions, arrays: Mapping[str, Any], time: Any) -> Recording:
    """Return a recording of positions (n, k, 3), with names of the file, of a file beside it or recognized."""
    places = np.asarray(arrays["positions"])
    if places.ndim != 3 or places.shape[-1] != 3 or places.dtype.kind not in "fiu":
        raise FileFormatError(
            f"{file}: positions must be numbers of shape (n, k, 3); found {places.shape} of {places.dtype}"
        )
    require_at_most(places.size // 3, PLACES, "places (frames × points)", file)
    if places.dtype.kind != "f" or places.dtype.itemsize < 4:
        places = places.astype(np.float64)
    notes: list[str] = []
    up, by = _text(arrays, "up"), "as the file says"
    names = arrays["names"] if "names" in arrays else _names_beside(file)
    if names is None:
        skeleton = _recognized(file, places)
        names, by = load_names("joint_orders.yaml")["skeletons"][skeleton], f"as in {skeleton}"
        up = up or ("z" if skeleton == "holosoma's mocap" else "")
        notes.append(f"{len(names)} joints without names: taken as {skeleton}, whose arms these are")
    array = np.atleast_1d(np.asarray(names))
    if array.dtype.kind == "S":
        array = np.char.decode(array, "utf-8", "replace")
    if array.dtype.kind not in "US" or array.ndim != 1:
        raise FileFormatError(f"{file}: names must be text; found names of {array.dtype}, shape {array.shape}")
    if len(array) != places.shape[1]:
        raise FileFormatError(
            f"{file}: {len(array)} names do not fit positions of shape {places.shape}: one for each of the "
            f"{places.shape[1]} joints is needed"
        )
    unit, names = _text(arrays, "unit"), [str(name) for name in array.tolist()]
    return options.recording(file, names, places, time, unit, up, by, notes=notes)


def _names_beside(file: Path) -> Sequence[str] | None:
    """Return names from a file beside the recording: one a line, or a JSON list."""
    lines, listed = (file.with_suffix(ending) for ending in (".names.txt", ".names.json"))
    if lines.exists():
        text = decoded(read_whole(lines, (), SETTINGS_BYTES))
        return [line.strip() for line in text.splitlines() if line.strip()]
    if not listed.exists():
        return None
    try:
        names = json.loads(decoded(read_whole(listed, (), SETTINGS_BYTES)))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{listed}: not readable as JSON: {error}") from None
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise FileFormatError(f"{listed}: must hold a list of names")
    return names


def _recognized(file: Path, positions: Array) -> str:
    """Return the skeleton that joints without names are."""
    count = positions.shape[1]
    known: dict[str, list[str]] = load_names("joint_orders.yaml")["skeletons"]
    fitting = [name for name, joints in known.items() if len(joints) == count and _has_arms(joints, positions)]
    if len(fitting) != 1:
        listed = ", ".join(f"{len(joints)} ({name})" for name, joints in known.items())
        why = f"{' and '.join(fitting)} would both do" if fitting else f"known by its number of joints are {listed}"
        raise FileFormatError(
            f"{file}: {count} joints without names; write one name a line into '{file.stem}.names.txt' beside it "
            f"({why})"
        )
    return fitting[0]


@np.errstate(over="ignore", invalid="ignore")  # points out of reach make no arms
def _has_arms(joints: list[str], positions: Array) -> bool:
    """Return whether bones of the arms keep their lengths within 5 % and differ by at most 15 % between the sides."""
    sides = next(
        pair
        for pair in (("left_", "right_"), ("L_", "R_"), ("Left", "Right"))
        if any(name.startswith(pair[0]) for name in joints)
    )
    chains = (("shoulder", "elbow", "wrist"), ("Shoulder", "Elbow", "Wrist"), ("Arm", "ForeArm", "Hand"))
    chain = next(names for names in chains if sides[0] + names[1] in joints)
    lengths = []
    for side in sides:
        at = [positions[:, joints.index(side + name)].astype(np.float64) for name in chain]
        bones = np.stack([np.linalg.norm(b - a, axis=-1) for a, b in pairwise(at)])
        seen = np.isfinite(bones).all(axis=0)
        if not seen.any():
            return False
        median = np.median(bones[:, seen], axis=1)
        if (median <= 0).any() or (bones[:, seen].std(axis=1) > 0.05 * median).any():
            return False
        lengths.append(median)
    left, right = lengths
    return bool((np.abs(left - right) < 0.15 * np.maximum(left, right)).all())


def _joined(file: Path, *parts: Any) -> Any:
    """Return pose parameters (n, 66 or more) of root and body."""
    arrays = [np.asarray(part) for part in parts]
    if any(array.ndim < 2 or array.dtype.kind not in "fiu" or len(array) != len(arrays[0]) for array in arrays):
        shapes = " and ".join(str(array.shape) for array in arrays)
        raise FileFormatError(f"{file}: poses of root and body must be numbers (n, …) of equal n; found {shapes}")
    return np.concatenate([array.reshape(len(array), -1) for array in arrays], axis=1)


def _time(file: Path, arrays: dict[str, Any], count: int, options: ImportOptions) -> Any:
    """Return the times, from the rate where there are none; None where there is neither."""
    if "time" in arrays or "rate" not in arrays or options.rate is not None:
        return arrays.get("time")
    rate = np.asarray(arrays["rate"])
    if rate.size != 1 or rate.dtype.kind not in "fiu" or not (np.isfinite(rate).all() and rate.min() >= 1e-6):
        raise FileFormatError(f"{file}: a recording needs time (n,) [s], or rate, the frames per second; found {rate}")
    return np.arange(count) / float(rate.reshape(-1)[0])


def _text(arrays: Mapping[str, Any], name: str) -> str:
    value = np.asarray(arrays.get(name, ""))
    return str(value.reshape(-1)[0]) if value.size == 1 and value.dtype.kind in "US" else ""
