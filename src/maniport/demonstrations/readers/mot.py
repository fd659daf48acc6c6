"""MOT and STO, the tables of joint angles that OpenSim writes: angles become the points that an arm would show.

Two families of coordinates are known. Those of Saul et al. (2015), MoBL-ARMS, are the joints of our own arm models.
Those of Rajagopal et al. (2016), which OpenCap and Pose2Sim use, turn the humerus in the torso about z (right), x
(forward) and y (up), one after the other; axes and offsets of elbow, forearm and wrist are those of the model
``LaiUhlrich2022.osim`` of OpenCap and of ``Rajagopal2015.osim``. Left arms are mirror images in both.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.bodies import myoarm
from maniport.bodies.human import JOINTS
from maniport.demonstrations.given import LARGEST_ANGLE, Given
from maniport.demonstrations.performed import HALF_WIDTH, TRUNK, performed
from maniport.demonstrations.readers.text import number_table, rows_from, text_lines
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.validation import Array

RAJAGOPAL = ("arm_flex", "arm_add", "arm_rot", "elbow_flex", "pro_sup", "wrist_flex", "wrist_dev")
NEEDED = {JOINTS: 4, RAJAGOPAL: 4}
"""So many of the coordinates of a family make an arm; what else is not there stays at zero."""

ELBOW_AXIS, FOREARM_AXIS = np.array([0.22604696, 0.022269, 0.97386183]), np.array([0.05639803, 0.99840646, 0.001952])
ELBOW, FOREARM, WRIST, HAND = (
    np.array(place)
    for place in (
        (0.013144, -0.286273, -0.009595), (-0.006727, -0.013007, 0.026083), (-0.008797, -0.235841, 0.01361),
        (0.0, -0.055, 0.0),
    )
)  # fmt: skip
"""Places of elbow, radioulnar joint, wrist and the middle of the hand, each where the one before it is [m]."""
ANGLES = {*JOINTS, *RAJAGOPAL}
WHOLE_TURN = 2 * np.pi
"""No joint of an arm is turned further [rad]."""
HEADER = 200
"""Lines among which the header ends."""
SHOULDER = np.array([0.0, -0.17, 0.0])
"""Where a right arm begins in the trunk [m]."""


def read(file: Path, given: Given) -> Recording:
    """Read joint angles; see `maniport.demonstrations.readers.read_recording`."""
    lines = text_lines(file)
    end = next((i for i, line in enumerate(lines[:HEADER]) if line.strip().lower() == "endheader"), None)
    if end is None or end + 1 >= len(lines):
        raise FileFormatError(f"{file}: this is no table of OpenSim: there is no line endheader, and numbers after it")
    header = dict(re.findall(r"^\s*(\w+)\s*=\s*(\S+)", "\n".join(lines[:end]), flags=re.MULTILINE))
    columns = [_coordinate(word) for word in lines[end + 1].split()]
    if columns[:1] != ["time"]:
        raise FileFormatError(
            f"{file}: line {end + 2} must name the columns, time first; found {lines[end + 1][:80]!r}"
        )
    table = number_table(file, rows_from(lines, end + 2), len(columns), str.split)
    said = header.get("nRows", "")
    if said.isdecimal() and int(said[:15]) > len(table) + 1:
        raise FileFormatError(
            f"{file}: the file is cut off: its header says {said[:15]} rows, and there are {len(table)}"
        )
    angles = {name: table[:, i] for i, name in enumerate(columns) if i}
    unit, note, doubt = _radians(file, angles, header.get("inDegrees", "").lower())
    angles = {name: angle * unit for name, angle in angles.items()}
    points, notes = _arms(angles, np.arange(len(table)) / 100.0)
    if not points:
        raise FileFormatError(
            f"{file}: no joint angles of an arm: wanted are {', '.join(JOINTS[:4])}, or {', '.join(RAJAGOPAL[:4])} "
            f"with _r or _l; found {', '.join(columns[1:])[:300]}"
        )
    points |= {name: np.tile(np.array(place), (len(table), 1)) for name, place in TRUNK.items()}
    positions = np.stack(list(points.values()), axis=1)
    recording = given.recording(
        file,
        list(points),
        positions,
        table[:, 0],
        "m",
        "z",
        "of the trunk",
        notes=[*filter(None, [note]), *notes],
        unit_by="of the model of an arm",
    )
    return replace(recording, measured=False, doubts=(*recording.doubts, *filter(None, [doubt])))


def _radians(file: Path, angles: Mapping[str, Array], degrees: str) -> tuple[float, str, str]:
    """Radians per unit, as the header says, or by the angles where it says nothing; a note, and a doubt."""
    of_arms = [angle for name, angle in angles.items() if name.removesuffix("_r").removesuffix("_l") in ANGLES]
    seen = [np.abs(angle[np.isfinite(angle)]) for angle in of_arms]
    largest = max((float(np.percentile(angle, 95)) for angle in seen if len(angle)), default=0.0)
    if degrees == "no" and largest > WHOLE_TURN:
        raise FileFormatError(
            f"{file}: its header says that angles are radians (inDegrees=no), but a joint of the arm is at "
            f"{largest:.4g}; if they are degrees write inDegrees=yes"
        )
    if degrees == "no":
        return 1.0, "", ""
    if degrees == "" and largest <= WHOLE_TURN:
        return 1.0, "angles taken as radians: the header does not say, and no joint of the arm goes beyond 6.28", ""
    few = degrees == "yes" and 0.0 < largest <= WHOLE_TURN
    doubt = f"no joint of the arm is turned further than {largest:.2g}°: if angles are radians, write inDegrees=no"
    return np.radians(1.0), "", doubt if few else ""


def _coordinate(word: str) -> str:
    """A coordinate's name; newer files write its place in the model, as in ``/jointset/elbow/elbow_flexion/value``."""
    return word.removesuffix("/value").rpartition("/")[2]


def _arms(angles: Mapping[str, Array], time: Array) -> tuple[dict[str, Array], list[str]]:
    """Points of the arms whose angles there are, in the trunk frame [m], and what was done."""
    points: dict[str, Array] = {}
    notes = []
    for side, mirror in (("right", 1.0), ("left", -1.0)):
        endings = (f"_{side[0]}", "") if side == "right" else (f"_{side[0]}",)
        for family, make in ((JOINTS, _as_saul), (RAJAGOPAL, _as_rajagopal)):
            columns = {name: _column(angles, name, endings) for name in family}
            found = {name: column for name, column in columns.items() if column is not None}
            if not all(name in found for name in family[: NEEDED[family]]):
                continue
            q = np.stack([found.get(name, np.zeros(len(time))) for name in family], axis=1)
            whole = (np.abs(q) < LARGEST_ANGLE).all(axis=1, keepdims=True)
            shown = make(np.where(whole, q, 0.0), time)
            for name, place in shown.items():
                points[f"{side}_{name}"] = np.where(whole, place * [1.0, mirror, 1.0], np.nan)
            zero = [name for name in family if name not in found]
            notes.append(
                f"joint angles of the {side} arm ({', '.join(found)}): points are those that an arm with these angles "
                "would show, lengths those of the model"
                + (f"; at zero, for they are not there: {', '.join(zero)}" if zero else "")
            )
            break
    return points, notes


def _column(angles: Mapping[str, Array], name: str, endings: tuple[str, ...]) -> Array | None:
    return next((angles[name + ending] for ending in endings if name + ending in angles), None)


def _as_saul(q: Array, time: Array) -> dict[str, Array]:
    """Points of our own arm; x forward, y to the left, z up."""
    shown = performed(myoarm(), q, time)
    return {name: shown.point(name) for name in shown.names if name not in TRUNK}


def _as_rajagopal(q: Array, time: Array) -> dict[str, Array]:
    """Points of the right arm of Rajagopal's model."""
    turn = Rotation.from_euler("ZXY", q[:, [0, 1, 2]])
    places = {"shoulder": np.zeros((len(q), 3))}
    places["elbow"] = turn.apply(ELBOW)
    across = turn.apply(HALF_WIDTH * ELBOW_AXIS)
    places |= {"elbow_medial": places["elbow"] - across, "elbow_lateral": places["elbow"] + across}
    ulna = turn * Rotation.from_rotvec(q[:, 3:4] * ELBOW_AXIS)
    radius = ulna * Rotation.from_rotvec(q[:, 4:5] * FOREARM_AXIS)
    places["wrist"] = places["elbow"] + ulna.apply(FOREARM) + radius.apply(WRIST)
    across = radius.apply(np.array([0.0, 0.0, HALF_WIDTH]))
    places |= {"wrist_ulnar": places["wrist"] - across, "wrist_radial": places["wrist"] + across}
    places["hand"] = places["wrist"] + (radius * Rotation.from_euler("ZX", q[:, 5:7])).apply(HAND)
    return {name: place[:, [0, 2, 1]] * [1.0, -1.0, 1.0] + SHOULDER for name, place in places.items()}
