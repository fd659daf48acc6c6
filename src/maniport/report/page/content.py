"""Content of a page as values and arrays with their colors, and its encoding for the scripts of the page."""

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from maniport.motion import status
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array


@dataclass(frozen=True)
class Role:
    """A role with its colors on a light and on a dark background, and for dots behind lines."""

    name: str
    color: str
    dark: str
    pale: str
    about: str  # text of a legend

    @property
    def rgb(self) -> tuple[int, int, int]:
        """The color on a light background as three numbers from 0 to 255."""
        red, green, blue = bytes.fromhex(self.color[1:])
        return red, green, blue


# Okabe & Ito's blue, vermilion and (darker) green, which remain distinct for color-blind readers
PERSON = Role("person", "#0072B2", "#56B4E9", "#8FC1E3", "human ellipsoid")
TARGET = Role("target", "#D55E00", "#F28B42", "#F3B48B", "target ellipsoid of the robot (shell)")
ACHIEVED = Role("achieved", "#00805D", "#2FC596", "#8CD3BE", "achieved ellipsoid of the robot")
REFERENCE = Role("reference", "#000000", "#E8EDF2", "#999999", "reference (dashed)")

ROLES = {role.name: role for role in (PERSON, TARGET, ACHIEVED, REFERENCE)}

OTHERS = ("#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe & Ito's other colors, for data without a role."""

STATES = {
    status.FOLLOWED: ("#D9E0E6", "#3A4652"),
    status.NEARLY_FOLLOWED: ("#B3BDC7", "#5A6875"),
    status.ELLIPSOID: ("#A58BC4", "#A58BC4"),
    status.JOINT_LIMIT: ("#CC79A7", "#CC79A7"),
    status.VELOCITY_LIMIT: ("#7B4B94", "#8F62A8"),
    status.PATH: ("#000000", "#E8EDF2"),
    status.HELD: ("#B00020", "#FF8F9D"),
}
"""States of a waypoint from good to bad, with their colors on a light and on a dark background."""

HUMAN_JOINTS = "Joints of the person"  # Topic of panels

FORMS = {"f32": "<f4", "u16": "<u2", "u32": "<u4"}  # Numbers of encoded arrays, in little-endian order


@dataclass(frozen=True, eq=False)
class Part:
    """The surface of a link."""

    points: Array  # (m, 3) in the frame of the link [m]
    triangles: NDArray[np.integer]  # (k, 3) rows of `points`
    poses: Array  # (n, 4, 4) of the link in the base frame [m]


@dataclass(frozen=True, eq=False)
class Body:
    """A moving arm with ellipsoids at its end effector."""

    name: str
    skeleton: Array  # (n, k, 3) corners of the polyline from base to end effector [m]
    ellipsoids: Mapping[str, Array] = field(default_factory=dict)  # (n, d, d) by role, d ≤ 3, in the animation's unit
    path: Array | None = None  # (n, 3) target positions of the end effector [m]
    parts: tuple[Part, ...] = ()  # surfaces, which replace the skeleton


@dataclass(frozen=True, eq=False)
class Stage:
    """Arms in one view and one frame."""

    name: str
    bodies: tuple[Body, ...]
    rotation: Array | None = None  # (3, 3) of the camera, from the frame of the other stages
    torso: Array | None = None  # (k, 7) rods of a torso: start, end, radius [m]


@dataclass(frozen=True, eq=False)
class Line:
    """Values over time, nan where there are none; `style` 0 to 2: solid, dashed, dotted; `wide` lines are pale."""

    name: str
    values: Array
    role: str = "achieved"
    style: int = 0
    wide: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """Lines with a common axis."""

    title: str
    unit: str
    lines: tuple[Line, ...]
    meaning: str = ""  # one sentence
    logarithmic: bool = False
    limits: tuple[float, float] | None = None  # values outside are shaded
    span: tuple[float, float] | None = None  # ends of the axis; None: those of the values
    strip: bool = False  # drawn as a strip until it is opened


@dataclass(frozen=True, eq=False)
class Animation:
    """Moving arms and curves with one time."""

    time: Array  # (n,) ascending [s]
    stages: tuple[Stage, ...]  # side by side, with one scale
    panels: Mapping[str, tuple[Panel, ...]] = field(default_factory=dict)  # by topic
    unit: str = ""  # of semi-axes
    size: float = 0.25  # length of a semi-axis of one `unit` [m]
    clocks: Mapping[str, Array] = field(default_factory=dict)  # (n,) further times by name [s]
    legend: Mapping[str, str] = field(default_factory=dict)  # descriptions of ellipsoids by role
    note: str = ""
    states: tuple[str, ...] = ()  # a key of STATES for each time


def as_json(animation: Animation, frames: int) -> str:
    """Encode an animation for a ``<script>`` element with data, thinned to at most `frames` times."""
    kept, names = evenly_spaced(len(animation.time), frames), list(STATES)
    time, states = animation.time[kept], [names.index(animation.states[k]) for k in kept if animation.states]
    data = vars(animation) | {
        "start": float(time[0]),
        "time": packed(time - time[0]),
        "gaps": np.flatnonzero(is_gap(np.diff(time))).tolist(),
        "stages": [
            vars(stage) | {
                "rotation": None if stage.rotation is None else stage.rotation.ravel().tolist(),
                "torso": None if stage.torso is None else stage.torso.round(4).tolist(),
                "bodies": [
                    vars(body) | {
                        "skeleton": packed(body.skeleton[kept]),
                        "ellipsoids": {role: _six(points[kept]) for role, points in body.ellipsoids.items()},
                        "path": None if body.path is None else packed(body.path[kept]),
                        "parts": [_part(part, kept) for part in body.parts],
                    } for body in stage.bodies
                ],
            } for stage in animation.stages
        ],
        "panels": {
            topic: [vars(panel) | {"lines": [vars(line) | {"values": packed(line.values[kept])}
                                             for line in panel.lines]} for panel in panels]
            for topic, panels in animation.panels.items()
        },
        "clocks": {name: packed(times[kept]) for name, times in animation.clocks.items()},
        "states": {"names": names, "values": packed(states, "u16")} if states else None,
    }  # fmt: skip
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")  # nothing in the data may end the element


def is_gap(steps: Array) -> NDArray[np.bool_]:
    """Return which time steps are more than three times the median, so that a line breaks there."""
    return np.asarray(steps > 3.0 * np.median(steps)) if len(steps) else np.zeros(0, dtype=bool)


def packed(array: ArrayLike, form: str = "f32") -> dict[str, Any]:
    """Encode an array as its shape and, in base64, its numbers."""
    values = np.ascontiguousarray(array, dtype=FORMS[form])
    return {"shape": list(values.shape), form: base64.b64encode(values.tobytes()).decode("ascii")}


def unpacked(value: Any) -> Any:
    """Return the data of a page with its arrays."""
    if isinstance(value, list):
        return [unpacked(item) for item in value]
    if not isinstance(value, dict):
        return value
    for form, kind in FORMS.items():
        if isinstance(value.get(form), str):
            array = np.frombuffer(base64.b64decode(value[form]), kind).reshape(value["shape"])
            return array.astype(float if form == "f32" else int)
    return {key: unpacked(item) for key, item in value.items()}


def _six(matrices: Array) -> dict[str, Any]:
    """Encode entries xx, xy, xz, yy, yz, zz of symmetric matrices (n, d, d), d ≤ 3; ellipses become flat ellipsoids."""
    n, d, _ = matrices.shape
    padded = np.zeros((n, 3, 3))
    padded[:, :d, :d] = matrices
    return packed(padded[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]])


def _part(part: Part, kept: NDArray[np.intp]) -> dict[str, Any]:
    """Encode a surface with positions and unit quaternions x y z w of its poses; a single one where nothing moves."""
    poses = part.poses[kept]
    if np.abs(poses - poses[0]).max() < 1e-9:
        poses = poses[:1]
    rotations = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    flipped = np.einsum("ni,ni->n", rotations[:-1], rotations[1:]) < 0  # successive ones have the same sign
    rotations[1:] *= np.cumprod(np.where(flipped, -1.0, 1.0))[:, None]
    return {
        "points": packed(part.points),
        "triangles": packed(part.triangles, "u16" if part.triangles.max(initial=0) < 2**16 else "u32"),
        "poses": packed(np.concatenate([poses[:, :3, 3], rotations], axis=1)),
    }
