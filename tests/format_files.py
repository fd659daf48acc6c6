"""Small files of every format of points, of joint angles and of poses, from what they shall hold."""

import json
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from dialect_files import onto

DOWN = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
"""From x forward, y to the left, z up to x to the right, y down, z forward, as MediaPipe has it."""
HIPS = ("left_hip", "right_hip")
"""Where MediaPipe's space begins: in the middle of them."""
SAUL = (
    "elv_angle",
    "shoulder_elv",
    "shoulder_rot",
    "elbow_flexion",
    "pro_sup",
    "deviation",
    "flexion",
)


def _cell(x, digits=6):
    return "" if np.isnan(x) else f"{x:.{digits}f}"


def _written(path, lines, end="\n"):
    path.write_bytes("".join(line + end for line in lines).encode())
    return path


def write_trc(path, recording, unit="m", scale=1.0):
    """A table as OpenSim writes it; what is missing stays empty."""
    n, k = recording.positions.shape[:2]
    rate = f"{recording.rate:.2f}"
    names = "".join(f"{name}\t\t\t" for name in recording.names)
    axes = "\t".join(f"{axis}{i + 1}" for i in range(k) for axis in "XYZ")
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{n}\t{k}\t{unit}\t{rate}\t1\t{n}",
        f"Frame#\tTime\t{names}",
        f"\t\t{axes}",
        "",
    ]
    for i, (time, places) in enumerate(zip(recording.time, recording.positions, strict=True)):
        cells = [_cell(x / scale) for x in places.reshape(-1)]
        lines.append("\t".join([str(i + 1), f"{time:.6f}", *cells]))
    return _written(path, lines)


def write_mot(path, time, angles, names, degrees=True):
    """Joint angles [rad] as OpenSim writes them."""
    table = np.column_stack([time, np.degrees(angles) if degrees else angles])
    head = ["Coordinates", "version=1", f"nRows={len(table)}", f"nColumns={table.shape[1]}"]
    head += [
        f"inDegrees={'yes' if degrees else 'no'}",
        "",
        "endheader",
        "\t".join(["time", *names]),
    ]
    rows = ["\t".join(f"{x:.8f}" for x in row) for row in table]
    return _written(path, [*head, *rows])


def write_csv(path, recording, long=False, dot=False):
    """A row for each frame, or for each point of each frame."""
    sign = "." if dot else "_"
    if long:
        lines = ["time,name,x,y,z"]
        for time, places in zip(recording.time, recording.positions, strict=True):
            lines += [
                f"{time:.6f},{name},{','.join(map(_cell, place))}"
                for name, place in zip(recording.names, places, strict=True)
            ]
    else:
        lines = [
            ",".join(
                ["time", *(f"{name}{sign}{axis}" for name in recording.names for axis in "xyz")]
            )
        ]
        lines += [
            f"{time:.6f}," + ",".join(map(_cell, places.reshape(-1)))
            for time, places in zip(recording.time, recording.positions, strict=True)
        ]
    return _written(path, lines)


def write_motive(path, recording, solved=True):
    """Motive's CSV: y up, millimetres, markers; an angle of a rigid body and what its model expects, where wanted."""
    names = [f"Actor:{name}" for name in recording.names]
    kinds = [(name, "Marker", "Position") for name in names]
    if solved:
        kinds = [
            ("Bat", "Rigid Body", "Rotation"),
            *((name, "Rigid Body Marker", "Position") for name in names),
            *kinds,
        ]
    lines = [
        f"Format Version,1.23,Take Name,A take,Capture Frame Rate,{recording.rate:.6f},Length Units,Millimeters",
        "",
        ",Type,," + ",".join(",".join([kind] * 3) for _, kind, _ in kinds),
        ",Name,," + ",".join(",".join([f'"{name}"'] * 3) for name, _, _ in kinds),
        ",ID,," + ",".join("1,1,1" for _ in kinds),
        ",,," + ",".join(",".join([what] * 3) for *_, what in kinds),
        "Frame,Time (Seconds),TimeCode" + ",X,Y,Z" * len(kinds),
    ]
    for i, places in enumerate(recording.positions[:, :, [1, 2, 0]]):
        cells = [_cell(1000 * x, 3) for x in places.reshape(-1)]
        before = ["0", "0", "0", *["7"] * len(cells)] if solved else []
        lines.append(
            ",".join([str(i), f"{recording.time[i]:.6f}", "15:26:46:12.02", *before, *cells])
        )
    return _written(path, lines, "\r\n")


def write_nexus(path, recording):
    """Nexus' ASCII export: a force plate, then markers in millimetres."""
    lines = [
        "Devices",
        "1000",
        ",,Plate - Force",
        "Frame,Sub Frame,Fx",
        ",,N",
        "1,0,700",
        "",
        "Trajectories",
        f"{recording.rate:.0f}",
        ",," + ",".join(f"Subject:{name},," for name in recording.names),
        "Frame,Sub Frame" + ",X,Y,Z" * len(recording.names),
        "," + ",mm" * 3 * len(recording.names),
    ]
    for i, places in enumerate(recording.positions):
        lines.append(",".join([str(i + 1), "0", *(_cell(1000 * x, 3) for x in places.reshape(-1))]))
    return _written(path, [*lines, ""])


def write_qualisys(path, recording, columns=True):
    """The TSV of Qualisys Track Manager, with a line of columns or without; a tab ends each line."""
    names = "\t".join(recording.names)
    lines = [
        f"NO_OF_FRAMES\t{len(recording)}",
        f"NO_OF_MARKERS\t{len(recording.names)}",
        f"FREQUENCY\t{recording.rate:.0f}",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2024-01-01, 12:11:10.322\t12345.678",
        "DATA_INCLUDED\t3D",
        f"MARKER_NAMES\t{names}\t",
    ]
    if columns:
        lines.append(
            "Frame\tTime\t"
            + "\t".join(f"{name} {axis}" for name in recording.names for axis in "XYZ")
        )
    for i, places in enumerate(recording.positions):
        cells = [_cell(1000 * x, 3) for x in places.reshape(-1)]
        lines.append(
            "\t".join([*([str(i + 1), f"{recording.time[i]:.5f}"] if columns else []), *cells, ""])
        )
    return _written(path, lines)


def write_mvnx(path, recording):
    """The XML of MVN: an identity frame, then the motion; orientations stand before positions."""
    segments = "".join(
        f'<segment label="{name}" id="{i + 1}"><points/></segment>'
        for i, name in enumerate(recording.names)
    )
    still = " ".join(["1 0 0 0"] * len(recording.names))
    frames = [
        f'<frame time="0" type="identity"><orientation>{still}</orientation><position>0 0 0</position></frame>'
    ]
    for time, places in zip(recording.time, recording.positions, strict=True):
        numbers = " ".join(f"{x:.6f}" for x in places.reshape(-1))
        frames.append(
            f'<frame time="{1000 * time:.0f}" type="normal"><orientation>{still}</orientation>'
            f"<position>{numbers}</position></frame>"
        )
    return _written(
        path,
        [
            '<?xml version="1.0" encoding="UTF-8"?>\n<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">'
            f'<subject label="A" frameRate="{recording.rate:.0f}" segmentCount="{len(recording.names)}">'
            f"<segments>{segments}</segments><frames>{''.join(frames)}</frames></subject></mvnx>",
        ],
    )


def landmarks(recording, order, turn, origin):
    """Frames of keypoints as MediaPipe has them, in an order, from the middle of the points `origin` on."""
    frames = []
    for i, places in enumerate(recording.positions):
        start = places[[recording.names.index(name) for name in origin]].mean(axis=0)
        by_name = {
            name: (place - start) @ np.transpose(turn)
            for name, place in zip(recording.names, places, strict=True)
        }
        frames.append(
            {
                "timestamp_ms": 1000 * recording.time[i],
                "pose_world_landmarks": [
                    dict(zip("xyz", map(float, by_name.get(name, np.zeros(3))), strict=True))
                    | {"visibility": 0.9 if name in by_name else 0.1}
                    for name in order
                ],
            }
        )
    return frames


def write_json(path, content):
    return _written(path, [json.dumps(content)])


def amass(made):
    """Pose parameters (n, 156) of a body whose bones lie as those of a motion, and the root's places."""
    body = np.eye(3)[[1, 2, 0]]  # x to the left, y up, z forward
    n = len(made.time)
    poses = np.zeros((n, 52, 3))
    trunk = made.trunk @ body.T  # from the body's axes to the world's
    poses[:, 0] = Rotation.from_matrix(trunk).as_rotvec()
    for side, sign, joints in (("l", 1.0, (16, 18, 20)), ("r", -1.0, (17, 19, 21))):
        above = trunk
        for joint, (start, end) in zip(
            joints, pairwise(("shoulder", "elbow", "wrist", "hand")), strict=True
        ):
            bone = made.parts[f"{end}_{side}"] - made.parts[f"{start}_{side}"]
            local = np.einsum("nji,nj->ni", above, bone)
            turn = onto(np.array([[sign, 0.0, 0.0]]), local)
            poses[:, joint] = Rotation.from_matrix(turn).as_rotvec()
            above = above @ turn
    return {
        "poses": poses.reshape(n, -1),
        "trans": made.parts["pelvis"],
        "mocap_framerate": 1 / made.time[1],
    }
