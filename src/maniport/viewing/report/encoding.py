"""Arrays as text: what the page's scripts read, thinned out and in single precision."""

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.validation import Array
from maniport.viewing.report.content import Cloud, DomainMap, Motion, Panel
from maniport.viewing.style import is_gap

MAX_FRAMES = 1500
"""Most points of time of a motion in a page."""

MAX_DOTS = 1500
"""Most ellipsoids of a domain in a page."""


def as_json(motion: Motion) -> str:
    """Everything that is drawn of a motion, for a ``<script>`` element that holds data."""
    text = json.dumps(_motion(motion), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")  # nothing in the data may end the element


def packed(array: ArrayLike) -> dict[str, Any]:
    """Shape, and the numbers in single precision, little-endian, row by row, as base64."""
    values = np.ascontiguousarray(array, dtype="<f4")
    return {"shape": list(values.shape), "f32": base64.b64encode(values.tobytes()).decode("ascii")}


def unpacked(entry: dict[str, Any]) -> NDArray[np.float32]:
    """Arrays as the page's scripts see them; undoes `packed`."""
    return np.frombuffer(base64.b64decode(entry["f32"]), dtype="<f4").reshape(entry["shape"])


def evenly(count: int, most: int) -> NDArray[np.intp]:
    """Indices of at most so many of `count` entries, first and last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _motion(motion: Motion) -> dict[str, Any]:
    kept = evenly(len(motion.time), MAX_FRAMES)
    time = motion.time[kept]
    return {
        "start": float(time[0]),
        "time": packed(time - time[0]),
        "gaps": np.flatnonzero(is_gap(np.diff(time))).tolist(),
        "unit": motion.unit,
        "size": float(motion.size),
        "clocks": dict(motion.clocks),
        "legend": dict(motion.legend),
        "bodies": [
            {
                "name": body.name,
                "skeleton": packed(body.skeleton[kept]),
                "ellipsoids": {role: packed(_six(matrices[kept])) for role, matrices in body.ellipsoids.items()},
                "path": None if body.path is None else packed(body.path[kept]),
            }
            for body in motion.bodies
        ],
        "panels": {name: [_panel(panel, kept) for panel in panels] for name, panels in motion.panels.items()},
        "map": None if motion.map is None else _map(motion.map, kept),
    }


def _panel(panel: Panel, kept: NDArray[np.intp]) -> dict[str, Any]:
    return {
        "title": panel.title,
        "unit": panel.unit,
        "meaning": panel.meaning,
        "logarithmic": panel.logarithmic,
        "limits": panel.limits,
        "span": panel.span,
        "lines": [
            {"name": line.name, "role": line.role, "style": line.style, "values": packed(np.asarray(line.values)[kept])}
            for line in panel.lines
        ],
    }


def _map(chart: DomainMap, kept: NDArray[np.intp]) -> dict[str, Any]:
    return {
        "domains": [_cloud(cloud, evenly(len(cloud.coordinates), MAX_DOTS)) for cloud in chart.domains],
        "profiles": [_cloud(cloud, kept) for cloud in chart.profiles],
    }


def _cloud(cloud: Cloud, kept: NDArray[np.intp]) -> dict[str, Any]:
    shown = cloud.ellipsoids.shape[-1] <= 3
    return {
        "name": cloud.name,
        "role": cloud.role,
        "coordinates": packed(cloud.coordinates[kept]),
        "ellipsoids": packed(_six(_in_space(cloud.ellipsoids[kept]))) if shown else None,
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
