"""A slowly moving arm in every format of recordings, in few frames."""

import io
import json

import numpy as np

NAMES = ("RightUpperArm", "RightForeArm", "RightHand", "Pelvis", "Neck", "LeftUpperArm")
REST = np.array([[0, -0.2, 1.4], [0, -0.2, 1.1], [0.2, -0.2, 1.0], [0, 0, 1], [0, 0, 1.5], [0, 0.2, 1.4]])
PLACES = REST + 0.02 * np.sin(np.arange(5 * 18).reshape(5, 6, 3))
TIME = np.arange(5) / 50


def _cells(*numbers: float) -> list[str]:
    return [f"{number:.4f}" for number in numbers]


def trc() -> bytes:
    """OpenSim's table of points, one of them missing once."""
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits", "50\t50\t5\t6\tm",
        "Frame#\tTime\t" + "\t\t\t".join(NAMES), "\t\tX1\tY1\tZ1", "",
    ]  # fmt: skip
    lines += ["\t".join([str(i + 1), *_cells(TIME[i], *PLACES[i].ravel())]) for i in range(5)]
    lines[7] = "\t".join([*lines[7].split("\t")[:2], "", "", "", *lines[7].split("\t")[5:]])
    return "\n".join(lines).encode()


def mot(names: tuple[str, ...], degrees: str = "yes") -> bytes:
    """Joint angles."""
    lines = ["Coordinates", "version=1", "nRows=5", f"inDegrees={degrees}", "endheader", "time\t" + "\t".join(names)]
    lines += ["\t".join(_cells(time, *(20 + 5 * np.sin(np.arange(len(names)) + time)))) for time in TIME]
    return "\n".join(lines).encode()


def csv(long: bool = False) -> bytes:
    """A table of points in either layout."""
    if long:
        rows = [
            ",".join([f"{TIME[i]:.2f}", name, *_cells(*PLACES[i, j])]) for i in range(5) for j, name in enumerate(NAMES)
        ]
        return "\n".join(["time,name,x,y,z", *rows]).encode()
    head = ["time", *(f"{name}_{axis}" for name in NAMES for axis in "xyz"), "Neck_visibility"]
    rows = [",".join(_cells(TIME[i], *PLACES[i].ravel(), 0.2 * i)) for i in range(5)]
    return "\n".join([",".join(head), *rows]).encode()


def exports() -> list[bytes]:
    """Tables of Motive, Nexus and Qualisys Track Manager."""
    cells = [_cells(*places.ravel()) for places in PLACES]
    each = [",".join(f"{name},{name},{name}" for name in NAMES), ",".join(["X,Y,Z"] * 6), ",".join(["m,m,m"] * 6)]
    motive = ["Format Version,1.23,Length Units,Meters", ",Type," + each[0], ",Name," + each[0],
              ",," + ",".join(["Position"] * 18), "Frame,Time (Seconds)," + each[1]]  # fmt: skip
    motive += [",".join([str(i), f"{TIME[i]:.2f}", *row]) for i, row in enumerate(cells)]
    nexus = ["Trajectories", "50", ",," + each[0], "Frame,Sub Frame," + each[1], ",," + each[2]]
    nexus += [",".join([str(i), "0", *row]) for i, row in enumerate(cells)]
    qualisys = ["NO_OF_FRAMES\t5", "FREQUENCY\t50", "DATA_INCLUDED\t3D", "MARKER_NAMES\t" + "\t".join(NAMES)]
    qualisys += ["\t".join(f"{1000 * float(cell):.0f}" for cell in row) for row in cells]
    return ["\n".join(lines).encode() for lines in (motive, nexus, qualisys)]


def mvnx() -> bytes:
    """Xsens' XML."""
    segments = "".join(f'<segment label="{name}" id="{i}"/>' for i, name in enumerate(NAMES))
    numbers = [" ".join(_cells(*places.ravel())) for places in PLACES]
    frames = "".join(f'<frame time="{20 * i}" type="normal"><position>{text}</position></frame>'
                     for i, text in enumerate(numbers))  # fmt: skip
    return (f'<mvnx version="4"><subject frameRate="50"><segments>{segments}</segments>'
            f"<frames>{frames}</frames></subject></mvnx>").encode()  # fmt: skip


def keypoints() -> list[bytes]:
    """Keypoints by name, as MediaPipe has them, and OpenPose's."""
    by_name = [{"time": t, "joints": dict(zip(NAMES, places.tolist(), strict=True))}
               for t, places in zip(TIME, PLACES, strict=True)]  # fmt: skip
    arm = [{"x": 0.3 * (j > 12), "y": -0.3 * (j < 15), "z": 0.1 * (j > 14), "visibility": 0.9} for j in range(23)]
    hips = [{"x": 0.0, "y": 0.01 * i, "z": 0.0, "visibility": 0.4} for i in range(10)]
    pose = [{"timestamp_ms": 20 * i, "pose_world_landmarks": arm + hips} for i in range(4)]
    people = {"people": [{"pose_keypoints_3d": np.round(np.arange(100) / 30, 2).tolist()}]}
    contents = ({"fps": 50, "unit": "m", "frames": by_name}, pose, people)
    return [json.dumps(content).encode() for content in contents]


def npy() -> bytes:
    """An array of a skeleton that is known by its number of joints."""
    places = np.zeros((4, 22, 3)) + np.arange(22)[:, None] * 0.05
    for side, sign in ((16, 1), (17, -1)):
        for j in range(3):
            places[:, side + 2 * j] = [sign * (0.2 + 0.28 * j), 0, 1.4]
    stream = io.BytesIO()
    np.save(stream, places)
    return stream.getvalue()


def poses() -> bytes:
    """Pose parameters as AMASS writes them."""
    stream = io.BytesIO()
    np.savez(stream, poses=0.1 * np.sin(np.arange(5 * 66).reshape(5, 66)), trans=np.zeros((5, 3)), mocap_framerate=60.0)
    return stream.getvalue()
