"""Content of a page as values and arrays, and its encoding for the scripts of the page."""

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from maniport.errors import InvalidInputError
from maniport.motion import status
from maniport.report.roles import ROLES
from maniport.report.series import is_gap
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array, as_choice, as_times

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
    ellipsoids: Mapping[str, Array] = field(default_factory=dict)  # (n, 3, 3) by role, in the unit of the animation
    path: Array | None = None  # (n, 3) target positions of the end effector [m]
    parts: tuple[Part, ...] = ()  # surfaces, which replace the skeleton

    def __post_init__(self) -> None:
        for role in self.ellipsoids:
            as_choice(role, "role", tuple(ROLES))


@dataclass(frozen=True, eq=False)
class Stage:
    """Arms in one view and one frame."""

    name: str
    bodies: tuple[Body, ...]
    rotation: Array | None = None  # (3, 3) of the camera, from the frame of the other stages
    torso: Array | None = None  # (k, 7) rods of a torso: start, end, radius [m]


@dataclass(frozen=True)
class Image:
    """A PNG image with a description."""

    png: bytes
    description: str


@dataclass(frozen=True, eq=False)
class Line:
    """Values over time, nan where there are none; `style` 0 to 2: solid, dashed, dotted; `wide` lines are pale."""

    name: str
    values: Array
    role: str = "achieved"
    style: int = 0
    wide: bool = False

    def __post_init__(self) -> None:
        as_choice(self.role, "role", tuple(ROLES))


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

    def __post_init__(self) -> None:
        if not self.lines:
            raise InvalidInputError(f"the panel {self.title!r} must have at least one line")


@dataclass(frozen=True, eq=False)
class Cloud:
    """Ellipsoids on a map."""

    name: str
    role: str
    coordinates: Array  # (n, 2)
    ellipsoids: Array  # (n, d, d)


@dataclass(frozen=True, eq=False)
class DomainMap:
    """Domains as clouds, and profiles as lines with a point for each time of a animation."""

    domains: tuple[Cloud, ...]
    profiles: tuple[Cloud, ...] = ()
    note: str = ""


@dataclass(frozen=True, eq=False)
class Animation:
    """Moving arms, curves and a map with one time."""

    time: Array  # (n,) ascending [s]
    stages: tuple[Stage, ...]  # side by side, with one scale
    panels: Mapping[str, tuple[Panel, ...]] = field(default_factory=dict)  # by topic
    map: DomainMap | None = None
    unit: str = ""  # of semi-axes
    size: float = 0.25  # length of a semi-axis of one `unit` [m]
    clocks: Mapping[str, Array] = field(default_factory=dict)  # (n,) further times by name [s]
    legend: Mapping[str, str] = field(default_factory=dict)  # descriptions of ellipsoids by role
    note: str = ""
    states: tuple[str, ...] = ()  # a key of STATES for each time

    def __post_init__(self) -> None:
        count = len(as_times(self.time))
        arrays = {f"the skeleton of {body.name!r}": body.skeleton for stage in self.stages for body in stage.bodies}
        arrays |= {f"the line {line.name!r} of {panel.title!r}": line.values
                   for panels in self.panels.values() for panel in panels for line in panel.lines}  # fmt: skip
        arrays |= {f"the profile {one.name!r}": one.coordinates for one in (self.map.profiles if self.map else ())}
        for name, array in arrays.items():
            if len(array) != count:
                raise InvalidInputError(f"{name} must have {count} entries, one for each time; found {len(array)}")


def as_json(animation: Animation, frames: int, *, surfaces: bool = True) -> str:
    """Encode an animation for a ``<script>`` element with data, thinned to at most `frames` times."""
    kept = evenly_spaced(len(animation.time), frames)
    time, names = animation.time[kept], list(STATES)
    states = [names.index(animation.states[k]) for k in kept] if animation.states else []
    data = {
        "start": float(time[0]),
        "time": packed(time - time[0]),
        "gaps": np.flatnonzero(is_gap(np.diff(time))).tolist(),
        "unit": animation.unit,
        "size": float(animation.size),
        "clocks": {name: packed(times[kept]) for name, times in animation.clocks.items()},
        "legend": dict(animation.legend),
        "stages": [_stage(stage, kept, surfaces) for stage in animation.stages],
        "panels": {name: [_panel(panel, kept) for panel in panels] for name, panels in animation.panels.items()},
        "map": None if animation.map is None else _map(animation.map, kept),
        "states": {"names": names, "values": packed(states, "u16")} if states else None,
    }
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")  # nothing in the data may end the element


def packed(array: ArrayLike, form: str = "f32") -> dict[str, Any]:
    """Encode an array as its shape and, in base64, its numbers in little-endian order."""
    values = np.ascontiguousarray(array, dtype={"f32": "<f4", "u16": "<u2", "u32": "<u4"}[form])
    return {"shape": list(values.shape), form: base64.b64encode(values.tobytes()).decode("ascii")}


def _stage(stage: Stage, kept: NDArray[np.intp], surfaces: bool) -> dict[str, Any]:
    rotation, torso = stage.rotation, stage.torso
    return {
        "name": stage.name,
        "rotation": None if rotation is None else np.asarray(rotation, dtype=float).ravel().tolist(),
        "torso": None if torso is None else np.asarray(torso, dtype=float).round(4).tolist(),
        "bodies": [_body(body, kept, surfaces) for body in stage.bodies],
    }


def _body(body: Body, kept: NDArray[np.intp], surfaces: bool) -> dict[str, Any]:
    return {
        "name": body.name,
        "skeleton": packed(body.skeleton[kept]),
        "ellipsoids": {role: packed(_upper(matrices[kept])) for role, matrices in body.ellipsoids.items()},
        "path": None if body.path is None else packed(body.path[kept]),
        "parts": [_part(part, kept) for part in body.parts] if surfaces else [],
    }


def _part(part: Part, kept: NDArray[np.intp]) -> dict[str, Any]:
    """Encode a surface with each point once, so that the script finds triangles that meet."""
    corners = np.asarray(part.points, dtype="<f4")[part.triangles].reshape(-1, 3)
    points, places = np.unique(corners, axis=0, return_inverse=True)
    form = "u16" if len(points) <= 2**16 else "u32"
    return {
        "points": packed(points),
        "triangles": packed(places.reshape(-1, 3), form),
        "poses": packed(_seven(part.poses[kept])),
    }


def _seven(poses: Array) -> Array:
    """Positions and unit quaternions x y z w of poses (n, 4, 4), shape (n, 7); (1, 7) where nothing moves."""
    if np.abs(poses - poses[0]).max() < 1e-9:
        poses = poses[:1]
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    back = np.einsum("ni,ni->n", turns[:-1], turns[1:]) < 0
    turns[1:] *= np.cumprod(np.where(back, -1.0, 1.0))[:, None]
    return np.concatenate([poses[:, :3, 3], turns], axis=1)


def _panel(panel: Panel, kept: NDArray[np.intp]) -> dict[str, Any]:
    plain = {
        name: getattr(panel, name) for name in ("title", "unit", "meaning", "logarithmic", "limits", "span", "strip")
    }
    lines = [{"name": line.name, "role": line.role, "style": line.style, "wide": line.wide,
              "values": packed(np.asarray(line.values)[kept])} for line in panel.lines]  # fmt: skip
    return {**plain, "lines": lines}


def _map(chart: DomainMap, kept: NDArray[np.intp]) -> dict[str, Any]:
    return {
        "domains": [_cloud(cloud, np.arange(len(cloud.coordinates))) for cloud in chart.domains],
        "profiles": [_cloud(cloud, kept) for cloud in chart.profiles],
        "note": chart.note,
    }


def _cloud(cloud: Cloud, kept: NDArray[np.intp]) -> dict[str, Any]:
    d = cloud.ellipsoids.shape[-1]
    matrices = np.zeros((len(kept), 3, 3))
    if d <= 3:  # ellipses become flat ellipsoids
        matrices[:, :d, :d] = cloud.ellipsoids[kept]
    return {
        "name": cloud.name,
        "role": cloud.role,
        "coordinates": packed(cloud.coordinates[kept]),
        "ellipsoids": packed(_upper(matrices)) if d <= 3 else None,
    }


def _upper(matrices: Array) -> Array:
    """Entries xx, xy, xz, yy, yz, zz of symmetric matrices (n, 3, 3), shape (n, 6)."""
    rows, columns = np.triu_indices(3)
    return matrices[:, rows, columns]
