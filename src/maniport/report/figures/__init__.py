"""Figures for papers: ellipsoids along a motion, curves over time, arms in space, and domains on a map.

Every function returns a `matplotlib.figure.Figure` without a window and without global state, as wide as one column of
a paper. Profiles and domains are mappings from names to arrays. Colors follow roles (``roles=``, as in
`maniport.report.page.content`), else the order. `write_figures` draws the figures of a saved result.
"""

import json
import os
import re
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any

from maniport.errors import FileFormatError, InvalidInputError, OutputError
from maniport.report.page.content import unpacked
from maniport.report.renderings import ENDINGS, FIGURES, LEARNED, PAGE
from maniport.util.atomic_io import written_whole
from maniport.util.input_limits import KEYPOINTS_BYTES, read_whole
from maniport.util.optional import matplotlib

matplotlib()  # raises MissingPackageError

from matplotlib import rc_context  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from maniport.report.figures.drawing import (  # noqa: E402
    arms,
    curves,
    diffusion_map,
    ellipsoids,
    panel_figure,
)

__all__ = [
    "arms", "curves", "diffusion_map", "ellipsoids", "panel_figure", "save", "write_figures",
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
    drawn = {}
    for name, where in FIGURES.items():
        module, function = where.split(":")
        if (name == LEARNED) != bool(data["stages"]):
            drawn[name] = getattr(import_module(module), function)(data)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write {str(target)!r}: {error.strerror}") from None
    return [file for name, figure in drawn.items() if figure is not None for file in save(figure, target / name)]


def _motion(page: Path) -> dict[str, Any]:
    """Read the data of the motion in a page."""
    text = read_whole(page, (), KEYPOINTS_BYTES).decode("utf-8", "replace")
    match = re.search(r'<script type="application/json" id="motion-0">(.*?)</script>', text, re.DOTALL)
    try:
        data = unpacked(json.loads(match[1]) if match else None)
        return {**data, "time": data["start"] + data["time"]}
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise FileFormatError(f"{str(page)!r} is not the page of a result: {error}") from None
