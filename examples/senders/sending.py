"""What the senders share: frames to ``maniport live --udp``, or to a recording for its calibration.

A sender yields frames: a time [s] and positions (x, y, z) [m] by name, None where a point is not seen.
"""

import argparse
import json
import select
import socket
import sys
import threading
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

Position = tuple[float, float, float]
Points = Mapping[str, Position | None]
Frames = Iterable[tuple[float, Points]]

BODY_JOINTS = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck"),
    *("left_collar", "right_collar", "head", "left_shoulder", "right_shoulder"),
    *("left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hand", "right_hand"),
)
"""The 24 joints of body tracking of PICO headsets, in their order."""


def is_mirrored(points: Points) -> bool:
    """Whether left and right of a body are exchanged, as where left-handed axes are taken for right-handed ones.

    Ankles, feet, spine and hips must be there. Toes point forward, and the left hip is to the left.
    """
    place = {name: np.array(position) for name, position in points.items() if position is not None}
    up = place["spine3"] - place["pelvis"]
    forward = place["left_foot"] - place["left_ankle"] + place["right_foot"] - place["right_ankle"]
    to_the_left = place["left_hip"] - place["right_hip"]
    return bool(np.cross(up, forward) @ to_the_left < 0.0)


def mirrored(points: Points) -> Points:
    """Return points with the sign of z changed: from left-handed to right-handed axes."""
    changed = {}
    for name, position in points.items():
        changed[name] = None if position is None else (position[0], position[1], -position[2])
    return changed


def frame_line(time: float, points: Points, wanted: Iterable[str], engage: bool = False) -> bytes:
    """Return the line of a frame, with the points that ``maniport live`` wants; missing ones are null."""
    content: dict[str, object] = {"t": time, "points": {name: points.get(name) for name in wanted}}
    if engage:
        content["engage"] = True
    return json.dumps(content).encode()


def send(frames: Frames, host: str = "127.0.0.1", port: int = 9000) -> None:
    """Send frames; a person who sees the robot presses Enter to let it move, and h and Enter to hold it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.connect((host, port))
        link.settimeout(10.0)
        link.send(b"{}")
        wanted = json.loads(link.recv(65536))["points"]
        link.settimeout(None)
        threading.Thread(target=_receive, args=(link,), daemon=True).start()
        for time, points in frames:
            keys = _typed()
            if keys is not None and keys.startswith("h"):
                link.send(b'{"engage": false}')
                keys = None
            link.send(frame_line(time, points, wanted, engage=keys is not None))


def record(frames: Frames, file: Path, seconds: float) -> None:
    """Write frames of some seconds to ``FILE.npz``, which is the calibration of ``maniport live``."""
    times = []
    rows = []
    names: tuple[str, ...] = ()
    for time, points in frames:
        names = names or tuple(points)
        row = [points.get(name) or (np.nan, np.nan, np.nan) for name in names]
        times.append(time)
        rows.append(row)
        if time - times[0] >= seconds:
            break
    positions = np.array(rows)
    np.savez(file, positions=positions, names=np.array(names), time=np.array(times) - times[0])


def run(frames: Frames, about: str | None) -> None:
    """Send or record, as the command line says."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--record", type=Path, help="record FILE.npz instead of sending")
    parser.add_argument("--seconds", type=float, default=20.0, help="duration of the recording")
    parser.add_argument("--port", type=int, default=9000, help="port of maniport live --udp")
    options = parser.parse_args()
    if options.record is not None:
        record(frames, options.record, options.seconds)
        return
    print("Press Enter for consent to the robot's motion, h and Enter to hold it.", file=sys.stderr)
    send(frames, port=options.port)


def _typed() -> str | None:
    """Return a line that was typed, without waiting; None without one."""
    if not sys.stdin.isatty() or not select.select([sys.stdin], [], [], 0.0)[0]:
        return None
    return sys.stdin.readline()


def _receive(link: socket.socket) -> None:
    """Print errors; with ``--send`` the answers go to another program."""
    with suppress(OSError):  # the socket is closed at the end
        while True:
            answer = json.loads(link.recv(65536))
            if "error" in answer:
                print(answer["error"], file=sys.stderr)
