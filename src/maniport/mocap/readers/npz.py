"""NPZ and NPY, NumPy arrays: files of `Recording.save`, joint positions of other programs, pose parameters of SMPL.

Arrays without names are recognized as a skeleton by the number of their joints, but only if its arms are arms in these
positions.

Pose parameters of the SMPL family (https://amass.is.tue.mpg.de) are read without the body model, as its license is
restrictive: bones of a T-pose, arms along x, y up, z forward, are rotated by the parameters. `fit_arm` compares
directions only; in the mean body of the model they are within a few degrees of these. Lengths of the arm are those of
`maniport.arms.human`; those of the trunk are fractions of height by Drillis and Contini (1966), as in D. A. Winter,
"Biomechanics and Motor Control of Human Movement", 4th edition, 2009, figure 4.1.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from maniport.arms.human import FRACTIONS
from maniport.errors import argument, some_of
from maniport.mocap.readers import ImportOptions, require_size
from maniport.mocap.readers.orders import recognized_order
from maniport.mocap.readers.text import LARGEST_ANGLE, decoded
from maniport.mocap.readers.times import FileTimes
from maniport.mocap.recording import Recording
from maniport.mocap.roles import load_names
from maniport.util.files import array_names, load_arrays, read_npy
from maniport.util.input_limits import RECORDING_BYTES, SETTINGS_BYTES, existing_file, read_whole
from maniport.util.validation import Array

RATE = "rate "  # Prefix of the keys of frame rates, of which a file may have several


def read(file: Path, options: ImportOptions) -> Recording:
    """Read an ``.npz`` or ``.npy`` file; see `maniport.mocap.readers.read_recording`."""
    size = existing_file(file, (), RECORDING_BYTES).stat().st_size
    with open(file, "rb") as stream:
        if stream.read(6) == b"\x93NUMPY" or file.suffix.lower() == ".npy":
            stream.seek(0)
            try:
                positions = read_npy(stream, size)
            except Exception as error:  # noqa: BLE001 - NumPy raises errors of many types on damaged files
                raise ValueError(f"not a readable .npy file: {error}") from None
            return _points(file, options, {"positions": np.asarray(positions)})
    names = array_names(file, "recording")
    keys: dict[str, list[str]] = load_names("file_keys.yaml")["arrays"]
    chosen = {}
    for what, own in keys.items():
        chosen[what] = next((key for key in own if key in names), None)
    rates = [key for key in keys["rate"] if key in names]
    loaded = load_arrays(file, "recording", [*rates, *(key for key in chosen.values() if key)])
    arrays = {what: np.atleast_1d(np.asarray(loaded[key])) for what, key in chosen.items() if key}
    arrays.pop("rate", None)
    arrays |= {f"{RATE}{key}": np.atleast_1d(np.asarray(loaded[key])) for key in rates}
    poses = [arrays[key] for key in ("poses", "root", "body") if key in arrays][
        : 1 if "poses" in arrays else 2
    ]
    if ("poses" in arrays or len(poses) == 2) and not {"names", "positions"} <= arrays.keys():
        return _posed(file, options, arrays, poses)
    if "positions" not in arrays:
        raise ValueError(
            f"a recording needs the arrays names (k,), positions (n, k, 3), and time (n,) or rate; "
            f"missing: {', '.join(what for what in ('names', 'positions') if what not in arrays)}; "
            f"found: {some_of(names)}"
        )
    return _points(file, options, arrays)


def _points(file: Path, options: ImportOptions, arrays: Mapping[str, NDArray[Any]]) -> Recording:
    """Return a recording of positions (n, k, 3), with names of the file, of a file next to it or recognized."""
    positions = arrays["positions"]
    if positions.ndim != 3 or positions.shape[-1] != 3 or positions.dtype.kind not in "fiu":
        raise ValueError(
            f"positions must be numbers of shape (n, k, 3); found {positions.shape} of {positions.dtype}"
        )
    require_size(*positions.shape[:2])
    count = positions.shape[1]
    names_file = file.with_suffix(".names.txt")
    unit = next(map(str, arrays.get("unit", np.array("")).flat), "")
    notes: list[str] = []
    if "names" in arrays:
        names = arrays["names"].tolist()
    else:
        names = None
    if names is None and names_file.exists():
        names = list(
            filter(
                None,
                map(str.strip, decoded(read_whole(names_file, (), SETTINGS_BYTES)).splitlines()),
            )
        )
    warnings: list[str] = []
    if names is None:
        order = recognized_order(load_names("joint_orders.yaml")["skeletons"], positions)
        if not order.names:
            advice = f"write one name per line into '{names_file.name}' next to it"
            raise ValueError(f"{count} joints without names; {advice} ({order.text})")
        names = list(order.names)
        (warnings if order.is_assumed else notes).append(order.text)
    names = [name.decode("utf-8", "replace") if isinstance(name, bytes) else name for name in names]
    if len(names) != count or not all(isinstance(name, str) for name in names):
        raise ValueError(
            f"names must be {count} texts, one for each point; found {len(names)}: {str(names)[:80]}"
        )
    times = _times(arrays, len(positions), options)
    return options.recording(file, names, positions, times, unit, notes, warnings)


def _times(arrays: Mapping[str, NDArray[Any]], count: int, options: ImportOptions) -> FileTimes:
    """Return the times and the rates of the file, first the rate that its duration supports."""
    clocks = {}
    if "time" in arrays:
        clock = arrays["time"]
        # a column
        if clock.size == max(clock.shape):
            clocks["time"] = clock.reshape(-1)
        else:
            clocks["time"] = clock
    rates = {}
    wrong = None
    for key, rate in arrays.items():
        if not key.startswith(RATE):
            continue
        is_number = rate.size == 1 and rate.dtype.kind in "fiu"
        if is_number and np.isfinite(rate).all() and rate.min() >= 1e-6:
            rates[key.removeprefix(RATE)] = float(rate.flat[0])
        else:
            wrong = rate
    if wrong is not None and not (rates or clocks or options.rate):
        raise ValueError(
            f"a recording needs time (n,) [s], or rate in frames per second; found {wrong}; "
            f"{argument('rate')} sets it"
        )
    duration = arrays.get("duration", np.zeros(0))
    if (
        len(rates) > 1
        and duration.size == 1
        and duration.dtype.kind in "fiu"
        and duration.flat[0] > 0
    ):
        expected = count / float(duration.flat[0])
        rates = dict(sorted(rates.items(), key=lambda item: abs(np.log(item[1] / expected))))
    return FileTimes(clocks, rates=rates)


def _posed(
    file: Path, options: ImportOptions, arrays: Mapping[str, Any], poses: Sequence[Array]
) -> Recording:
    """Return the joints of a body from its pose parameters, in one array or in those of root and body."""
    # [m]
    count = len(poses[0])
    body_height = 1.75
    root = arrays.get("trans", np.zeros((count, 3)))
    wrong = any(
        part.ndim < 2 or part.dtype.kind not in "fiu" or len(part) != count
        for part in (*poses, root)
    )
    if wrong or not count or sum(part[0].size for part in poses) < 66 or root.shape[1:] != (3,):
        shapes = " and ".join(f"{part.shape} of {part.dtype}" for part in (*poses, root))
        raise ValueError(
            f"poses must be numbers of shape (n, 66 or more), and trans of shape (n, 3); found {shapes}"
        )
    require_size(count, 66 // 3)
    angles = np.concatenate([part.reshape(count, -1) for part in poses], axis=1)
    bones = _bones(body_height)
    parts = [slice(first, first + 20_000) for first in range(0, count, 20_000)]  # limits the memory
    positions = np.concatenate([_joints(bones, angles[part, :66], root[part]) for part in parts])
    lengths = f"lengths of a person of {body_height} m"
    notes = [
        f"pose parameters without the body model: directions of bones from a T-pose, {lengths}"
    ]
    return options.recording(
        file, ["pelvis", *bones], positions, _times(arrays, count, options), "m", notes
    )


def _bones(body_height: float) -> dict[str, tuple[str, Array]]:
    """Return the parent of each joint and its position there [m], x to the left, y up, z forward."""
    shares = {}
    parent = "pelvis"
    for joint, share in {
        "spine1": 0.06,
        "spine2": 0.07,
        "spine3": 0.03,
        "neck": 0.14,
        "head": 0.05,
    }.items():
        shares[joint] = (parent, [0.0, share, 0.0])
        parent = joint
    arm = {
        "shoulder": 0.099,
        "elbow": FRACTIONS["upper arm"],
        "wrist": FRACTIONS["forearm"],
        "hand": FRACTIONS["hand"],
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        parent = f"{side}_collar"
        shares[parent] = "spine3", [sign * 0.03, 0.128, 0.0]
        for joint, share in arm.items():
            shares[f"{side}_{joint}"] = parent, [sign * share, 0.0, 0.0]
            parent = f"{side}_{joint}"
    return {
        joint: (parent, body_height * np.array(share)) for joint, (parent, share) in shares.items()
    }


def _joints(bones: dict[str, tuple[str, Array]], angles: Array, root: Array) -> Array:
    """Return the positions of the joints [m], shape (n, joints, 3); nan where angles are too large."""
    with np.errstate(over="ignore"):  # of wider floating-point types
        vectors = angles.astype(np.float64)
        points = {"pelvis": root.astype(np.float64)}
    lost = np.asarray(~(np.abs(vectors) < LARGEST_ANGLE).all(axis=1))
    vectors[lost] = 0.0
    order = load_names("joint_orders.yaml")["skeletons"]["SMPL body"]
    rotations = {"pelvis": Rotation.from_rotvec(vectors[:, :3])}
    for joint, (parent, offset) in bones.items():
        points[joint] = points[parent] + rotations[parent].apply(offset)
        if joint in order:
            first = 3 * order.index(joint)
            rotations[joint] = rotations[parent] * Rotation.from_rotvec(
                vectors[:, first : first + 3]
            )
    positions = np.stack(list(points.values()), axis=1)
    positions[lost] = np.nan
    return positions
