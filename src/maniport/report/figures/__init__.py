"""Figures for papers: ellipsoids along a motion, curves over time, and arms in space.

Every function returns a `matplotlib.figure.Figure` without a window and without global state, as wide as one column of
a paper. Profiles are mappings from names to arrays. Colors follow roles (``roles=``, as in
`maniport.report.page.content`), else the order. `write_figures` draws the figures of a saved result.
"""

import json
import os
import re
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from maniport.errors import FileFormatError, InvalidInputError, OutputError
from maniport.report.page.content import ACHIEVED, HUMAN_JOINTS, PERSON, Line, Panel, unpacked
from maniport.report.renderings import ENDINGS, LEARNED, PAGE
from maniport.util.atomic_io import written_whole
from maniport.util.input_limits import KEYPOINTS_BYTES, read_whole
from maniport.util.optional import matplotlib
from maniport.util.validation import Array

matplotlib()  # raises MissingPackageError

from matplotlib import rc_context  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from maniport.report.figures.drawing import (  # noqa: E402
    arms,
    curves,
    ellipsoids,
    panel_figure,
)

__all__ = [
    "arms", "curves", "ellipsoids", "panel_figure", "save", "write_figures",
]  # fmt: skip

# Settings of the user must not change the figures; letters remain letters, which a paper sets in its own font.
SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "maniport",
    "pdf.fonttype": 42,
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica"],
    "svg.image_inline": True,
    "savefig.bbox": None,
}

# Without dates and versions the same figure gives the same bytes.
METADATA = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


def save(figure: Figure, path: str | os.PathLike[str]) -> list[Path]:
    """Write a figure, whole or not at all; to PNG and SVG where the path has no ending."""
    target = Path(path)
    if target.suffix and target.suffix.lower() not in METADATA:
        raise InvalidInputError(f"path must end in {', '.join(METADATA)} or have no ending; found {target.name!r}")
    targets = [target] if target.suffix else [target.with_suffix(ending) for ending in ENDINGS]
    for file in targets:
        stream, ending = BytesIO(), file.suffix.lower()
        with rc_context(SETTINGS):
            figure.savefig(stream, format=ending[1:], dpi="figure", metadata=METADATA[ending])
        with written_whole(file) as temporary:
            temporary.write_bytes(stream.getvalue())
    return targets


def write_figures(result: str | os.PathLike[str], folder: str | os.PathLike[str] | None = None) -> list[Path]:
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
    drawn = {LEARNED: panel_figure(data["time"], _panels(data))} if not data["stages"] else _figures(data)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write {str(target)!r}: {error.strerror}") from None
    return [file for name, figure in drawn.items() for file in save(figure, target / name)]


def _motion(page: Path) -> dict[str, Any]:
    """Read the data of the motion in a page."""
    text = read_whole(page, (), KEYPOINTS_BYTES).decode("utf-8", "replace")
    match = re.search(r'<script type="application/json" id="motion">(.*?)</script>', text, re.DOTALL)
    try:
        data = unpacked(json.loads(match[1]) if match else None)
        return {**data, "time": data["start"] + data["time"]}
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise FileFormatError(f"{str(page)!r} is not the page of a result: {error}") from None


def _figures(data: dict[str, Any], shape: str = "Ellipsoids") -> dict[str, Figure]:
    """Draw the figures of a motion from the data of its page; `shape`: topic of the curves of semi-axes."""
    time, unit, columns = data["time"], data["unit"], 1 + any(len(stage["bodies"]) > 1 for stage in data["stages"])
    skeletons, shells, rows = dict[str, Array](), dict[str, Array](), dict[str, Array]()
    roles, within, drawn = dict[str, str](), dict[str, str](), dict[str, Figure]()
    for stage, k, body, profiles in _bodies(data):
        name, role = f"{stage['name']}, arm {k + 1}", PERSON.name if PERSON.name in profiles else ACHIEVED.name
        skeletons[name], shells[name], roles[name], within[name] = body["skeleton"], profiles[role], role, stage["name"]
        rotation = np.eye(3) if stage["rotation"] is None else np.reshape(stage["rotation"], (3, 3))
        back = {role: rotation.T @ own @ rotation for role, own in profiles.items()}  # in the frame of the person
        rows |= {role: own for role, own in back.items() if role != ACHIEVED.name}
    if skeletons:
        drawn["arms"] = arms(skeletons, shells, size=data["size"], unit=unit, roles=roles, within=within)
    if columns == 1 and len(rows) > 1:
        drawn["ellipsoids"] = ellipsoids(time, rows, unit=unit, roles={role: role for role in rows})
    if panels := _panels(data, lambda topic: topic == shape):
        drawn["curves"] = panel_figure(time, panels, columns)
    if panels := _panels(data, lambda topic: topic not in (shape, HUMAN_JOINTS)):
        drawn["motion"] = panel_figure(time, panels, columns)
    return drawn


def _bodies(data: dict[str, Any]) -> Iterator[tuple[dict[str, Any], int, dict[str, Any], dict[str, Array]]]:
    """Yield stage, number in it, body and ellipsoids (n, 3, 3) by role of all bodies with ellipsoids."""
    matrix = [0, 1, 2, 1, 3, 4, 2, 4, 5]  # entries among xx, xy, xz, yy, yz, zz
    for stage in data["stages"]:
        for k, body in enumerate(stage["bodies"]):
            if profiles := {role: six[:, matrix].reshape(-1, 3, 3) for role, six in body["ellipsoids"].items()}:
                yield stage, k, body, profiles


def _panels(data: dict[str, Any], wanted: Callable[[str], bool] = lambda topic: True) -> list[Panel]:
    """Return the panels of some topics."""
    return [
        Panel(**panel | {"lines": tuple(Line(**line) for line in panel["lines"])})
        for topic, panels in data["panels"].items() if wanted(topic) for panel in panels
    ]  # fmt: skip
