"""Domains and profiles in the plane of two diffusion coordinates."""

from collections.abc import Mapping
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.subsample import evenly_spaced
from maniport.telling.diffusion import DOTS, FITTED, DiffusionMap, map_of, outline
from maniport.telling.figures.style import (
    LINE_STYLES,
    TEXT,
    check_names,
    colors_of,
    column_figure,
    laid_out,
    line_widths,
    with_breaks,
)
from maniport.validation import Array, as_count, as_points, as_times


def diffusion_map(
    domains: Mapping[str, ArrayLike],
    profiles: Mapping[str, ArrayLike],
    time: ArrayLike | None = None,
    max_points: int = FITTED,
    max_dots: int = DOTS,
    roles: Mapping[str, str] | None = None,
    chart: DiffusionMap | None = None,
    places: Mapping[str, Array] | None = None,
) -> Figure:
    """Draw domains as clouds and profiles as lines in two diffusion coordinates."""
    dots = as_count(max_dots, "max_dots")
    clouds = _sets_of_points(domains, "domains", minimum=2)
    d = next(iter(clouds.values())).shape[-1]
    lines = _sets_of_points(profiles, "profiles", minimum=1, dimension=d) if len(profiles) else {}
    times = {name: np.arange(float(len(x))) if time is None else _time_of(time, name, x) for name, x in lines.items()}
    fitted = as_count(max_points, "max_points", minimum=4)
    shared = map_of([*clouds.values(), *lines.values()], fitted) if chart is None else chart
    figure = column_figure(3.2)
    panel = figure.subplots()
    handles = []
    looks = zip(colors_of(clouds, roles), cycle(LINE_STYLES), clouds.items(), strict=False)
    for (color, pale), style, (name, points) in looks:
        cloud = shared.transform(points[evenly_spaced(len(points), dots)]) if places is None else places[name]
        panel.scatter(cloud[:, 0], cloud[:, 1], s=2, color=pale, alpha=0.5, lw=0, rasterized=True)
        panel.add_collection(LineCollection(outline(cloud), colors=color, linestyles=style, lw=0.8, alpha=0.8))
        look: Any = {"color": color, "lw": 0.8, "ls": style, "marker": "o", "mfc": pale, "mec": pale, "ms": 3}
        handles.append(Line2D([], [], **look, label=f"domain: {name}"))
    paths = {name: with_breaks(times[name], shared.transform(points))[1] for name, points in lines.items()}
    widths = [0.75 * width for width in line_widths(len(lines))]  # long profiles cross themselves often
    for width, path in zip(widths, paths.values(), strict=True):
        panel.plot(*path.T, color="white", lw=width + 0.8)  # below all lines, so that equal ones show through
    # person and robot first, then the steps between them, which may be equal
    styles = ("-", "-", *LINE_STYLES, *LINE_STYLES)
    for (color, _), width, style, (name, path) in zip(
        colors_of(paths, roles), widths, styles, paths.items(), strict=False
    ):
        panel.plot(*path.T, color=color, lw=width, ls=style)
        for end, marker in ((path[0], "o"), (path[-1], "s")):
            panel.plot(end[0], end[1], marker, color=color, mec="white", mew=0.6, ms=5)
        handles.append(Line2D([], [], color=color, lw=width, ls=style, label=f"profile: {name}"))
    if lines:
        handles.append(Line2D([], [], color="0.3", marker="o", ls="", ms=4, label="start of a profile"))
        handles.append(Line2D([], [], color="0.3", marker="s", ls="", ms=4, label="its end"))
    handles.append(Line2D([], [], color="0.3", lw=0.8, label="line around 90 % of a domain"))
    panel.set_xlabel("first diffusion coordinate", fontsize=TEXT)
    panel.set_ylabel("second diffusion coordinate", fontsize=TEXT)
    panel.tick_params(labelsize=TEXT)
    columns = 2 if max(len(str(handle.get_label())) for handle in handles) < 36 else 1
    if columns == 2:
        handles = handles[::2] + handles[1::2]  # matplotlib fills one column after the other
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, fontsize=TEXT, frameon=False)
    return laid_out(figure)


def _sets_of_points(
    sets: Mapping[str, ArrayLike], argument: str, minimum: int, dimension: int | None = None
) -> dict[str, Array]:
    """Check named sets of SPD matrices, all of one size."""
    checked: dict[str, Array] = {}
    for name, points in check_names(sets, argument).items():
        checked[name] = as_points(points, f"{argument}[{name!r}]", dimension, minimum)
        dimension = checked[name].shape[-1]
    return checked


def _time_of(time: ArrayLike, name: str, points: Array) -> Array:
    times = as_times(time)
    if len(times) != len(points):
        raise InvalidInputError(f"profiles[{name!r}] must hold {len(times)} matrices as time does; found {len(points)}")
    return times
