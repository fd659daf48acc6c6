"""Ellipsoids in rows along a motion, arms in space, and domains on a map."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.report.figures.curves import (
    LINE_STYLES,
    TEXT,
    UNIT,
    check_names,
    check_profiles,
    colors_of,
    column_figure,
    laid_out,
    legend,
    with_breaks,
)
from maniport.spd.diffusion_map import map_of
from maniport.spd.ellipsoid import axes
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import (
    Array,
    as_count,
    as_finite,
    as_number,
    as_points,
    as_positive_semidefinite,
    as_times,
    require_shape,
)

VIEWS = {
    2: {"in the plane (x right, y up)": [0, 1]},
    3: {"from above (x right, y up)": [0, 1], "from the front (y right, z up)": [1, 2]},
}
"""Titles of the views, and the coordinates to the right and up."""


def ellipsoids(
    time: ArrayLike,
    profiles: Mapping[str, ArrayLike],
    unit: str = UNIT,
    axis: str = "time [s]",
    roles: Mapping[str, str] | None = None,
) -> Figure:
    """Draw ellipsoids sampled along time, one row for each profile, seen from above and from the front."""
    times = as_times(time)
    checked = check_profiles(profiles, len(times))
    frames = evenly_spaced(len(times), 9)
    points = [profile[frames] for profile in checked.values()]
    reach = float(np.sqrt(max(np.diagonal(row, axis1=1, axis2=2).max() for row in points)))
    if reach == 0:
        raise InvalidInputError("there must be an ellipsoid of positive size to draw; all are zero")
    # rows differ in grey, too
    looks = list(zip(colors_of(checked, roles), np.linspace(0.45, 0.1, len(checked)).tolist(), strict=True))
    pitch, views = 2.15 * reach, VIEWS[points[0].shape[-1]]
    places = max(len(frames), 6)  # space for the title of a row of few ellipsoids
    figure = column_figure(0.55 + len(views) * (len(points) * 3.2 / places + 0.3))
    panels = list(figure.subplots(len(views), 1, sharex=True, squeeze=False)[:, 0])
    for panel, (view, plane) in zip(panels, views.items(), strict=True):
        for number, (row, look) in enumerate(zip(points, looks, strict=True)):
            _draw_row(panel, row[:, plane][:, :, plane], look, pitch, -pitch * number)
        panel.set(aspect="equal", xlim=(-0.5 * pitch, (places - 0.5) * pitch), yticks=[])
        panel.set_ylim(-(len(points) - 0.5) * pitch, 0.5 * pitch)
        panel.set_title(view, fontsize=TEXT, loc="left", pad=2)
        panel.spines[["left", "right", "top"]].set_visible(False)
        panel.tick_params(labelsize=TEXT, length=2)
    decimals = max(0, 1 - int(np.floor(np.log10(np.ptp(times) / len(frames) or 1.0))))
    panels[-1].set_xticks(np.arange(len(frames)) * pitch, [f"{t:.{decimals}f}" for t in times[frames]])
    panels[-1].set_xlabel(axis, fontsize=TEXT)
    _scale_bar(panels[0], reach, pitch, (places - 0.5) * pitch, unit)
    legend(figure, [Patch(facecolor=look, edgecolor=look[0], linewidth=0.9, label=name)
                    for name, look in zip(checked, looks, strict=True)])  # fmt: skip
    return laid_out(figure)


def _draw_row(panel: Axes, blocks: Array, look: tuple[str, float], pitch: float, height: float) -> None:
    """Draw 2×2 matrices as ellipses in a row, with a stroke along the longest axis; `look`: color and opacity."""
    for k, ((minor, major), directions) in enumerate(zip(*axes(blocks), strict=True)):
        center, along = np.array([k * pitch, height]), major * directions[:, 1]
        angle = float(np.degrees(np.arctan2(along[1], along[0])))
        outline = Ellipse(tuple(center), 2 * major, 2 * minor, angle=angle, edgecolor=look[0], facecolor=look, lw=0.9)
        panel.plot(*np.stack([center - along, center + along]).T, color=look[0], lw=0.5)
        panel.add_patch(outline)


def _scale_bar(panel: Axes, reach: float, pitch: float, right: float, unit: str) -> None:
    """Draw a bar of round length above the right end of the first row."""
    power = 10.0 ** np.floor(np.log10(reach))
    length = power * max((m for m in (1, 2, 5) if m * power <= reach), default=1)
    height = 0.62 * pitch
    panel.plot([right - length, right], [height, height], color="black", lw=1.5, clip_on=False, solid_capstyle="butt")
    panel.text(right - length - 0.1 * pitch, height, f"{length:g} {unit}", fontsize=TEXT, ha="right", va="center")


def arms(
    skeletons: Mapping[str, ArrayLike],
    ellipsoids: Mapping[str, ArrayLike],
    count: int = 5,
    size: float = 0.25,
    unit: str = UNIT,
    roles: Mapping[str, str] | None = None,
    within: Mapping[str, str] | None = None,
) -> Figure:
    """Draw arms side by side, each in several configurations; those `within` the same name have one panel."""
    as_number(size, "size", above=0.0)
    most = as_count(count, "count")
    drawn = {name: _check(name, lines, ellipsoids, most) for name, lines in check_names(skeletons, "skeletons").items()}
    panel_of = {name: (within or {}).get(name, name) for name in drawn}
    points = {title: np.concatenate([_extent(*drawn[name], size) for name in drawn if panel_of[name] == title])
              for title in dict.fromkeys(panel_of.values())}  # fmt: skip
    reach = max(float(np.ptp(extent, axis=0).max()) / 2 for extent in points.values())
    figure = column_figure(0.5 + 3.5 / len(points), layout=None)
    figure.subplots_adjust(left=0.0, right=0.9, bottom=0.12, top=0.98, wspace=0.15)
    made = figure.subplots(1, len(points), squeeze=False, subplot_kw={"projection": "3d"})[0]
    panels: dict[str, Any] = dict(zip(points, made, strict=True))
    for color, (name, (corners, shells)) in zip(colors_of(drawn, roles), drawn.items(), strict=True):
        opacities = np.linspace(0.25, 1.0, len(corners)) if len(corners) > 1 else np.ones(1)
        for line, shell, opacity in zip(corners, shells, opacities, strict=True):
            panel = panels[panel_of[name]]
            panel.plot(*line.T, color="0.2", alpha=opacity, lw=1.3, marker="o", ms=1.8, solid_joinstyle="round")
            look: Any = {"color": color, "alpha": 0.2 + 0.3 * opacity, "lw": 0, "rasterized": True}
            panel.plot_surface(*_shell(line[-1], shell, size), **look, rstride=1, cstride=1)
    for title, panel in panels.items():
        middle = 0.5 * (points[title].min(axis=0) + points[title].max(axis=0))
        panel.set_title(title, fontsize=TEXT, pad=0)
        panel.set_box_aspect((1, 1, 1), zoom=0.95)
        for letter, center in zip("xyz", middle, strict=True):
            getattr(panel, f"set_{letter}lim")(center - reach, center + reach)
            axis = getattr(panel, f"{letter}axis")
            axis.set_label_text(f"{letter} [m]", fontsize=TEXT)
            axis.labelpad = -8
            axis.set_tick_params(labelsize=6.0, pad=-3.5)
            axis.set_major_locator(MaxNLocator(3))
        panel.view_init(elev=22, azim=-55)
    scale = f"semi-axes of 1 {unit} are drawn {size:g} m long"
    figure.text(0.5, 0.02, scale, fontsize=TEXT, ha="center", va="bottom")
    return figure


def _check(name: str, lines: ArrayLike, ellipsoids: Mapping[str, ArrayLike], count: int) -> tuple[Array, Array]:
    """Check one arm's polylines (n, k, 3) and ellipsoids (n, 3, 3), and select the configurations to draw."""
    corners = as_finite(lines, f"skeletons[{name!r}]")
    require_shape(corners, f"skeletons[{name!r}]", ("n", "k", 3))
    if name not in ellipsoids:
        raise InvalidInputError(f"ellipsoids must have the names of skeletons; {name!r} is missing")
    shells = as_positive_semidefinite(ellipsoids[name], f"ellipsoids[{name!r}]", 3)
    require_shape(shells, f"ellipsoids[{name!r}]", (len(corners), 3, 3), ", one for each configuration")
    chosen = evenly_spaced(len(corners), count)
    return corners[chosen], shells[chosen]


def _extent(corners: Array, shells: Array, size: float) -> Array:
    """Points that bound skeletons and ellipsoids, shape (m, 3)."""
    halves = size * np.sqrt(np.diagonal(shells, axis1=1, axis2=2))
    return np.concatenate([corners.reshape(-1, 3), corners[:, -1] - halves, corners[:, -1] + halves])


def _shell(center: Array, matrix: Array, size: float) -> Array:
    """Surface of an ellipsoid, shape (3, 13, 19)."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, 13), np.linspace(0, 2 * np.pi, 19), indexing="ij")
    sphere = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)])
    semi_axes, directions = axes(matrix)
    return np.asarray(center[:, None, None] + size * np.einsum("ij,jkl->ikl", directions * semi_axes, sphere))


def diffusion_map(domains: Mapping[str, ArrayLike], profiles: Mapping[str, ArrayLike]) -> Figure:
    """Draw domains as clouds and profiles as lines in two diffusion coordinates."""
    clouds, lines, d = dict[str, Array](), dict[str, Array](), None
    for name, points in check_names(domains, "domains").items():
        clouds[name] = as_points(points, f"domains[{name!r}]", d, 2)
        d = clouds[name].shape[-1]
    for name, points in profiles.items():
        lines[name] = as_points(points, f"profiles[{name!r}]", d, 1)
    chart = map_of([*clouds.values(), *lines.values()])
    placed, paths = ({name: chart.transform(one) for name, one in sets.items()} for sets in (clouds, lines))
    return map_figure(placed, paths)


def map_figure(
    domains: Mapping[str, Array],
    profiles: Mapping[str, Array],
    time: Array | None = None,
    roles: Mapping[str, str] | None = None,
) -> Figure:
    """Draw coordinates (n, 2) of domains as clouds and those of profiles as lines."""
    figure = column_figure(3.2)
    panel = figure.subplots()
    handles = []
    for color, (name, points) in zip(colors_of(domains, roles), domains.items(), strict=True):
        panel.scatter(points[:, 0], points[:, 1], s=2, color=color, alpha=0.25, lw=0, rasterized=True)
        handles.append(Line2D([], [], color=color, marker="o", alpha=0.5, ms=3, ls="", label=f"domain: {name}"))
    styles = ("-", *LINE_STYLES, *LINE_STYLES)
    for color, style, (name, path) in zip(colors_of(profiles, roles), styles, profiles.items(), strict=False):
        points = path if time is None else with_breaks(time, path)[1]
        panel.plot(*points.T, color="white", lw=1.8)
        panel.plot(*points.T, color=color, lw=1.0, ls=style)
        panel.plot(*path[0], "o", color=color, mec="white", mew=0.6, ms=5)
        handles.append(Line2D([], [], color=color, lw=1.0, ls=style, label=f"profile: {name}"))
    if profiles:
        handles.append(Line2D([], [], color="0.3", marker="o", ls="", ms=4, label="start of a profile"))
    panel.set_xlabel("first diffusion coordinate", fontsize=TEXT)
    panel.set_ylabel("second diffusion coordinate", fontsize=TEXT)
    panel.tick_params(labelsize=TEXT)
    legend(figure, handles)
    return laid_out(figure)
