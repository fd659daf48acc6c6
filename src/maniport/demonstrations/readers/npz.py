"""NPZ, named NumPy arrays: what `Recording.save` writes, joint positions of other programs, pose parameters."""

from pathlib import Path
from typing import Any

import numpy as np

from maniport.demonstrations.given import LEAST_RATE, Given
from maniport.demonstrations.readers.named import named_positions
from maniport.demonstrations.readers.smpl_pose import posed
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.files import array_names, load_arrays

KEYS = {
    "names": ("names", "joint_names", "joints_names", "keypoint_names", "marker_names", "labels"),
    "positions": ("positions", "joints", "joint_positions", "global_joint_positions", "joints3d", "keypoints3d",
                  "keypoints_3d", "keypoints", "markers", "points", "xyz"),
    "time": ("time", "times", "t", "timestamps"),
    "rate": ("rate", "fps", "mocap_framerate", "mocap_frame_rate", "frame_rate", "framerate"),
    "poses": ("poses",), "root": ("root_orient", "global_orient"), "body": ("pose_body", "body_pose"),
    "trans": ("trans", "transl"), "unit": ("unit", "units"), "up": ("up",),
}  # fmt: skip
"""What arrays are called: the first that is there counts."""


def read(file: Path, given: Given) -> Recording:
    """Read an ``.npz`` file; see `maniport.demonstrations.readers.read_recording`."""
    found = array_names(file, "recording")
    keys = {what: next((key for key in known if key in found), None) for what, known in KEYS.items()}
    wanted = [key for key in keys.values() if key]
    loaded = load_arrays(file, "recording", wanted)
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
        time = _time(file, arrays, len(np.atleast_1d(arrays["poses"])), given)
        return posed(file, given, arrays["poses"], arrays.get("trans"), time, "" if parted else "z")
    time = _time(file, arrays, len(np.atleast_1d(arrays["positions"])), given)
    return named_positions(
        file, given, arrays.get("names"), arrays["positions"], time, _text(arrays, "unit"), _text(arrays, "up")
    )


def _joined(file: Path, *parts: Any) -> Any:
    """Pose parameters (n, 66 or more) of root and body."""
    arrays = [np.asarray(part) for part in parts]
    if any(one.ndim < 2 or one.dtype.kind not in "fiu" or len(one) != len(arrays[0]) for one in arrays):
        shapes = " and ".join(str(one.shape) for one in arrays)
        raise FileFormatError(f"{file}: poses of root and body must be numbers (n, …) of equal n; found {shapes}")
    return np.concatenate([one.reshape(len(one), -1) for one in arrays], axis=1)


def _time(file: Path, arrays: dict[str, Any], count: int, given: Given) -> Any:
    """The times, from the rate where there are none; None where there is neither."""
    if "time" in arrays or "rate" not in arrays or given.rate is not None:
        return arrays.get("time")
    rate = np.asarray(arrays["rate"])
    if rate.size != 1 or rate.dtype.kind not in "fiu" or not (np.isfinite(rate).all() and rate.min() >= LEAST_RATE):
        raise FileFormatError(f"{file}: a recording needs time (n,) [s], or rate, the frames per second; found {rate}")
    return np.arange(count) / float(rate.reshape(-1)[0])


def _text(arrays: dict[str, Any], name: str) -> str:
    value = np.asarray(arrays.get(name, ""))
    return str(value.reshape(-1)[0]) if value.size == 1 and value.dtype.kind in "US" else ""
