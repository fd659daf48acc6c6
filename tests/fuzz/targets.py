"""Formats that people bring: files to begin with, and what reads and uses them."""

import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import format_files
from dialect_files import POINTS, SKELETONS, mirrored, motion, write_bvh
from fuzz.c3d_writer import Writer
from fuzz.mesh_examples import GOOD, stl
from fuzz.robot_examples import MJCF, SRDF, URDF, WITH_MESHES
from maniport.arms import Arm, load_arm
from maniport.arms.collisions import read_boxes
from maniport.arms.collisions.obstacles import disabled_pairs
from maniport.arms.human import JOINTS
from maniport.arms.meshes.mesh_files import load_mesh
from maniport.live.transport import read_frame
from maniport.mocap import read_recording, shipped_recording
from maniport.mocap.readers.c3d import DEC, MIPS
from maniport.mocap.readers.mot import RAJAGOPAL
from maniport.mocap.roles import load_names
from maniport.motion.motion_limits import MotionLimits
from maniport.transfer import load_adapter
from maniport.util.files import load_ellipsoids, load_path, save_ellipsoids, save_path


@dataclass(frozen=True)
class Target:
    """A format: suffix of its files, some of them, and what reads one."""

    suffix: str
    seeds: Callable[[], list[bytes]]
    read: Callable[[Path], Any]


@cache
def panda() -> Arm:
    return load_arm("panda")


@cache
def ellipsoids(n: int = 12) -> np.ndarray:
    return panda().manipulability(panda().sample(n, random_state=0))


def _read_robot(path: Path) -> Arm:
    if not (path.parent / "boom.stl").exists():
        (path.parent / "boom.stl").write_bytes(stl())
    arm = load_arm(path)
    q = np.stack([arm.lower, arm.upper])
    require_finite(
        arm.forward(q), arm.manipulability(q), *(surface.points for surface in arm.surfaces())
    )
    return arm


def _read_recording(path: Path, unit: str | None = "mm", rate: float | None = None) -> Any:
    recording = read_recording(path, unit=unit, rate=rate)
    require_finite(recording.time)
    return recording


def _read_metres(path: Path) -> Any:
    return _read_recording(path, None)


def _read_adapter(path: Path) -> Any:
    adapter = load_adapter(path)
    images = adapter.transform(ellipsoids())
    require_finite(images)
    if np.linalg.eigvalsh(images).min() <= 0:
        raise AssertionError("images that are not positive-definite")
    return adapter


def _read_frames(path: Path) -> None:
    names = ("shoulder", "elbow", "wrist")
    frames = [read_frame(line, names) for line in path.read_bytes().splitlines()]
    for frame in frames:
        if frame is not None:
            require_finite(frame.t, np.nan_to_num(frame.points, posinf=np.nan, neginf=np.nan))


def require_finite(*arrays: Any) -> None:
    for array in arrays:
        if not np.all(np.isfinite(array)):
            raise AssertionError("a result that is not finite")


def _saved(write: Callable[[Path], Any]) -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.npz"
        write(path)
        return path.read_bytes()


def _adapters() -> list[bytes]:
    golden = Path(__file__).parents[1] / "transfer" / "golden"
    return [path.read_bytes() for path in sorted(golden.glob("*.npz")) if "images" not in path.name]


def _recordings() -> list[bytes]:
    names = np.array(["shoulder", "elbow", "wrist"])
    positions = 0.05 * np.arange(45.0).reshape(5, 3, 3)
    arrays = _saved(
        lambda path: np.savez(path, names=names, positions=positions, rate=30.0, unit="m")
    )
    return [arrays, _saved(read_recording("freeform").crop(0, 0.3).save)]


def _written(
    *writers: Callable[[Path, Any], Any], names: str = "MVNX"
) -> Callable[[], list[bytes]]:
    """Return a maker of files in which some writers write a short motion."""

    def seeds() -> list[bytes]:
        recording = motion(n=5).recording(mirrored(POINTS[names]))
        return [_saved(lambda path, write=write: write(path, recording)) for write in writers]

    return seeds


def _angles(path: Path, names: tuple[str, ...], degrees: bool) -> None:
    angles = np.radians(20 + 5 * np.sin(np.arange(5 * len(names)))).reshape(5, -1)
    format_files.write_mot(path, np.arange(5) / 50, angles, names, degrees)


def _keypoints(path: Path, recording: Any) -> None:
    order = load_names("joint_orders.yaml")["by_count"][33]
    frames = format_files.landmarks(recording, order, format_files.DOWN, format_files.HIPS)
    format_files.write_json(path, frames)


def _keypoints_by_name(path: Path, recording: Any) -> None:
    frames = [
        {"time": time, "joints": dict(zip(recording.names, places.tolist(), strict=True))}
        for time, places in zip(recording.time, recording.positions, strict=True)
    ]
    format_files.write_json(path, {"fps": 50, "unit": "m", "frames": frames})


def _archive(path: Path) -> None:
    with TemporaryDirectory() as folder, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        inner = Path(folder) / "walk.bvh"
        write_bvh(inner, SKELETONS["LAFAN1"], motion(n=5))
        file.write(inner, inner.name)


def _people(path: Path, recording: Any) -> None:
    format_files.write_json(
        path, {"people": [{"pose_keypoints_3d": (np.arange(100) / 30).round(2).tolist()}]}
    )


def _skeleton(path: Path) -> None:
    places = np.zeros((4, 22, 3)) + np.arange(22)[:, None] * 0.05
    for side, sign in ((16, 1), (17, -1)):
        for j in range(3):
            places[:, side + 2 * j] = [sign * (0.2 + 0.28 * j), 0, 1.4]
    with open(path, "wb") as stream:
        np.save(stream, places)


def _meshes(suffix: str) -> Target:
    seeds = [content for name, content in GOOD.items() if name.endswith(suffix)]
    encoded = [content if isinstance(content, bytes) else content.encode() for content in seeds]
    return Target(suffix, lambda: encoded, load_mesh)


TARGETS = {
    "bvh": Target(
        ".bvh",
        lambda: [_saved(lambda p: write_bvh(p, SKELETONS["LAFAN1"], motion(n=5)))],
        _read_metres,
    ),
    "zip": Target(".zip", lambda: [_saved(_archive)], _read_metres),
    "c3d": Target(
        ".c3d",
        lambda: [
            Writer().content(),
            Writer(integer=True, analog=3).content(),
            Writer(DEC).content(),
            Writer(MIPS, True).content(),
            shipped_recording("freeform").read_bytes()[:20_000],
        ],
        _read_recording,
    ),
    "trc": Target(".trc", _written(format_files.write_trc), _read_metres),
    "mot": Target(
        ".mot",
        lambda: [
            _saved(lambda path: _angles(path, JOINTS, True)),
            _saved(lambda path: _angles(path, tuple(f"{name}_l" for name in RAJAGOPAL), False)),
        ],
        _read_metres,
    ),
    "csv": Target(
        ".csv",
        _written(format_files.write_csv, partial(format_files.write_csv, long=True)),
        _read_metres,
    ),
    "exports": Target(
        ".csv",
        _written(format_files.write_motive, format_files.write_nexus, format_files.write_qualisys),
        _read_metres,
    ),
    "mvnx": Target(".mvnx", _written(format_files.write_mvnx), _read_metres),
    "keypoints": Target(
        ".json", _written(_keypoints, _keypoints_by_name, _people, names="MediaPipe"), _read_metres
    ),
    "npy": Target(
        ".npy", lambda: [_saved(_skeleton)], lambda path: _read_recording(path, None, 50.0)
    ),
    "poses": Target(
        ".npz",
        lambda: [_saved(lambda p: np.savez(p, **format_files.amass(motion(n=5))))],
        _read_metres,
    ),
    "urdf": Target(".urdf", lambda: [URDF.encode(), WITH_MESHES.encode()], _read_robot),
    "mjcf": Target(".xml", lambda: [MJCF.encode()], _read_robot),
    **{
        suffix[1:]: _meshes(suffix)
        for suffix in (".stl", ".obj", ".ply", ".off", ".dae", ".gltf", ".glb")
    },
    "ellipsoids": Target(
        ".npz",
        lambda: [_saved(lambda path: save_ellipsoids(path, ellipsoids(), np.arange(12.0)))],
        load_ellipsoids,
    ),
    "path": Target(
        ".npz", lambda: [_saved(lambda path: save_path(path, np.eye(3), np.arange(3.0)))], load_path
    ),
    "recording": Target(".npz", _recordings, _read_metres),
    "adapter": Target(".npz", _adapters, _read_adapter),
    "limits": Target(
        ".yaml",
        lambda: [
            b"default: {velocity: 1.5, jerk: 1e3}\njoints:\n  panda_joint1: {jerk: 300, lower: -1, upper: 1.5}\n"
            b"  panda_joint2:\n    velocity: 2\n    acceleration: 3.5\n"
        ],
        lambda path: MotionLimits.of(panda(), path),
    ),
    "boxes": Target(
        ".yaml",
        lambda: [
            b"obstacles:\n  shelf: {center: [0.5, 0.2, 0.4], size: [0.3, 0.6, 0.02]}\n"
            b"  crate: {center: [0.4, -0.3, 0.1], size: [0.2, 0.3, 0.2], yaw: 0.5}\n"
        ],
        read_boxes,
    ),
    "frames": Target(
        ".jsonl",
        lambda: [
            b'{"t": 0.02, "points": {"shoulder": [0.1, 0.2, 1.4], "elbow": null, "wrist": [0.4, -0.2, 1.1]}}\n{}',
            b'{"t": 0.04, "points": [[1, 2, 3], null, [-4e2, 5, 6.5]]}',
        ],
        _read_frames,
    ),
    "srdf": Target(".srdf", lambda: [SRDF.encode()], lambda path: disabled_pairs(path, panda())),
}
"""What ``make fuzz`` tries, by name."""
