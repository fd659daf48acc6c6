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
from maniport.errors import some_of
from maniport.mocap.readers import ImportOptions, require_size
from maniport.mocap.readers.orders import recognized_order
from maniport.mocap.readers.text import LARGEST_ANGLE, decoded
from maniport.mocap.readers.times import FileTimes, rates_of
from maniport.mocap.recording import Recording
from maniport.mocap.roles import load_names
from maniport.util.files import array_names, load_arrays, read_npy
from maniport.util.input_limits import RECORDING_BYTES, SETTINGS_BYTES, existing_file, read_whole
from maniport.util.validation import Array

RATE = "rate "  # Prefix of the keys of frame rates, of which a file may have several
UNIT_TOLERANCE = 0.01  # of lengths of one in poses, which may be rounded to 16 bits


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
    arrays = _loaded(file, names)
    poses = _poses(arrays)
    if poses and not {"names", "positions"} <= arrays.keys():
        return _posed(file, options, arrays, poses)
    if "positions" not in arrays:
        missing = [key for key in ("names", "positions") if key not in arrays]
        raise ValueError(
            f"a recording needs the arrays names (k,), positions (n, k, 3), and time (n,) or rate; "
            f"missing: {', '.join(missing)}; found: {some_of(names)}"
        )
    return _points(file, options, arrays)


def _loaded(file: Path, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Return the arrays that are used, by what they hold; all rates of a file by their own names."""
    keys: dict[str, list[str]] = load_names("file_keys.yaml")["arrays"]
    rates = [key for key in keys["rate"] if key in names]
    chosen = {f"{RATE}{key}": key for key in rates}
    for content, spellings in keys.items():
        key = next((key for key in spellings if key in names), None)
        if key is not None and content != "rate":
            chosen[content] = key

    loaded = load_arrays(file, "recording", list(chosen.values()))
    arrays = {}
    for content, key in chosen.items():
        arrays[content] = np.atleast_1d(np.asarray(loaded[key]))
    return arrays


def _poses(arrays: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
    """Return pose parameters, in one array or in those of root and body; empty where one of them is missing."""
    if "poses" in arrays:
        return [arrays["poses"]]
    if {"root", "body"} <= arrays.keys():
        return [arrays["root"], arrays["body"]]
    return []


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
    warnings: list[str] = []
    names: list[object]
    if "names" in arrays:
        names = [_as_text(name) for name in arrays["names"].tolist()]
    elif names_file.exists():
        text = decoded(read_whole(names_file, (), SETTINGS_BYTES))
        names = [line.strip() for line in text.splitlines() if line.strip()]
    else:
        order = recognized_order(load_names("joint_orders.yaml")["skeletons"], positions)
        if not order.names:
            advice = f"write one name per line into '{names_file.name}' next to it"
            raise ValueError(f"{count} joints without names; {advice} ({order.text})")
        names = list(order.names)
        if order.is_assumed:
            warnings.append(order.text)
        else:
            notes.append(order.text)
    texts = [name for name in names if isinstance(name, str)]
    if len(names) != count or len(texts) != count:
        raise ValueError(
            f"names must be {count} texts, one for each point; found {len(names)}: {str(names)[:80]}"
        )
    times = _times(arrays, len(positions), options)
    return options.recording(file, texts, positions, times, unit, notes, warnings)


def _as_text(name: object) -> object:
    """Decode a text in bytes; other values stay."""
    if isinstance(name, bytes):
        return name.decode("utf-8", "replace")
    return name


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
    values = {}
    for key, value in arrays.items():
        if key.startswith(RATE):
            values[key.removeprefix(RATE)] = value
    rates, wrong_rates = rates_of(values)
    duration = arrays.get("duration", np.zeros(0))
    if (
        len(rates) > 1
        and duration.size == 1
        and duration.dtype.kind in "fiu"
        and duration.flat[0] > 0
    ):
        expected = count / float(duration.flat[0])
        rates = dict(sorted(rates.items(), key=lambda item: abs(np.log(item[1] / expected))))
    return FileTimes(clocks, rates=rates, wrong_rates=wrong_rates)


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
    if wrong or not count or root.shape[1:] != (3,):
        shapes = " and ".join(f"{part.shape} of {part.dtype}" for part in (*poses, root))
        raise ValueError(
            f"poses must be numbers of shape (n, 66 or more), and trans of shape (n, 3); found {shapes}"
        )
    angles = np.concatenate([_rotation_vectors(part) for part in poses], axis=1)
    if angles.shape[1] < 66:
        raise ValueError(
            f"poses must be rotation vectors of at least 22 joints, shape (n, 66 or more); found {angles.shape}"
        )
    require_size(count, 66 // 3)
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


def _rotation_vectors(poses: NDArray[Any]) -> Array:
    """Return rotation vectors [rad], shape (n, 3 joints), from vectors or from rotation matrices.

    Other parameters of rotations are numbers, too, and would be a wrong motion: they are errors.
    """
    count = len(poses)
    if poses.shape[-2:] == (3, 3) and poses.ndim in (3, 4):
        return _vectors_of_matrices(poses.reshape(count, -1, 3, 3))
    if poses.ndim > 3 or (poses.ndim == 3 and poses.shape[-1] != 3):
        raise ValueError(
            f"poses must be rotation vectors, shape (n, 3 joints) or (n, joints, 3), or rotation matrices, shape "
            f"(n, joints, 3, 3); found {poses.shape}"
        )
    vectors = poses.reshape(count, -1)
    sample = vectors[:: max(count // 1000, 1)].astype(np.float64)
    advice = "convert them to rotation vectors in radians, for example with scipy.spatial.transform.Rotation"
    for width, kind in ((4, "quaternions"), (3, "rotation matrices or their columns")):
        if vectors.shape[1] % width == 0 and _are_unit(sample, width):
            raise ValueError(
                f"poses look like {kind}, as all {width} numbers have length one; {advice}"
            )
    if vectors.shape[1] % 3 == 0:
        angles = np.linalg.norm(sample.reshape(len(sample), -1, 3), axis=-1)
        largest = float(np.median(np.nan_to_num(angles), axis=0).max(initial=0.0))
        if 4 * np.pi < largest < LARGEST_ANGLE:
            raise ValueError(
                f"poses look like degrees: a joint is turned by {largest:.4g} in half of the frames; {advice}"
            )
    return vectors


def _are_unit(numbers: Array, width: int) -> bool:
    """Whether all groups of numbers in a row have length one, as far as they are known."""
    lengths = np.linalg.norm(numbers.reshape(len(numbers), -1, width), axis=-1)
    known = lengths[np.isfinite(lengths)]
    return bool(len(known) and (np.abs(known - 1) < UNIT_TOLERANCE).all())


def _vectors_of_matrices(matrices: NDArray[Any]) -> Array:
    """Return the rotation vectors of matrices (n, joints, 3, 3); nan where one is not finite."""
    count = len(matrices)
    flat = matrices.reshape(-1, 3, 3).astype(np.float64)
    known = np.isfinite(flat).all(axis=(1, 2))
    products = flat[known] @ np.swapaxes(flat[known], 1, 2)
    has_unit_axes = np.abs(products - np.eye(3)).max(initial=0.0) < 3 * UNIT_TOLERANCE
    if not has_unit_axes or (np.linalg.det(flat[known]) < 0).any():
        raise ValueError("poses of shape (n, joints, 3, 3) must be rotation matrices")
    vectors = np.full((len(flat), 3), np.nan)
    vectors[known] = Rotation.from_matrix(flat[known]).as_rotvec()
    return vectors.reshape(count, -1)


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
