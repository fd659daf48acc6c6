"""Arrays as text: what the page's scripts read, thinned out and in single precision."""

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from maniport.subsample import evenly_spaced
from maniport.telling.course import is_gap
from maniport.telling.page.content import Body, Cloud, DomainMap, Line, Motion, Panel, Part
from maniport.telling.page.states import STATES
from maniport.validation import Array

MAX_FRAMES = 1500
"""Most points of time of a motion in a page."""

MAX_DOTS = 1500
"""Most ellipsoids of a domain in a page."""


FORMS = {"f32": "<f4", "u16": "<u2", "u32": "<u4"}
"""How numbers are written, by name."""

STILL = 1e-9
"""Poses that differ by less are one pose [m or 1]."""


def as_json(motion: Motion, frames: int = MAX_FRAMES, *, surfaces: bool = True) -> str:
    """Everything that is drawn of a motion, for a ``<script>`` element that holds data."""
    data = _motion(motion, evenly_spaced(len(motion.time), frames), surfaces)
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")  # nothing in the data may end the element


def packed(array: ArrayLike) -> dict[str, Any]:
    """Shape, and the numbers in single precision, little-endian, row by row, as base64."""
    return _packed(np.asarray(array), "f32")


def packed_indices(array: ArrayLike, count: int) -> dict[str, Any]:
    """Pack indices below `count` in two bytes each where they fit, else in four."""
    return _packed(np.asarray(array), "u16" if count <= 2**16 else "u32")


def _packed(array: NDArray[Any], form: str) -> dict[str, Any]:
    values = np.ascontiguousarray(array, dtype=FORMS[form])
    return {"shape": list(values.shape), form: base64.b64encode(values.tobytes()).decode("ascii")}


def _motion(motion: Motion, kept: NDArray[np.intp], surfaces: bool) -> dict[str, Any]:
    time = motion.time[kept]
    return {
        "start": float(time[0]),
        "time": packed(time - time[0]),
        "gaps": np.flatnonzero(is_gap(np.diff(time))).tolist(),
        "unit": motion.unit,
        "size": float(motion.size),
        "clocks": {name: packed(times[kept]) for name, times in motion.clocks.items()},
        "legend": dict(motion.legend),
        "bodies": [_body(body, kept, surfaces) for body in motion.bodies],
        "panels": {name: [_panel(panel, kept) for panel in panels] for name, panels in motion.panels.items()},
        "map": None if motion.map is None else _map(motion.map, kept),
        "states": _states(motion.states, kept),
        "opening": 0.0 if motion.opening is None else float(motion.opening - time[0]),
    }


def _states(states: tuple[str, ...], kept: NDArray[np.intp]) -> dict[str, Any] | None:
    """Write how a motion goes as numbers of the states that there are."""
    if not states:
        return None
    names = list(STATES)
    return {"names": names, "values": packed_indices([names.index(states[k]) for k in kept], len(names))}


def _body(body: Body, kept: NDArray[np.intp], surfaces: bool) -> dict[str, Any]:
    beside = {"beside": [_body(one, kept, surfaces) for one in body.beside]} if body.beside else {}
    return {
        "name": body.name,
        "skeleton": packed(body.skeleton[kept]),
        "ellipsoids": {role: packed(_six(matrices[kept])) for role, matrices in body.ellipsoids.items()},
        "path": None if body.path is None else packed(body.path[kept]),
        "parts": [_part(part, kept) for part in body.parts] if surfaces else [],
        "turn": None if body.turn is None else np.asarray(body.turn, dtype=float).ravel().tolist(),
        "figure": None if body.figure is None else np.asarray(body.figure, dtype=float).round(4).tolist(),
        **beside,
    }


def _part(part: Part, kept: NDArray[np.intp]) -> dict[str, Any]:
    """Write each point once, so that triangles that meet are known to meet; points of no triangle are left out."""
    corners = np.asarray(part.points, dtype="<f4")[part.triangles].reshape(-1, 3)
    points, places = np.unique(corners, axis=0, return_inverse=True)
    triangles = places.reshape(-1, 3)
    return {
        "points": packed(points),
        "triangles": packed_indices(triangles, len(points)),
        "poses": packed(_seven(part.poses[kept])),
    }


def _seven(poses: Array) -> Array:
    """Positions and unit quaternions x y z w of poses (n, 4, 4), shape (n, 7); (1, 7) where nothing moves."""
    if np.abs(poses - poses[0]).max() < STILL:
        poses = poses[:1]
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    back = np.einsum("ni,ni->n", turns[:-1], turns[1:]) < 0
    turns[1:] *= np.cumprod(np.where(back, -1.0, 1.0))[:, None]
    return np.concatenate([poses[:, :3, 3], turns], axis=1)


def _panel(panel: Panel, kept: NDArray[np.intp]) -> dict[str, Any]:
    return {
        "title": panel.title,
        "unit": panel.unit,
        "meaning": panel.meaning,
        "logarithmic": panel.logarithmic,
        "limits": panel.limits,
        "span": panel.span,
        "strip": panel.strip,
        "lines": [_line(line, kept) for line in panel.lines],
    }


def _line(line: Line, kept: NDArray[np.intp]) -> dict[str, Any]:
    values = packed(np.asarray(line.values)[kept])
    return {"name": line.name, "role": line.role, "style": line.style, "wide": line.wide, "values": values}


def _map(chart: DomainMap, kept: NDArray[np.intp]) -> dict[str, Any]:
    return {
        "domains": [_cloud(cloud, evenly_spaced(len(cloud.coordinates), MAX_DOTS)) for cloud in chart.domains],
        "profiles": [_cloud(cloud, kept) for cloud in chart.profiles],
        "note": chart.note,
    }


def _cloud(cloud: Cloud, kept: NDArray[np.intp]) -> dict[str, Any]:
    shown = cloud.ellipsoids.shape[-1] <= 3
    return {
        "name": cloud.name,
        "role": cloud.role,
        "coordinates": packed(cloud.coordinates[kept]),
        "ellipsoids": packed(_six(_in_space(cloud.ellipsoids[kept]))) if shown else None,
        "outline": [packed(line) for line in cloud.outline],
        "gap": None if cloud.gap is None else packed(cloud.gap[kept]),
    }


def _six(matrices: Array) -> Array:
    """Entries xx, xy, xz, yy, yz, zz of symmetric matrices (n, 3, 3), shape (n, 6)."""
    rows, columns = np.triu_indices(3)
    return matrices[:, rows, columns]


def _in_space(matrices: Array) -> Array:
    """Ellipses in the x-y plane as flat ellipsoids, shape (n, 3, 3)."""
    if matrices.shape[-1] == 3:
        return matrices
    flat = np.zeros((len(matrices), 3, 3))
    flat[:, :2, :2] = matrices
    return flat
