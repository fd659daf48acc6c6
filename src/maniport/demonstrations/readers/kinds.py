"""What kind of file a recording is: by what stands in it, and by its ending where that tells nothing."""

import os
from pathlib import Path

from maniport.demonstrations.readers.c3d_file import MARK
from maniport.demonstrations.readers.headed import BEGINNINGS
from maniport.demonstrations.readers.text import decoded
from maniport.errors import FileFormatError
from maniport.input_limits import RECORDING_BYTES, existing_file

HEAD = 4096
"""Bytes that are looked at."""

_THROUGH_BLENDER = "open it in Blender (File > Import) and write a BVH file (File > Export > Motion Capture)"
_AS_ARRAYS = "open it where it comes from and write np.savez('FILE.npz', names=..., positions=..., rate=...)"

FOREIGN: tuple[tuple[str, tuple[bytes, ...], tuple[str, ...], str], ...] = (
    ("FBX", (b"Kaydara FBX", b"; FBX"), (".fbx",), _THROUGH_BLENDER),
    ("glTF", (b"glTF",), (".gltf", ".glb", ".vrm"), _THROUGH_BLENDER),
    ("USD", (b"PXR-USDC", b"#usda"), (".usd", ".usda", ".usdc", ".usdz"), _THROUGH_BLENDER),
    ("COLLADA", (), (".dae",), _THROUGH_BLENDER),
    ("Blender's", (b"BLENDER",), (".blend",), "write a BVH file in Blender (File > Export > Motion Capture)"),
    ("ASF and AMC", (), (".asf", ".amc"), "take the same motion as BVH or C3D, which CMU's database has, too"),
    ("Motive's own", (), (".tak",), "export it as C3D or BVH from Motive"),
    ("Xsens' own", (), (".mvn",), "export it as MVNX, BVH or C3D from MVN Analyze"),
    ("packed with gzip", (b"\x1f\x8b",), (".gz",), "unpack it (gunzip FILE)"),
    ("Python's own (pickle)", (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"), (".pkl", ".pickle", ".pt", ".pth"),
     f"such files can run anything when they are opened: {_AS_ARRAYS}"),
    ("MATLAB's or HDF5", (b"MATLAB 5.0 MAT-file", b"\x89HDF"), (".mat", ".h5", ".hdf5"), _AS_ARRAYS),
    ("a robot's description", (), (".urdf", ".xacro", ".mjcf"),
     "a recording of a person is wanted here; the robot is given with --robot (robot=)"),
    ("a spreadsheet", (), (".xlsx", ".xls", ".ods"), "save it as CSV"),
    ("a video", (), (".mp4", ".mov", ".avi", ".mkv", ".webm"),
     "a program that finds the body in pictures comes first: MediaPipe (JSON), Pose2Sim or OpenCap (TRC)"),
)  # fmt: skip
"""What is not read: kind, first bytes, endings, and what to do."""


CONTAINERS = (".npz", ".json")
"""Content that may be many things, so that the ending is asked, too."""
FIRST_SIGN = 9
"""The first byte of a C3D file is below it, while that of a text is not."""


def kind_of(file: Path, endings: tuple[str, ...], own: tuple[str, ...], hint: str) -> str:
    """The ending that stands for what a file is."""
    suffix = file.suffix.lower()
    if not os.path.exists(file) or suffix in own:  # False of names that no file has
        return existing_file(file, endings, RECORDING_BYTES, hint).suffix.lower()
    existing_file(file, (), RECORDING_BYTES)
    with open(file, "rb") as stream:
        head = stream.read(HEAD)
    kind = _by_content(head)
    for name, starts, suffixes, advice in FOREIGN:
        if head.startswith(starts) or (suffix in suffixes and kind in (None, *CONTAINERS)):
            raise FileFormatError(f"{file}: files of this kind ({name}) are not read: {advice}")
    return kind or existing_file(file, endings, RECORDING_BYTES, hint).suffix.lower()


def _by_content(head: bytes) -> str | None:
    """The ending that belongs to what a file begins with, or None."""
    if head[:2] == b"PK":
        return ".npz"
    if head[:6] == b"\x93NUMPY":
        return ".npy"
    if len(head) > 1 and head[1] == MARK and 0 < head[0] < FIRST_SIGN:
        return ".c3d"
    text = decoded(head).lstrip()
    lines = [line.strip() for line in text.splitlines()]
    if "HIERARCHY" in lines[:20]:
        return ".bvh"
    if text.startswith("PathFileType"):
        return ".trc"
    for beginning, ending in BEGINNINGS.items():
        if text.startswith(beginning):
            return ending
    if any(line.lower() == "endheader" or line.lower().startswith("indegrees") for line in lines):
        return ".mot"
    if text.startswith("<"):
        return ".mvnx" if "<mvnx" in text else None
    return ".json" if text[:1] in ("{", "[") else None
