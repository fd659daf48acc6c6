"""Extract the three bundled recordings from two originals.

The originals come with two Debian packages (``apt-get download``, then ``dpkg-deb -x``):

- ``01_03.bvh`` from assimp-testmodels, ``usr/share/assimp/models/BVH/``;
- ``nick_freeform_001.c3d`` from dart-doc, ``usr/share/doc/dart/data/c3d/``.

    python scripts/extract_recordings.py 01_03.bvh nick_freeform_001.c3d

The trunk and the right arm are kept, of the second original both arms, too, at a lower frame rate; nothing is smoothed
or filled. Both originals are recognised by their SHA-256. Needs the packages ezc3d and pybvh.
"""

import argparse
import hashlib
from pathlib import Path

import ezc3d
import numpy as np
import pybvh

DATA = Path(__file__).parents[1] / "src" / "maniport" / "mocap" / "data"
SHA256 = {
    "bvh": "72d3f37de5af9adfc228dda72422cadb8cfc58d1cd8336076241ba115715c87c",
    "c3d": "071a483aae9ef3d6c41061de65236a9d54ab50c10fcd0cbbf9c4720580e7fae6",
}

JOINTS = (
    "Hips",
    "LowerBack",
    "Spine",
    "Spine1",
    "Neck",
    "LeftShoulder",
    "LeftArm",
    "RightShoulder",
    "RightArm",
    "RightForeArm",
    "RightHand",
    "RightFingerBase",
    "RFingers",
)
"""Kept joints: the spine, the left shoulder for the width of the trunk, the right arm."""
UNTURNED = ("Neck", "LeftArm", "RFingers")
"""Joints whose position alone is kept: their rotation moves no kept joint and is set to zero."""
BVH_STEP = 4
"""Every fourth frame: 120 becomes 30 Hz."""

MARKERS = (
    "C7",
    "T10",
    "CLAV",
    "STRN",
    "LFSH",
    "LBSH",
    "RFSH",
    "RBSH",
    "RELB",
    "RIEL",
    "ROWR",
    "RIWR",
    "RIHAND",
    "ROHAND",
)
LEFT_MARKERS = ("LELB", "LIEL", "LOWR", "LIWR", "LIHAND", "LOHAND")
EXCHANGED = ("LIWR", "LOHAND"), 195
"""Two labels that are exchanged in the first frames of the original, and the number of these frames. Evidence: LIWR is
there 61 mm from LOWR and 314 mm from LELB, later 45 and 251 mm, as LOHAND is before."""
C3D_STEP = 3
"""Every third frame: 120 becomes 40 Hz."""


def main() -> None:
    """Read the arguments, check the originals, write the extracts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "bvh", type=Path, help="01_03.bvh from the Debian package assimp-testmodels"
    )
    parser.add_argument(
        "c3d", type=Path, help="nick_freeform_001.c3d from the Debian package dart-doc"
    )
    parser.add_argument(
        "--output", type=Path, default=DATA, help="folder to write to (default: the package's data)"
    )
    arguments = parser.parse_args()
    for kind in ("bvh", "c3d"):
        found = hashlib.sha256(getattr(arguments, kind).read_bytes()).hexdigest()
        if found != SHA256[kind]:
            parser.error(
                f"{getattr(arguments, kind)} is another file: SHA-256 {found} instead of {SHA256[kind]}"
            )
    arguments.output.mkdir(parents=True, exist_ok=True)
    later = slice(1, None, BVH_STEP)  # the first frame is an added T-pose
    extract_bvh(arguments.bvh, arguments.output / "ladder.bvh", later)
    extract_c3d(arguments.c3d, arguments.output / "freeform.c3d")
    extract_c3d(arguments.c3d, arguments.output / "both_arms.c3d", MARKERS + LEFT_MARKERS)
    for name in ("ladder.bvh", "freeform.c3d", "both_arms.c3d"):
        file = arguments.output / name
        print(
            f"{name}: {file.stat().st_size} bytes, SHA-256 {hashlib.sha256(file.read_bytes()).hexdigest()}"
        )


def extract_bvh(
    source: Path,
    target: Path,
    frames: slice,
    joints: tuple[str, ...] = JOINTS,
    unturned: tuple[str, ...] = UNTURNED,
) -> None:
    """Keep joints in the order of their hierarchy, with angles rounded to 0.01 degrees."""
    skeleton = pybvh.read_bvh_file(source, world_up="+y")
    columns = [skeleton.root_pos[frames]]
    for name in joints:
        angles = np.rad2deg(skeleton.joint_angles[frames, skeleton.joint_index[name]])
        columns.append(np.zeros_like(angles) if name in unturned else angles)
    motion = np.concatenate(columns, axis=1)
    lines = ["HIERARCHY", *_hierarchy(skeleton.root, 0, joints), "MOTION", f"Frames: {len(motion)}"]
    lines.append(f"Frame Time: {skeleton.frame_time * BVH_STEP:.7f}")
    lines += [
        " ".join(_short(value, 3 if i < 3 else 2) for i, value in enumerate(row)) for row in motion
    ]
    target.write_text("\n".join(lines) + "\n")


def _hierarchy(node: object, depth: int, joints: tuple[str, ...]) -> list[str]:
    """Write a joint with its kept descendants; without any, the next joint becomes the end site."""
    tab = " " * depth
    inner = " " * (depth + 1)
    rotations = " ".join(f"{axis}rotation" for axis in node.rot_channels)
    channels = f"3 {rotations}" if depth else f"6 Xposition Yposition Zposition {rotations}"
    kept = [child for child in node.children if child.name in joints]
    lines = [f"{tab}{'JOINT' if depth else 'ROOT'} {node.name}", f"{tab}{{"]
    lines += [f"{inner}OFFSET {_vector(node.offset)}", f"{inner}CHANNELS {channels}"]
    for child in kept:
        lines += _hierarchy(child, depth + 1, joints)
    if not kept:
        lines += [
            f"{inner}End Site",
            f"{inner}{{",
            f"{inner} OFFSET {_vector(node.children[0].offset)}",
            f"{inner}}}",
        ]
    return [*lines, f"{tab}}}"]


def _vector(values: np.ndarray) -> str:
    return " ".join(_short(value, 5) for value in values)


def _short(value: float, decimals: int) -> str:
    """Write a number without trailing zeros."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text


def extract_c3d(source: Path, target: Path, markers: tuple[str, ...] = MARKERS) -> None:
    """Keep some markers; missing points remain zeros with a residual of -1."""
    original = ezc3d.c3d(str(source))
    labels = original["parameters"]["POINT"]["LABELS"]["value"]
    index = {
        name: next(i for i, one in enumerate(labels) if one.endswith(f":{name}"))
        for name in markers
    }
    points = original["data"]["points"]
    residuals = original["data"]["meta_points"]["residuals"]
    exchanged, count = EXCHANGED
    if set(exchanged) <= index.keys():
        pair = [index[name] for name in exchanged]
        for tracks in (points, residuals):
            tracks[:, pair, :count] = tracks[:, pair[::-1], :count]
    kept = list(index.values())
    points = points[:, kept, ::C3D_STEP]
    residuals = residuals[:, kept, ::C3D_STEP]
    extract = ezc3d.c3d()
    point = extract["parameters"]["POINT"]
    point["RATE"]["value"] = [original["parameters"]["POINT"]["RATE"]["value"][0] / C3D_STEP]
    point["LABELS"]["value"] = [labels[i] for i in kept]
    point["UNITS"]["value"] = ["mm"]
    extract["data"]["points"] = points
    extract["data"]["meta_points"]["residuals"] = residuals
    extract.write(str(target))


if __name__ == "__main__":
    main()
