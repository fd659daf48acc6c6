"""Content of a page as values and arrays with their colors, for the scripts of the page and for the Rerun viewer."""

import base64
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from maniport.motion.status import REACHED
from maniport.spd.ellipsoid import axes
from maniport.util.atomic_io import written_whole
from maniport.util.optional import rerun
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

if TYPE_CHECKING:
    from rerun import AsComponents, ComponentColumnList, RecordingStream, TimeColumn


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
PERSON = Role("person", "#0072B2", "#56B4E9", "#8FC1E3", "ellipsoid of the person")
TARGET = Role("target", "#D55E00", "#F28B42", "#F3B48B", "target ellipsoid of the robot (shell)")
ACHIEVED = Role("achieved", "#00805D", "#2FC596", "#8CD3BE", "achieved ellipsoid of the robot")
REFERENCE = Role("reference", "#000000", "#E8EDF2", "#999999", "reference (dashed)")

ROLES = {role.name: role for role in (PERSON, TARGET, ACHIEVED, REFERENCE)}

OTHERS = ("#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe & Ito's other colors, for data without a role."""

STATES = {
    "followed": ("#D9E0E6", "#3A4652"),
    "nearly followed": ("#B3BDC7", "#5A6875"),
    "ellipsoid missed": ("#A58BC4", "#A58BC4"),
    "joint limit": ("#CC79A7", "#CC79A7"),
    "velocity limit": ("#7B4B94", "#8F62A8"),
    "position missed": ("#000000", "#E8EDF2"),
    "QP failed; last safe configuration held": ("#B00020", "#FF8F9D"),
}
"""States of a waypoint from good to bad, with their colors on a light and on a dark background."""

HUMAN_JOINTS = "Joints of the person"  # Topic of panels

LONGEST_ARROW = 0.6  # [m]; near singular configurations forces are many times larger than elsewhere

FORMS = {
    "f32": "<f4",
    "u16": "<u2",
    "u32": "<u4",
}  # Numbers of encoded arrays, in little-endian order


@dataclass(frozen=True, eq=False)
class Part:
    """The surface of a link."""

    points: Array  # (m, 3) in the frame of the link [m]
    triangles: NDArray[np.integer]  # (k, 3) rows of `points`
    poses: Array  # (n, 4, 4) of the link in the base frame [m]


@dataclass(frozen=True, eq=False)
class Arrow:
    """A quantity along a line through the end effector: an arrow with two heads, as long as the value."""

    kind: str  # a key of `Animation.arrows`
    role: str
    lines: Array  # (n, 3) unit vectors in the frame of the stage
    values: (
        Array | None
    )  # (n,) in the unit of the kind; None: the line is drawn without heads and number
    dashed: bool = False


@dataclass(frozen=True)
class ArrowKind:
    """A quantity that arrows show, with one scale for all arms and times."""

    title: str
    unit: str
    size: float  # length of one `unit` from the end effector to a head [m]
    longest: float = LONGEST_ARROW  # arrows are cut there [m]


@dataclass(frozen=True, eq=False)
class Body:
    """A moving arm with ellipsoids at its end effector."""

    name: str
    skeleton: Array  # (n, k, 3) corners of the polyline from base to end effector [m]
    ellipsoids: Mapping[str, Array] = field(
        default_factory=dict
    )  # (n, d, d) by role, d ≤ 3, in the animation's unit
    path: Array | None = None  # (n, 3) target positions of the end effector [m]
    parts: tuple[Part, ...] = ()  # surfaces, which replace the skeleton
    arrows: tuple[Arrow, ...] = ()


@dataclass(frozen=True, eq=False)
class Stage:
    """Arms in one view and one frame."""

    name: str
    bodies: tuple[Body, ...]
    rotation: Array | None = None  # (3, 3) of the camera, from the frame of the other stages
    torso: Array | None = None  # (k, 7) rods of a torso: start, end, radius [m]
    note: str = ""  # below the view


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

    @property
    def heading(self) -> str:
        """Title with the unit."""
        if not self.unit:
            return self.title
        return f"{self.title} [{self.unit}]"


@dataclass(frozen=True, eq=False)
class Animation:
    """Moving arms and curves with one time."""

    time: Array  # (n,) ascending [s]
    stages: tuple[Stage, ...]  # side by side, with one scale
    panels: Mapping[str, tuple[Panel, ...]] = field(default_factory=dict)  # by topic
    unit: str = ""  # of semi-axes
    size: float = 0.25  # length of a semi-axis of one `unit` [m]
    arrows: Mapping[str, ArrowKind] = field(default_factory=dict)  # by kind
    clocks: Mapping[str, Array] = field(default_factory=dict)  # (n,) further times by name [s]
    note: str = ""
    states: tuple[str, ...] = ()  # a key of STATES for each time


def as_json(animation: Animation, frames: int, linked: Iterable[float] = ()) -> str:
    """Encode an animation for a ``<script>`` element with data, thinned as `kept_rows` does."""
    kept = kept_rows(animation.time, frames, linked)
    time = animation.time[kept]
    data = vars(animation) | {
        "legend": _legend(animation.stages),
        "arrows": {name: vars(kind) for name, kind in animation.arrows.items()},
        "start": float(time[0]),
        "time": packed(time - time[0]),
        "gaps": np.flatnonzero(is_gap(np.diff(time))).tolist(),
        "stages": [_stage(stage, kept) for stage in animation.stages],
        "panels": _panels(animation.panels, kept),
        "clocks": {name: packed(times[kept]) for name, times in animation.clocks.items()},
        "states": _states(animation.states, kept),
    }
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")  # nothing in the data may end the element


def _legend(stages: Iterable[Stage]) -> dict[str, str]:
    """Return the meaning of each role that is drawn, in the order of the roles."""
    drawn = set[str]()
    for stage in stages:
        for body in stage.bodies:
            drawn.update(body.ellipsoids)
    return {role.name: role.about for role in ROLES.values() if role.name in drawn}


def _stage(stage: Stage, kept: NDArray[np.intp]) -> dict[str, object]:
    rotation = None
    if stage.rotation is not None:
        rotation = stage.rotation.ravel().tolist()
    torso = None
    if stage.torso is not None:
        torso = stage.torso.round(4).tolist()
    bodies = [_body(body, kept) for body in stage.bodies]
    return vars(stage) | {"rotation": rotation, "torso": torso, "bodies": bodies}


def _body(body: Body, kept: NDArray[np.intp]) -> dict[str, object]:
    path = None
    if body.path is not None:
        path = packed(body.path[kept])
    return vars(body) | {
        "skeleton": packed(body.skeleton[kept]),
        "ellipsoids": {role: _six(profile[kept]) for role, profile in body.ellipsoids.items()},
        "path": path,
        "parts": [_part(part, kept) for part in body.parts],
        "arrows": [_arrow(arrow, kept) for arrow in body.arrows],
    }


def _arrow(arrow: Arrow, kept: NDArray[np.intp]) -> dict[str, object]:
    values = None
    if arrow.values is not None:
        values = packed(arrow.values[kept])
    return vars(arrow) | {"lines": packed(arrow.lines[kept]), "values": values}


def _panels(
    panels_of: Mapping[str, tuple[Panel, ...]], kept: NDArray[np.intp]
) -> dict[str, list[dict[str, object]]]:
    encoded = {}
    for topic, panels in panels_of.items():
        encoded[topic] = [_panel(panel, kept) for panel in panels]
    return encoded


def _panel(panel: Panel, kept: NDArray[np.intp]) -> dict[str, object]:
    lines = []
    for line in panel.lines:
        lines.append(vars(line) | {"values": packed(line.values[kept])})
    return vars(panel) | {"lines": lines}


def _states(states: tuple[str, ...], kept: NDArray[np.intp]) -> dict[str, object] | None:
    if not states:
        return None
    names = list(STATES)
    numbers = [names.index(states[row]) for row in kept]
    return {"names": names, "reached": list(REACHED), "values": packed(numbers, "u16")}


def kept_rows(time: Array, frames: int, linked: Iterable[float] = ()) -> NDArray[np.intp]:
    """Return the rows of times (n,) that a page contains: at most `frames`, and the nearest to linked times [s]."""
    kept = set(evenly_spaced(len(time), frames).tolist())
    for moment in linked:
        kept.add(int(np.abs(time - moment).argmin()))
    return np.array(sorted(kept), dtype=np.intp)


def is_gap(steps: Array) -> NDArray[np.bool_]:
    """Return which time steps are more than three times the median, so that a line breaks there."""
    if not len(steps):
        return np.zeros(0, dtype=bool)
    return np.asarray(steps > 3.0 * np.median(steps))


def packed(array: ArrayLike, form: str = "f32") -> dict[str, object]:
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


def _six(matrices: Array) -> dict[str, object]:
    """Encode entries xx, xy, xz, yy, yz, zz of symmetric matrices (n, d, d), d ≤ 3; ellipses become flat ellipsoids."""
    n, d, _ = matrices.shape
    padded = np.zeros((n, 3, 3))
    padded[:, :d, :d] = matrices
    return packed(padded[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]])


def _part(part: Part, kept: NDArray[np.intp]) -> dict[str, object]:
    """Encode a surface with the first three rows of its poses; of a single one where nothing moves."""
    poses = part.poses[kept, :3]
    if np.abs(poses - poses[0]).max() < 1e-9:
        poses = poses[:1]
    form = "u32"
    if part.triangles.max(initial=0) < 2**16:
        form = "u16"
    return {
        "points": packed(part.points),
        "triangles": packed(part.triangles, form),
        "poses": packed(poses),
    }


def write_scene(path: str | os.PathLike[str], animation: Animation) -> None:
    """Write an animation to a Rerun recording, whole or not at all."""
    package = rerun()
    place = package.escape_entity_path_part  # a name as one part of an entity path
    clocks = {"time": animation.time, **animation.clocks}
    columns = []
    for name, time in clocks.items():
        columns.append(package.TimeColumn(name, duration=(time - time[0]).tolist()))
    with written_whole(path) as temporary:
        stream = package.RecordingStream("maniport")
        stream.save(temporary)
        for stage in animation.stages:
            home = place(stage.name)
            stream.log(home, package.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            for k, body in enumerate(stage.bodies):
                where = home
                if len(stage.bodies) > 1:
                    where = f"{home}/{k}"
                _log_arm(package, stream, body, where, columns, animation.size)
        for topic, panels in animation.panels.items():
            for panel in panels:
                title = panel.heading
                for line in panel.lines:
                    where = "/".join(map(place, filter(None, ("curves", topic, title, line.name))))
                    look = package.SeriesLines(
                        colors=[ROLES[line.role].rgb], names=[line.name or title]
                    )
                    stream.log(where, look, static=True)
                    stream.send_columns(
                        where, indexes=columns, columns=package.Scalars.columns(scalars=line.values)
                    )
        stream.flush()
        stream.disconnect()


def _log_arm(
    package: ModuleType,
    stream: "RecordingStream",
    body: Body,
    home: str,
    clocks: list["TimeColumn"],
    size: float,
) -> None:
    """Log the ellipsoids and links of an arm below a place of a Rerun recording."""
    grey = 190, 196, 204

    def log(where: str, look: "AsComponents", columns: "ComponentColumnList") -> None:
        stream.log(f"{home}/{where}", look, static=True)
        stream.send_columns(f"{home}/{where}", indexes=clocks, columns=columns)

    fill = package.components.FillMode
    for role, ellipsoids in body.ellipsoids.items():
        lengths, directions = axes(ellipsoids)
        # axes are lines; rotations are right-handed
        directions[..., 0] *= np.sign(np.linalg.det(directions))[:, None]
        mode = fill.MajorWireframe if role == TARGET.name else fill.Solid
        look = package.Ellipsoids3D.from_fields(colors=[ROLES[role].rgb], fill_mode=mode)
        turns = Rotation.from_matrix(directions).as_quat()
        centers = body.skeleton[:, -1]
        log(
            role,
            look,
            package.Ellipsoids3D.columns(
                half_sizes=size * lengths, centers=centers, quaternions=turns
            ),
        )
    for k, part in enumerate(body.parts):
        mesh = package.Mesh3D(
            vertex_positions=part.points, triangle_indices=part.triangles, albedo_factor=grey
        )
        turns = Rotation.from_matrix(part.poses[:, :3, :3]).as_quat()
        log(
            f"links/{k}",
            mesh,
            package.Transform3D.columns(translation=part.poses[:, :3, 3], quaternion=turns),
        )
    if not body.parts:
        look = package.LineStrips3D.from_fields(colors=[grey], radii=[0.012])
        log("skeleton", look, package.LineStrips3D.columns(strips=list(body.skeleton)))
    if body.path is not None:
        line = package.LineStrips3D([body.path], colors=[REFERENCE.rgb], radii=[0.002])
        stream.log(f"{home}/path", line, static=True)
