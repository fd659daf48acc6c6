"""The figures: ellipsoids along a motion, their curves over time, domains in two dimensions, arms in space.

Every function returns a `matplotlib.figure.Figure` that no window and no global state knows of. Figures are as wide
as one column of a paper and drawn in colours that the colour-blind can tell apart. Profiles and domains come as
mappings from names to arrays; the order gives the colours, the teacher (before) first, the student (after) second.
"""

import os
from pathlib import Path

from matplotlib.figure import Figure

from maniport.errors import InvalidInputError
from maniport.files import written_whole
from maniport.viewing.arms import arms
from maniport.viewing.domain_map import diffusion_map
from maniport.viewing.ellipsoid_rows import ellipsoids
from maniport.viewing.ellipsoid_views import ellipsoid_views
from maniport.viewing.motion_curves import motion
from maniport.viewing.time_curves import curves

__all__ = ["arms", "curves", "diffusion_map", "ellipsoid_views", "ellipsoids", "motion", "save"]

FORMATS = (".png", ".svg", ".pdf")


def save(figure: Figure, path: str | os.PathLike[str]) -> list[Path]:
    """Write a figure, whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : str or path-like
        Ending in ``.png``, ``.svg`` or ``.pdf``; without an ending, both ``.png`` and ``.svg`` are written.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    OutputError
        When the folder does not exist or cannot be written.
    """
    target = Path(path)
    if target.suffix and target.suffix.lower() not in FORMATS:
        raise InvalidInputError(f"path must end in {', '.join(FORMATS)} or have no ending; found {target.name!r}")
    targets = [target] if target.suffix else [target.with_suffix(".png"), target.with_suffix(".svg")]
    for each in targets:
        # without the date and the version of matplotlib the same figure gives the same bytes
        metadata = {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
        with written_whole(each) as temporary:
            figure.savefig(temporary, format=each.suffix[1:].lower(), metadata=metadata[each.suffix.lower()])
    return targets
