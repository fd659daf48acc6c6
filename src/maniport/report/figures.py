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
from typing import Any

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
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.patches import Ellipse, Patch  # noqa: E402
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter  # noqa: E402

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
        raise InvalidInputError(
            f"path must end in {', '.join(METADATA)} or have no ending; found {target.name!r}"
        )
    targets = [target] if target.suffix else [target.with_suffix(ending) for ending in ENDINGS]
    for file in targets:
        stream, ending = BytesIO(), file.suffix.lower()
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
    figure = None if data["stages"] else panel_figure(data["time"], _panels(data, data["panels"]))
    drawn = _figures(data) if figure is None else {"learned": figure}
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write {str(target)!r}: {error.strerror}") from None
    return [file for name, figure in drawn.items() for file in save(figure, target / name)]


def _motion(page: Path) -> dict[str, Any]:
    """Read the data of the motion in a page."""
    text = read_whole(page, (), KEYPOINTS_BYTES).decode("utf-8", "replace")
    try:
        match = re.search(
            r'<script type="application/json" id="motion">(.*?)</script>', text, re.DOTALL
        )
        data = content.unpacked(json.loads(match[1]) if match else None)
        return {**data, "time": data["start"] + data["time"]}
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise FileFormatError(f"{str(page)!r} is not the page of a result: {error}") from None


def _figures(data: dict[str, Any], shape: str = "Ellipsoids") -> dict[str, Figure]:
    """Draw the figures of a motion from the data of its page; `shape`: topic of the curves of semi-axes."""
    time, unit, columns = (
        data["time"],
        data["unit"],
        1 + any(len(stage["bodies"]) > 1 for stage in data["stages"]),
    )
    skeletons, shells, rows = dict[str, Array](), dict[str, Array](), dict[str, Array]()
    roles, within, drawn = dict[str, str](), dict[str, str](), dict[str, Figure]()
    matrix = [0, 1, 2, 1, 3, 4, 2, 4, 5]  # entries among xx, xy, xz, yy, yz, zz
    for stage in data["stages"]:
        rotation = np.eye(3) if stage["rotation"] is None else np.reshape(stage["rotation"], (3, 3))
        for k, body in enumerate(stage["bodies"]):
            profiles = {
                role: six[:, matrix].reshape(-1, 3, 3) for role, six in body["ellipsoids"].items()
            }
            if profiles:
                name, role = (
                    f"{stage['name']}, arm {k + 1}",
                    next(reversed(profiles)),
                )  # a person's, or the achieved
                skeletons[name], shells[name], roles[name] = (
                    body["skeleton"],
                    profiles.pop(role),
                    role,
                )
                within[name] = stage["name"]
                person = {role: shells[name]} if role == PERSON.name else {}
                rows |= {
                    role: rotation.T @ own @ rotation for role, own in (person | profiles).items()
                }
    if skeletons:
        drawn["arms"] = arms(
            skeletons, shells, size=data["size"], unit=unit, roles=roles, within=within
        )
    if columns == 1 and len(rows) > 1:
        drawn["ellipsoids"] = ellipsoids(time, rows, unit=unit, roles={role: role for role in rows})
    for name, topics in (
        ("curves", {shape}),
        ("motion", data["panels"].keys() - {shape, content.HUMAN_JOINTS}),
    ):
        if panels := _panels(data, topics):
            drawn[name] = panel_figure(time, panels, columns)
    return drawn


def _panels(data: dict[str, Any], topics: Collection[str]) -> list[Panel]:
    """Return the panels of some topics."""
    return [
        Panel(**panel | {"lines": tuple(Line(**line) for line in panel["lines"])})
        for topic, panels in data["panels"].items() if topic in topics for panel in panels
    ]  # fmt: skip


def curves(time: ArrayLike, profiles: Mapping[str, Array], unit: str = UNIT) -> Figure:
    """Draw the semi-axes of profiles (n, d, d) by role over time [s]."""
    checked = {as_choice(role, "role", tuple(ROLES)): profile for role, profile in profiles.items()}
    return panel_figure(np.asarray(time), semi_axis_panels(checked, unit))


def panel_figure(time: Array, panels: Sequence[Panel], columns: int = 1) -> Figure:
    """Draw panels of a page: lines over time [s], with limits shaded."""
    count = -(-len(panels) // columns)
    figure, handles = column_figure(0.6 + 0.62 * count, columns), dict[str, Artist]()
    grid = figure.subplots(count, columns, sharex=True, squeeze=False)
    gaps = np.flatnonzero(content.is_gap(np.diff(time))) + 1  # lines break there
    clock = np.insert(time, gaps, time[gaps - 1])
    for item, panel in zip(grid.flat, panels, strict=False):
        for line in panel.lines:
            color, style, width = (
                ROLES[line.role].color,
                ("-", "--", ":")[line.style],
                3.0 if line.wide else 1.0,
            )
            values, alpha = np.insert(line.values, gaps, np.nan), 0.35 if line.wide else 1.0
            (drawn,) = item.plot(
                clock, values, color=color, ls=style, lw=width, alpha=alpha, label=line.name
            )
            handles |= {line.name: drawn} if len(panel.lines) > 1 else {}
        item.set_title(
            f"{panel.title} [{panel.unit}]" if panel.unit else panel.title,
            fontsize=TEXT,
            loc="left",
            pad=2,
        )
        if panel.limits is not None and panel.span is not None:
            for ends in zip(panel.limits, panel.span, strict=True):
                item.axhspan(*ends, color="0.85", lw=0)
            item.set_ylim(*panel.span)
        elif panel.logarithmic and any(
            np.nanmax(line.values, initial=0.0) > 0.0 for line in panel.lines
        ):
            item.set_yscale("log")
            low, high = item.get_ylim()
            item.yaxis.set_major_locator(
                LogLocator(subs=(1.0, 3.0) if high < 50.0 * low else (1.0,))
            )
            item.yaxis.set_major_formatter("{x:g}")
            item.yaxis.set_minor_formatter(NullFormatter())
        item.tick_params(labelsize=TEXT, length=2)
        item.grid(alpha=0.25, lw=0.5)
        item.margins(x=0.01)
    for item in figure.axes[len(panels) :]:
        item.set_visible(False)
    if handles:
        _legend(figure, list(handles.values()))
    for item in figure.axes[max(len(panels) - columns, 0) : len(panels)]:  # the last of each column
        item.set_xlabel("time [s]", fontsize=TEXT)
        item.xaxis.set_tick_params(labelbottom=True)
    return laid_out(figure)


def ellipsoids(
    time: ArrayLike,
    profiles: Mapping[str, Array],
    unit: str = UNIT,
    axis: str = "time [s]",
    roles: Mapping[str, str] | None = None,
) -> Figure:
    """Draw ellipsoids sampled along time, one row for each profile, seen from above and from the front."""
    times, frames = np.asarray(time), evenly_spaced(len(np.asarray(time)), 9)
    points = [profile[frames] for profile in profiles.values()]
    reach = float(np.sqrt(max(np.diagonal(row, axis1=1, axis2=2).max() for row in points)))
    # rows differ in grey, too
    looks = list(
        zip(_colors(profiles, roles), np.linspace(0.45, 0.1, len(profiles)).tolist(), strict=True)
    )
    # of few ellipsoids there is space for the title of a row
    pitch, views, places = 2.15 * reach, VIEWS[points[0].shape[-1]], max(len(frames), 6)
    figure = column_figure(0.55 + len(views) * (len(points) * 3.2 / places + 0.3))
    panels = list(figure.subplots(len(views), 1, sharex=True, squeeze=False)[:, 0])
    for panel, (view, plane) in zip(panels, views.items(), strict=True):
        for number, (row, look) in enumerate(zip(points, looks, strict=True)):
            # 2×2 matrices as ellipses, with a stroke along the longest axis
            for k, ((minor, major), directions) in enumerate(
                zip(*axes(row[:, plane][:, :, plane]), strict=True)
            ):
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
    panels[-1].set_xticks(
        np.arange(len(frames)) * pitch, [f"{t:.{decimals}f}" for t in times[frames]]
    )
    panels[-1].set_xlabel(axis, fontsize=TEXT)
    power = 10.0 ** np.floor(
        np.log10(reach)
    )  # a scale bar of round length, above the right end of the first row
    length = power * max((m for m in (1, 2, 5) if m * power <= reach), default=1)
    right, height = (places - 0.5) * pitch, 0.62 * pitch
    panels[0].plot(
        [right - length, right],
        2 * [height],
        color="black",
        lw=1.5,
        clip_on=False,
        solid_capstyle="butt",
    )
    panels[0].text(
        right - length - 0.1 * pitch,
        height,
        f"{length:g} {unit}",
        fontsize=TEXT,
        ha="right",
        va="center",
    )
    _legend(figure, [Patch(facecolor=look, edgecolor=look[0], linewidth=0.9, label=name)
                     for name, look in zip(profiles, looks, strict=True)])  # fmt: skip
    return laid_out(figure)


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
    figure = column_figure(height := 0.55 + 3.5 / columns, layout=None)
    figure.subplots_adjust(left=0.0, right=0.9, bottom=0.24 / height, top=0.98, wspace=0.15)
    made = figure.subplots(1, columns, squeeze=False, subplot_kw={"projection": "3d"})[0]
    panels: dict[str, Any] = dict(zip(dict.fromkeys(titles.values()), made, strict=True))
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, 13), np.linspace(0, 2 * np.pi, 19), indexing="ij"
    )
    sphere = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)]
    )
    for color, (name, lines) in zip(_colors(skeletons, roles), skeletons.items(), strict=True):
        chosen, panel = evenly_spaced(len(lines), count), panels[titles[name]]
        opacities = np.linspace(0.25, 1.0, len(chosen)) if len(chosen) > 1 else np.ones(1)
        for line, shell, opacity in zip(
            lines[chosen], ellipsoids[name][chosen], opacities, strict=True
        ):
            panel.plot(
                *line.T,
                color="0.2",
                alpha=opacity,
                lw=1.3,
                marker="o",
                ms=1.8,
                solid_joinstyle="round",
            )
            semi_axes, directions = axes(shell)
            surface = line[-1][:, None, None] + size * np.einsum(
                "ij,jkl->ikl", directions * semi_axes, sphere
            )
            look: Any = {"color": color, "alpha": 0.2 + 0.3 * opacity, "lw": 0, "rasterized": True}
            panel.plot_surface(*surface, **look, rstride=1, cstride=1)
    limits = [
        np.array([getattr(panel, f"get_{letter}lim")() for letter in "xyz"])
        for panel in panels.values()
    ]
    reach = max(float(np.ptp(ends, axis=1).max()) / 2 for ends in limits)
    for (title, panel), ends in zip(panels.items(), limits, strict=True):
        panel.patch.set_visible(False)  # it would cover labels of the panel before
        panel.set_title(title, fontsize=TEXT, pad=0)
        panel.set_box_aspect((1, 1, 1), zoom=0.95)
        for letter, center in zip("xyz", ends.mean(axis=1), strict=True):
            getattr(panel, f"set_{letter}lim")(center - reach, center + reach)
            axis = getattr(panel, f"{letter}axis")
            axis.set_label_text(f"{letter} [m]", fontsize=TEXT)
            axis.labelpad = -8
            axis.set_tick_params(labelsize=6.0, pad=-3.5)
            axis.set_major_locator(MaxNLocator(3 if columns < 3 else 2))
        panel.view_init(elev=22, azim=-55)
    figure.text(
        0.5,
        0.02,
        f"semi-axes of 1 {unit} are drawn {size:g} m long",
        fontsize=TEXT,
        ha="center",
        va="bottom",
    )
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
    colors = (PERSON.color, TARGET.color, ACHIEVED.color, *OTHERS)
    free = iter([color for color in colors if color not in taken.values()])
    return [taken[name] if name in taken else next(free) for name in names]


def _legend(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put named lines or patches above all panels."""
    letters = [len(str(handle.get_label())) for handle in handles]
    columns = len(handles) if sum(letters) < 45 else 1 + (max(letters) < 30)
    figure.legend(
        handles=handles, loc="outside upper center", ncols=columns, fontsize=TEXT, frameon=False
    )
