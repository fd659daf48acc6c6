"""Extract the recordings of the tests from their originals.

The originals come with the wheel holosoma-retargeting 0.1.0 (``pip download --no-deps holosoma-retargeting==0.1.0``)
and with the Debian package assimp-testmodels (``apt-get download``, then ``dpkg-deb -x``), there in
``usr/share/assimp/models/BVH/``:

    python scripts/extract_test_recordings.py holosoma_retargeting-0.1.0-py3-none-any.whl 01_01.bvh 01_03.bvh

Every fourth frame is kept; nothing is smoothed or filled. All originals are recognised by their SHA-256.
"""

import argparse
import hashlib
import io
from pathlib import Path
from zipfile import ZipFile

import numpy as np

from extract_recordings import BVH_STEP, JOINTS, UNTURNED, extract_bvh

DATA = Path(__file__).parents[1] / "tests" / "mocap" / "data"

CLIMBS = "holosoma_retargeting/demo_data/climb/mocap_climb_seq_{0}/mocap_climb_seq_{0}_joint_positions_{1}.npy"
CLIPS = {
    "climb_0.npy": (
        0,
        "f900-3700",
        508,
        36,
        "0d10253c34f26148c40e96261033b7e5955bcd5d784b76a02be8847aa2b75d8d",
    ),
    "climb_1.npy": (
        1,
        "f0-2422",
        1724,
        36,
        "5ad287c1a0f288c615bc56032887fa8f21cf5d027d4d906001387db862750a7f",
    ),
    "climb_2.npy": (
        2,
        "f100-3110",
        512,
        36,
        "fb33fb51393fc1408876f91ef2dfd2a0e1944b148c54a275f9a5a0965dca253a",
    ),
    "climb.npy": (
        3,
        "f200-2600",
        81,
        90,
        "6c9f16cd72bd8e87b8b4d69b3d11370d56f5160af2882215baf45464d6bd0843",
    ),
    "climb_4.npy": (
        4,
        "f0-2303",
        1936,
        36,
        "503c423d5aeaff9805316a62c47ec1dd99f8cb5668fdc041510398e29d846984",
    ),
}
"""For each excerpt the number and the frames in the name of the clip, its first frame, its length, the clip's SHA-256.

They begin where, of 1.2 s, both wrists go far beside the trunk.
"""
NPY_STEP = 4
"""Every fourth frame."""

LEFT = ("LeftForeArm", "LeftHand", "LeftFingerBase", "LFingers")
BOTH = JOINTS[: JOINTS.index("LeftArm") + 1] + LEFT + JOINTS[JOINTS.index("RightShoulder") :]
"""Kept joints of CMU's skeleton: the spine and both arms."""
ENDS = ("LFingers", *(name for name in UNTURNED if name != "LeftArm"))
WALKS = {
    "cmu_01_01.bvh": (1445, "1d9ee909452ee62784306545cf1fcd634243db1173e0c90cecbed793e50361a8"),
    "cmu_01_03.bvh": (4177, "72d3f37de5af9adfc228dda72422cadb8cfc58d1cd8336076241ba115715c87c"),
}
"""For each excerpt its first frame and the SHA-256 of the original."""
BVH_FRAMES = 54


def main() -> None:
    """Read the arguments, check the originals, write all excerpts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("wheel", type=Path, help="holosoma_retargeting-0.1.0-py3-none-any.whl")
    parser.add_argument(
        "bvh", type=Path, nargs=2, help="01_01.bvh and 01_03.bvh from assimp-testmodels"
    )
    parser.add_argument(
        "--output", type=Path, default=DATA, help="folder to write to (default: that of the tests)"
    )
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    with ZipFile(arguments.wheel) as wheel:
        for name, (number, frames, start, count, digest) in CLIPS.items():
            original = wheel.read(CLIMBS.format(number, frames))
            _require(original, digest, name)
            np.save(
                arguments.output / name,
                np.load(io.BytesIO(original))[start:][: count * NPY_STEP : NPY_STEP],
            )
    for source, (name, (start, digest)) in zip(arguments.bvh, WALKS.items(), strict=True):
        _require(source.read_bytes(), digest, name)
        frames = slice(start, start + BVH_FRAMES * BVH_STEP, BVH_STEP)
        extract_bvh(source, arguments.output / name, frames, BOTH, ENDS)
    for name in (*CLIPS, *WALKS):
        print(f"{name}: {(arguments.output / name).stat().st_size} bytes")


def _require(original: bytes, digest: str, name: str) -> None:
    """Exit if an original is another file."""
    found = hashlib.sha256(original).hexdigest()
    if found != digest:
        raise SystemExit(
            f"the original of {name} is another file: SHA-256 {found} instead of {digest}"
        )


if __name__ == "__main__":
    main()
