"""What figures draw: curves over time, ellipsoids in rows, and arms in space."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Patch
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from numpy.typing import ArrayLike

from maniport.report.page.animation import semi_axis_panels
from maniport.report.page.content import ACHIEVED, OTHERS, PERSON, ROLES, TARGET, Panel, is_gap
from maniport.spd.ellipsoid import axes
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_choice

COLORS = (PERSON.color, TARGET.color, ACHIEVED.color, *OTHERS)
UNIT = "m/s per rad/s"  # Unit of the semi-axes of velocity ellipsoids J Jᵀ of revolute joints
LINE_STYLES = ("-", "--", ":")
TEXT = 7.0  # Size of letters [pt], in a figure that is printed as wide as it is made

VIEWS = {
    2: {"in the plane (x right, y up)": [0, 1]},
    3: {"from above (x right, y up)": [0, 1], "from the front (y right, z up)": [1, 2]},
}
"""Titles of the views of ellipsoids, and the coordinates to the right and up."""


def curves(time: ArrayLike, profiles: Mapping[str, Array], unit: str = UNIT) -> Figure:
    """Draw the semi-axes of profiles (n, d, d) by role over time [s]."""
    for role in profiles:
        as_choice(role, "role", tuple(ROLES))
    return panel_figure(np.asarray(time), semi_axis_panels(profiles, unit))


def panel_figure(time: Array, panels: Sequence[Panel], columns: int = 1) -> Figure:
    """Draw panels of a page: lines over time [s], with limits shaded."""
    count = -(-len(panels) // columns)
    figure, handles = column_figure(0.6 + 0.62 * count, columns), dict[str, Artist]()
    grid = figure.subplots(count, columns, sharex=True, squeeze=False)
    for item, panel in zip(grid.flat, panels, strict=False):
        for line in panel.lines:
            color, style, width = ROLES[line.role].color, LINE_STYLES[line.style], 3.0 if line.wide else 1.0
            points, alpha = _with_breaks(time, line.values), 0.35 if line.wide else 1.0
            (drawn,) = item.plot(*points, color=color, ls=style, lw=width, alpha=alpha, label=line.name)
            handles |= {line.name: drawn} if len(panel.lines) > 1 else {}
        item.set_title(f"{panel.title} [{panel.unit}]" if panel.unit else panel.title, fontsize=TEXT, loc="left", pad=2)
        if panel.limits is not None and panel.span is not None:
            for ends in zip(panel.limits, panel.span, strict=True):
                item.axhspan(*ends, color="0.85", lw=0)
            item.set_ylim(*panel.span)
        elif panel.logarithmic:
            _logarithmic(item)
    for item in figure.axes[len(panels) :]:
        item.set_visible(False)
    if handles:
        _legend(figure, list(handles.values()))
    for column in grid.T:
        _over_time([item for item in column if item.get_visible()])
    return laid_out(figure)


def ellipsoids(
    time: ArrayLike,
    profiles: Mapping[str, Array],
    unit: str = UNIT,
    axis: str = "time [s]",
    roles: Mapping[str, str] | None = None,
) -> Figure:
    """Draw ellipsoids sampled along time, one row for each profile, seen from above and from the front."""
    times = np.asarray(time)
    frames = evenly_spaced(len(times), 9)
    points = [profile[frames] for profile in profiles.values()]
    reach = float(np.sqrt(max(np.diagonal(row, axis1=1, axis2=2).max() for row in points)))
    # rows differ in grey, too
    looks = list(zip(_colors(profiles, roles), np.linspace(0.45, 0.1, len(profiles)).tolist(), strict=True))
    pitch, views = 2.15 * reach, VIEWS[points[0].shape[-1]]
    places = max(len(frames), 6)  # space for the title of a row of few ellipsoids
    figure = column_figure(0.55 + len(views) * (len(points) * 3.2 / places + 0.3))
    panels = list(figure.subplots(len(views), 1, sharex=True, squeeze=False)[:, 0])
    for panel, (view, plane) in zip(panels, views.items(), strict=True):
        for number, (row, look) in enumerate(zip(points, looks, strict=True)):
            # 2×2 matrices as ellipses, with a stroke along the longest axis
            for k, ((minor, major), directions) in enumerate(zip(*axes(row[:, plane][:, :, plane]), strict=True)):
                center, along = np.array([k * pitch, -pitch * number]), major * directions[:, 1]
                angle = float(np.degrees(np.arctan2(along[1], along[0])))
                panel.plot(*np.stack([center - along, center + along]).T, color=look[0], lw=0.5)
                panel.add_patch(Ellipse(tuple(center), 2 * major, 2 * minor, angle=angle, edgecolor=look[0],
                                        facecolor=look, lw=0.9))  # fmt: skip
        panel.set(aspect="equal", xlim=(-0.5 * pitch, (places - 0.5) * pitch), yticks=[])
        panel.set_ylim(-(len(points) - 0.5) * pitch, 0.5 * pitch)
        panel.set_title(view, fontsize=TEXT, loc="left", pad=2)
        panel.spines[["left", "right", "top"]].set_visible(False)
        panel.tick_params(labelsize=TEXT, length=2)
    decimals = max(0, 1 - int(np.floor(np.log10(np.ptp(times) / len(frames) or 1.0))))
    panels[-1].set_xticks(np.arange(len(frames)) * pitch, [f"{t:.{decimals}f}" for t in times[frames]])
    panels[-1].set_xlabel(axis, fontsize=TEXT)
    power = 10.0 ** np.floor(np.log10(reach))  # a scale bar of round length, above the right end of the first row
    length = power * max((m for m in (1, 2, 5) if m * power <= reach), default=1)
    right, height = (places - 0.5) * pitch, [0.62 * pitch] * 2
    panels[0].plot([right - length, right], height, color="black", lw=1.5, clip_on=False, solid_capstyle="butt")
    text = f"{length:g} {unit}"
    panels[0].text(right - length - 0.1 * pitch, height[0], text, fontsize=TEXT, ha="right", va="center")
    _legend(figure, [Patch(facecolor=look, edgecolor=look[0], linewidth=0.9, label=name)
                     for name, look in zip(profiles, looks, strict=True)])  # fmt: skip
    return laid_out(figure)


def arms(
    skeletons: Mapping[str, Array],
    ellipsoids: Mapping[str, Array],
    count: int = 5,
    size: float = 0.25,
    unit: str = UNIT,
    roles: Mapping[str, str] | None = None,
    within: Mapping[str, str] | None = None,
) -> Figure:
    """Draw arms side by side, each in several configurations; those `within` the same name have one panel."""
    drawn, extents = dict[str, tuple[str, Array, Array]](), dict[str, list[Array]]()
    for name, lines in skeletons.items():
        chosen, title = evenly_spaced(len(lines), count), (within or {}).get(name, name)
        corners, shells = lines[chosen], ellipsoids[name][chosen]
        halves = size * np.sqrt(np.diagonal(shells, axis1=1, axis2=2))
        drawn[name] = title, corners, shells
        extents.setdefault(title, []).extend([corners.reshape(-1, 3), corners[:, -1] - halves, corners[:, -1] + halves])
    points = {title: np.concatenate(extent) for title, extent in extents.items()}
    reach = max(float(np.ptp(extent, axis=0).max()) / 2 for extent in points.values())
    figure = column_figure(height := 0.55 + 3.5 / len(points), layout=None)
    figure.subplots_adjust(left=0.0, right=0.9, bottom=0.24 / height, top=0.98, wspace=0.15)
    made = figure.subplots(1, len(points), squeeze=False, subplot_kw={"projection": "3d"})[0]
    panels: dict[str, Any] = dict(zip(points, made, strict=True))
    polar, around = np.meshgrid(np.linspace(0, np.pi, 13), np.linspace(0, 2 * np.pi, 19), indexing="ij")
    sphere = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)])
    for color, (title, corners, shells) in zip(_colors(drawn, roles), drawn.values(), strict=True):
        opacities = np.linspace(0.25, 1.0, len(corners)) if len(corners) > 1 else np.ones(1)
        for line, shell, opacity in zip(corners, shells, opacities, strict=True):
            panels[title].plot(*line.T, color="0.2", alpha=opacity, lw=1.3, marker="o", ms=1.8, solid_joinstyle="round")
            semi_axes, directions = axes(shell)
            surface = line[-1][:, None, None] + size * np.einsum("ij,jkl->ikl", directions * semi_axes, sphere)
            look: Any = {"color": color, "alpha": 0.2 + 0.3 * opacity, "lw": 0, "rasterized": True}
            panels[title].plot_surface(*surface, **look, rstride=1, cstride=1)
    for title, panel in panels.items():
        middle = 0.5 * (points[title].min(axis=0) + points[title].max(axis=0))
        panel.patch.set_visible(False)  # it would cover labels of the panel before
        panel.set_title(title, fontsize=TEXT, pad=0)
        panel.set_box_aspect((1, 1, 1), zoom=0.95)
        for letter, center in zip("xyz", middle, strict=True):
            getattr(panel, f"set_{letter}lim")(center - reach, center + reach)
            axis = getattr(panel, f"{letter}axis")
            axis.set_label_text(f"{letter} [m]", fontsize=TEXT)
            axis.labelpad = -8
            axis.set_tick_params(labelsize=6.0, pad=-3.5)
            axis.set_major_locator(MaxNLocator(3 if len(panels) < 3 else 2))
        panel.view_init(elev=22, azim=-55)
    scale = f"semi-axes of 1 {unit} are drawn {size:g} m long"
    figure.text(0.5, 0.02, scale, fontsize=TEXT, ha="center", va="bottom")
    return figure


def column_figure(height: float, columns: int = 1, layout: Any = "constrained") -> Figure:
    """Return an empty figure as wide as columns of a two-column paper; `height` in inches."""
    return Figure(figsize=(columns * 3.5, height), dpi=300, layout=layout)


def laid_out(figure: Figure) -> Figure:
    """Compute the layout once, so that all files of the figure have the same."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure


def _colors(names: Iterable[str], roles: Mapping[str, str] | None) -> list[str]:
    """Return the color of each name: of its role, else the next that no role has taken."""
    taken = {name: ROLES[role].color for name, role in (roles or {}).items()}
    free = iter([color for color in COLORS if color not in taken.values()])
    return [taken[name] if name in taken else next(free) for name in names]


def _logarithmic(panel: Axes) -> None:
    """Use a logarithmic axis with few, plain numbers."""
    if not any(np.nanmax(line.get_ydata(), initial=0.0) > 0.0 for line in panel.lines):
        return  # of flat ellipsoids there is nothing to draw
    panel.set_yscale("log")
    low, high = panel.get_ylim()
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0) if high < 50.0 * low else (1.0,)))
    panel.yaxis.set_major_formatter("{x:g}")
    panel.yaxis.set_minor_formatter(NullFormatter())


def _over_time(panels: Sequence[Axes]) -> None:
    """Label the time below the last of stacked panels."""
    panels[-1].set_xlabel("time [s]", fontsize=TEXT)
    panels[-1].xaxis.set_tick_params(labelbottom=True)
    for panel in panels:
        panel.tick_params(labelsize=TEXT, length=2)
        panel.grid(alpha=0.25, lw=0.5)
        panel.margins(x=0.01)


def _with_breaks(time: Array, values: Array) -> tuple[Array, Array]:
    """Insert nan at gaps in time, so that lines break there."""
    jumps = np.flatnonzero(is_gap(np.diff(time))) + 1
    return np.insert(time, jumps, time[jumps - 1]), np.insert(values, jumps, np.nan, axis=0)


def _legend(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put named lines or patches above all panels."""
    letters = [len(str(handle.get_label())) for handle in handles]
    columns = len(handles) if sum(letters) < 45 else 2 if max(letters) < 30 else 1
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, fontsize=TEXT, frameon=False)
