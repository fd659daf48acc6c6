"""Figures for papers: ellipsoids along a motion, curves over time, and arms in space.

Every function returns a `matplotlib.figure.Figure` without a window and without global state, as wide as one column of
a paper. Profiles are mappings from names to arrays. Colors follow roles (``roles=``, as in
`maniport.report.page.content`), else the order. `write_figures` draws the figures of a saved result.
"""

import json
import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import FileFormatError, InvalidInputError, OutputError
from maniport.report.page import content
from maniport.report.page.animation import semi_axis_panels
from maniport.report.page.content import ACHIEVED, OTHERS, PERSON, ROLES, TARGET, Line, Panel
from maniport.report.render import ENDINGS, PAGE
from maniport.spd.ellipsoid import axes
from maniport.util.atomic_io import written_whole
from maniport.util.input_limits import KEYPOINTS_BYTES, read_whole
from maniport.util.optional import matplotlib
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_choice

matplotlib()  # raises MissingPackageError

from matplotlib import rc_context  # noqa: E402
from matplotlib.artist import Artist  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.patches import Ellipse, Patch  # noqa: E402
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter  # noqa: E402
from mpl_toolkits.mplot3d.axes3d import Axes3D  # noqa: E402

# Settings of the user must not change the figures; letters remain letters, which a paper sets in its own font.
SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "maniport",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica"],
    "svg.image_inline": True,
    "savefig.bbox": None,
}

# Without dates and versions the same figure gives the same bytes.
METADATA = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
}

UNIT = "m/s per rad/s"  # Unit of the semi-axes of velocity ellipsoids J Jᵀ of revolute joints
TEXT = 7.0  # Size of letters [pt], in a figure that is printed as wide as it is made

VIEWS = {
    2: {"in the plane (x right, y up)": [0, 1]},
    3: {"from above (x right, y up)": [0, 1], "from the front (y right, z up)": [1, 2]},
}
"""Titles of the views of ellipsoids, and the coordinates to the right and up."""


def save(figure: Figure, path: str | os.PathLike[str]) -> list[Path]:
    """Write a figure, whole or not at all; to PNG and SVG where the path has no ending."""
    target = Path(path)
    if target.suffix and target.suffix.lower() not in METADATA:
        endings = ", ".join(METADATA)
        raise InvalidInputError(
            f"path must end in {endings} or have no ending; found {target.name!r}"
        )
    targets = [target]
    if not target.suffix:
        targets = list(map(target.with_suffix, ENDINGS))
    for file in targets:
        stream = BytesIO()
        ending = file.suffix.lower()
        with rc_context(SETTINGS):
            figure.savefig(stream, format=ending[1:], dpi="figure", metadata=METADATA[ending])
        with written_whole(file) as temporary:
            temporary.write_bytes(stream.getvalue())
    return targets


def write_figures(
    result: str | os.PathLike[str], folder: str | os.PathLike[str] | None = None
) -> list[Path]:
    """Draw the figures of a result that `write_results` saved, from the data of its page, as PNG and SVG.

    Parameters
    ----------
    result : str or path-like
        A folder that `maniport.write_results` has written.
    folder : str or path-like, optional
        Folder for the figures, which is made where it is missing; by default that of the result.

    Returns
    -------
    list of Path

    Raises
    ------
    FileFormatError
        When the folder has no page of a result.
    OutputError
        When the folder cannot be written.
    """
    target = Path(result if folder is None else folder)
    data = _motion(Path(result) / PAGE)
    if data["stages"]:
        drawn = _figures(data)
    else:
        drawn = {"learned": panel_figure(data["time"], _panels(data, data["panels"]))}
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write {str(target)!r}: {error.strerror}") from None
    files: list[Path] = []
    for name, figure in drawn.items():
        files += save(figure, target / name)
    return files


def _motion(page: Path) -> dict[str, Any]:
    """Read the data of the motion in a page."""
    text = read_whole(page, (), KEYPOINTS_BYTES).decode("utf-8", "replace")
    element = r'<script type="application/json" id="motion">(.*?)</script>'
    try:
        match = re.search(element, text, re.DOTALL)
        data = content.unpacked(json.loads(match[1]) if match else None)
        return {**data, "time": data["start"] + data["time"]}
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise FileFormatError(f"{str(page)!r} is not the page of a result: {error}") from None


SHAPE_TOPIC = "Ellipsoids"  # of the curves of semi-axes
ENTRIES = [0, 1, 2, 1, 3, 4, 2, 4, 5]  # of a matrix, among xx, xy, xz, yy, yz, zz


def _figures(data: dict[str, Any]) -> dict[str, Figure]:
    """Draw the figures of a motion from the data of its page."""
    stages = data["stages"]
    columns = 1
    for stage in stages:
        if len(stage["bodies"]) > 1:
            columns = 2
    skeletons = dict[str, Array]()
    shells = dict[str, Array]()
    roles = dict[str, str]()
    within = dict[str, str]()
    rows = dict[str, Array]()
    for stage in stages:
        rotation = np.eye(3)
        if stage["rotation"] is not None:
            rotation = np.reshape(stage["rotation"], (3, 3))
        for k, body in enumerate(stage["bodies"]):
            profiles = _profiles(body)
            if not profiles:
                continue
            name = f"{stage['name']}, arm {k + 1}"
            role = next(reversed(profiles))  # a person's, or the achieved
            skeletons[name] = body["skeleton"]
            shells[name] = profiles.pop(role)
            roles[name] = role
            within[name] = stage["name"]
            if role == PERSON.name:
                profiles = {role: shells[name]} | profiles
            for row, profile in profiles.items():
                rows[row] = rotation.T @ profile @ rotation

    drawn = dict[str, Figure]()
    unit = data["unit"]
    if skeletons:
        drawn["arms"] = arms(
            skeletons,
            shells,
            size=data["size"],
            unit=unit,
            roles=roles,
            within=within,
        )
    if columns == 1 and len(rows) > 1:
        roles_of_rows = {role: role for role in rows}
        drawn["ellipsoids"] = ellipsoids(data["time"], rows, unit=unit, roles=roles_of_rows)
    motion_topics = data["panels"].keys() - {SHAPE_TOPIC, content.HUMAN_JOINTS}
    for name, topics in (("curves", {SHAPE_TOPIC}), ("motion", motion_topics)):
        panels = _panels(data, topics)
        if panels:
            drawn[name] = panel_figure(data["time"], panels, columns)
    return drawn


def _profiles(body: dict[str, Any]) -> dict[str, Array]:
    """Return the ellipsoids (n, 3, 3) of an arm by role."""
    profiles = {}
    for role, entries in body["ellipsoids"].items():
        profiles[role] = entries[:, ENTRIES].reshape(-1, 3, 3)
    return profiles


def _panels(data: dict[str, Any], topics: Collection[str]) -> list[Panel]:
    """Return the panels of some topics."""
    result = []
    for topic, panels in data["panels"].items():
        if topic not in topics:
            continue
        for panel in panels:
            lines = tuple(Line(**line) for line in panel["lines"])
            result.append(Panel(**panel | {"lines": lines}))
    return result


def curves(time: ArrayLike, profiles: Mapping[str, Array], unit: str = UNIT) -> Figure:
    """Draw the semi-axes of profiles (n, d, d) by role over time [s]."""
    checked = {}
    for role, profile in profiles.items():
        checked[as_choice(role, "role", tuple(ROLES))] = profile
    return panel_figure(np.asarray(time), semi_axis_panels(checked, unit))


STYLES = ("-", "--", ":")  # of lines, by number


def panel_figure(time: Array, panels: Sequence[Panel], columns: int = 1) -> Figure:
    """Draw panels of a page: lines over time [s], with limits shaded."""
    row_count = -(-len(panels) // columns)
    figure = column_figure(0.6 + 0.62 * row_count, columns)
    grid = figure.subplots(row_count, columns, sharex=True, squeeze=False)
    handles = dict[str, Artist]()
    for plot, panel in zip(grid.flat, panels, strict=False):
        lines = _plot_lines(plot, time, panel)
        if len(panel.lines) > 1:
            handles |= lines
        title = panel.heading
        if panel.logarithmic:
            title += ", logarithmic axis"
        plot.set_title(title, fontsize=TEXT, loc="left", pad=2)
        _set_value_axis(plot, panel)
        plot.tick_params(labelsize=TEXT, length=2)
        plot.grid(alpha=0.25, lw=0.5)
        plot.margins(x=0.01)

    for plot in figure.axes[len(panels) :]:
        plot.set_visible(False)
    if handles:
        _legend(figure, list(handles.values()))
    first_of_last = max(len(panels) - columns, 0)
    for plot in figure.axes[first_of_last : len(panels)]:  # the last of each column
        plot.set_xlabel("time [s]", fontsize=TEXT)
        plot.xaxis.set_tick_params(labelbottom=True)
    return laid_out(figure)


def _plot_lines(plot: Axes, time: Array, panel: Panel) -> dict[str, Artist]:
    """Plot the lines of a panel, which break at gaps of the time; return them by name."""
    gaps = np.flatnonzero(content.is_gap(np.diff(time))) + 1
    clock = np.insert(time, gaps, time[gaps - 1])
    lines = dict[str, Artist]()
    for line in panel.lines:
        values = np.insert(line.values, gaps, np.nan)
        width = 1.0
        opacity = 1.0
        if line.wide:
            width = 3.0
            opacity = 0.35
        (drawn,) = plot.plot(
            clock,
            values,
            color=ROLES[line.role].color,
            ls=STYLES[line.style],
            lw=width,
            alpha=opacity,
            label=line.name,
        )
        lines[line.name] = drawn
    return lines


def _set_value_axis(plot: Axes, panel: Panel) -> None:
    """Shade values beyond limits, or make the axis logarithmic."""
    if panel.limits is not None and panel.span is not None:
        for limit, end in zip(panel.limits, panel.span, strict=True):
            plot.axhspan(limit, end, color="0.85", lw=0)
        plot.set_ylim(*panel.span)
        return
    is_positive = any(np.nanmax(line.values, initial=0.0) > 0.0 for line in panel.lines)
    if panel.logarithmic and is_positive:
        plot.set_yscale("log")
        low, high = plot.get_ylim()
        subs = [1.0]
        if high < 50.0 * low:
            subs.append(3.0)
        plot.yaxis.set_major_locator(LogLocator(subs=subs))
        plot.yaxis.set_major_formatter("{x:g}")
        plot.yaxis.set_minor_formatter(NullFormatter())


class Look(NamedTuple):
    """Color and opacity of filled ellipses."""

    color: str
    opacity: float


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
    rows = []
    reach = 0.0  # largest half width
    for profile in profiles.values():
        row = profile[frames]
        rows.append(row)
        squares = np.diagonal(row, axis1=1, axis2=2)
        reach = max(reach, float(np.sqrt(squares.max())))
    opacities = np.linspace(0.45, 0.1, len(profiles)).tolist()  # rows differ in grey, too
    looks = []
    for color, opacity in zip(_colors(profiles, roles), opacities, strict=True):
        looks.append(Look(color, opacity))

    pitch = 2.15 * reach
    places = max(len(frames), 6)  # of few ellipsoids there is space for the title of a row
    views = VIEWS[rows[0].shape[-1]]
    figure = column_figure(0.55 + len(views) * (len(rows) * 3.2 / places + 0.3))
    plots = list(figure.subplots(len(views), 1, sharex=True, squeeze=False)[:, 0])
    for plot, (title, plane) in zip(plots, views.items(), strict=True):
        for number, (row, look) in enumerate(zip(rows, looks, strict=True)):
            matrices = row[:, plane][:, :, plane]
            _draw_ellipses(plot, matrices, pitch, -pitch * number, look)
        plot.set(aspect="equal", xlim=(-0.5 * pitch, (places - 0.5) * pitch), yticks=[])
        plot.set_ylim(-(len(rows) - 0.5) * pitch, 0.5 * pitch)
        plot.set_title(title, fontsize=TEXT, loc="left", pad=2)
        plot.spines[["left", "right", "top"]].set_visible(False)
        plot.tick_params(labelsize=TEXT, length=2)

    step = np.ptp(times) / len(frames) or 1.0
    decimals = max(0, 1 - int(np.floor(np.log10(step))))
    tick_labels = [f"{moment:.{decimals}f}" for moment in times[frames]]
    plots[-1].set_xticks(np.arange(len(frames)) * pitch, tick_labels)
    plots[-1].set_xlabel(axis, fontsize=TEXT)
    _draw_scale_bar(plots[0], reach, pitch, (places - 0.5) * pitch, unit)
    patches = []
    for name, look in zip(profiles, looks, strict=True):
        patches.append(Patch(facecolor=look, edgecolor=look.color, linewidth=0.9, label=name))
    _legend(figure, patches)
    return laid_out(figure)


def _draw_ellipses(plot: Axes, matrices: Array, pitch: float, height: float, look: Look) -> None:
    """Draw matrices (n, 2, 2) side by side, each with a stroke along its longest axis."""
    semi_axes, directions = axes(matrices)
    for k, (minor, major) in enumerate(semi_axes):
        center = np.array([k * pitch, height])
        along = major * directions[k][:, 1]
        angle = float(np.degrees(np.arctan2(along[1], along[0])))
        x, y = np.stack([center - along, center + along]).T
        plot.plot(x, y, color=look.color, lw=0.5)
        ellipse = Ellipse(
            (center[0], center[1]),
            2 * major,
            2 * minor,
            angle=angle,
            edgecolor=look.color,
            facecolor=look,
            lw=0.9,
        )
        plot.add_patch(ellipse)


def _draw_scale_bar(plot: Axes, reach: float, pitch: float, right: float, unit: str) -> None:
    """Draw a bar of round length above the right end of the first row."""
    power = 10.0 ** np.floor(np.log10(reach))
    length = power
    for factor in (2, 5):
        if factor * power <= reach:
            length = factor * power
    left = right - length
    height = 0.62 * pitch
    plot.plot(
        [left, right],
        [height, height],
        color="black",
        lw=1.5,
        clip_on=False,
        solid_capstyle="butt",
    )
    text = f"{length:g} {unit}"
    plot.text(left - 0.1 * pitch, height, text, fontsize=TEXT, ha="right", va="center")


def arms(
    skeletons: Mapping[str, Array],
    ellipsoids: Mapping[str, Array],
    count: int = 5,  # configurations
    size: float = 0.25,  # length of a semi-axis of one `unit` [m]
    unit: str = UNIT,
    roles: Mapping[str, str] | None = None,
    within: Mapping[str, str] | None = None,
) -> Figure:
    """Draw arms side by side, each in several configurations; those `within` the same name have one panel."""
    titles = {name: (within or {}).get(name, name) for name in skeletons}
    columns = len(set(titles.values()))
    height = 0.55 + 3.5 / columns
    figure = column_figure(height, layout=None)
    figure.subplots_adjust(left=0.0, right=0.9, bottom=0.24 / height, top=0.98, wspace=0.15)
    made = figure.subplots(1, columns, squeeze=False, subplot_kw={"projection": "3d"})[0]
    plots: dict[str, Axes3D] = dict(zip(dict.fromkeys(titles.values()), made, strict=True))

    for color, (name, lines) in zip(_colors(skeletons, roles), skeletons.items(), strict=True):
        chosen = evenly_spaced(len(lines), count)
        opacities = np.ones(1)
        if len(chosen) > 1:
            opacities = np.linspace(0.25, 1.0, len(chosen))
        shells = ellipsoids[name][chosen]
        for line, shell, opacity in zip(lines[chosen], shells, opacities, strict=True):
            _draw_arm(plots[titles[name]], line, shell, size, color, opacity)

    limits = []
    reach = 0.0
    for plot in plots.values():
        ends = np.array([plot.get_xlim(), plot.get_ylim(), plot.get_zlim()])
        limits.append(ends)
        reach = max(reach, float(np.ptp(ends, axis=1).max()) / 2)
    tick_count = 2
    if columns < 3:
        tick_count = 3
    for (title, plot), ends in zip(plots.items(), limits, strict=True):
        plot.patch.set_visible(False)  # it would cover labels of the panel before
        plot.set_title(title, fontsize=TEXT, pad=0)
        plot.set_box_aspect((1, 1, 1), zoom=0.95)
        _set_space_axes(plot, ends.mean(axis=1), reach, tick_count)
        plot.view_init(elev=22, azim=-55)
    text = f"semi-axes of 1 {unit} are drawn {size:g} m long"
    figure.text(0.5, 0.02, text, fontsize=TEXT, ha="center", va="bottom")
    return figure


def _unit_sphere() -> Array:
    """Return points of a sphere along polar and azimuth angles (3, 13, 19)."""
    angles = np.meshgrid(np.linspace(0, np.pi, 13), np.linspace(0, 2 * np.pi, 19), indexing="ij")
    polar, azimuth = angles
    x = np.sin(polar) * np.cos(azimuth)
    y = np.sin(polar) * np.sin(azimuth)
    return np.stack([x, y, np.cos(polar)])


def _draw_arm(
    plot: Axes3D, line: Array, shell: Array, size: float, color: str, opacity: float
) -> None:
    """Draw one configuration: joints (k, 3) with lines, and the ellipsoid at the last."""
    x, y, z = line.T
    plot.plot(
        x,
        y,
        z,
        color="0.2",
        alpha=opacity,
        lw=1.3,
        marker="o",
        ms=1.8,
        solid_joinstyle="round",
    )
    semi_axes, directions = axes(shell)
    points = np.einsum("ij,jkl->ikl", directions * semi_axes, _unit_sphere())
    x, y, z = line[-1][:, None, None] + size * points
    plot.plot_surface(
        x,
        y,
        z,
        color=color,
        alpha=0.2 + 0.3 * opacity,
        lw=0,
        rasterized=True,
        rstride=1,
        cstride=1,
    )


def _set_space_axes(plot: Axes3D, centers: Array, reach: float, tick_count: int) -> None:
    """Give the axes of space one length and labels."""
    x, y, z = centers
    plot.set_xlim(x - reach, x + reach)
    plot.set_ylim(y - reach, y + reach)
    plot.set_zlim(z - reach, z + reach)
    for letter, axis in zip("xyz", (plot.xaxis, plot.yaxis, plot.zaxis), strict=True):
        axis.set_label_text(f"{letter} [m]", fontsize=TEXT)
        axis.labelpad = -8
        axis.set_tick_params(labelsize=6.0, pad=-3.5)
        axis.set_major_locator(MaxNLocator(tick_count))


def column_figure(
    height: float, columns: int = 1, layout: Literal["constrained"] | None = "constrained"
) -> Figure:
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
    candidates = (PERSON.color, TARGET.color, ACHIEVED.color, *OTHERS)
    free = iter([color for color in candidates if color not in taken.values()])
    colors = []
    for name in names:
        colors.append(taken[name] if name in taken else next(free))
    return colors


def _legend(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put named lines or patches above all panels."""
    letters = [len(str(handle.get_label())) for handle in handles]
    if sum(letters) < 45:
        columns = len(handles)
    elif max(letters) < 30:
        columns = 2
    else:
        columns = 1
    figure.legend(
        handles=handles, loc="outside upper center", ncols=columns, fontsize=TEXT, frameon=False
    )
