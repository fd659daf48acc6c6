"""The figures: ellipsoids along a motion, their curves over time, domains in two dimensions, arms in space.

Every function returns a `matplotlib.figure.Figure` that no window and no global state knows of. Figures are as wide
as one column of a paper. Letters are 7 pt high there (the numbers along axes in space 6), and the colours are ones that
the colour-blind can tell apart; where lines may lie on one another they differ in width or style too, so that a print
in grey can be read. Profiles and domains come as mappings from names to arrays. Who has a role gets its colour
(``roles=``, as in `maniport.telling.roles`); else the order gives the colours, the teacher's first.
"""

import os
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from maniport.atomic_io import written_whole
from maniport.errors import InvalidInputError
from maniport.telling.figures.arms import arms
from maniport.telling.figures.domain_map import diffusion_map
from maniport.telling.figures.learned import learned
from maniport.telling.figures.over_time import curves, motion, motions
from maniport.telling.figures.profiles import ellipsoid_views, ellipsoids
from maniport.telling.renderings import ENDINGS

__all__ = ["arms", "curves", "diffusion_map", "ellipsoid_views", "ellipsoids", "learned", "motion", "motions", "save"]

FORMATS = (".png", ".svg", ".pdf")

SETTINGS: dict[Any, Any] = {
    # Letters stay letters: a paper can set them in its own font, and readers can search and copy them. Nothing is lost
    # where DejaVu Sans is missing: Verdana, which is as wide, takes its place, else a narrower font that fits in.
    "svg.fonttype": "none",
    "svg.hashsalt": "maniport",
    "pdf.fonttype": 42,
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica"],
    "svg.image_inline": True,
    "savefig.bbox": None,
}
"""What must not depend on the user's settings: width, and the same bytes for the same figure."""

METADATA = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
"""Without the date and the version of matplotlib the same figure gives the same bytes."""


def save(figure: Figure, path: str | os.PathLike[str]) -> list[Path]:
    """Write a figure, whole or not at all."""
    target = Path(path)
    if target.suffix and target.suffix.lower() not in FORMATS:
        raise InvalidInputError(f"path must end in {', '.join(FORMATS)} or have no ending; found {target.name!r}")
    targets = [target] if target.suffix else [target.with_suffix(ending) for ending in ENDINGS]
    for each in targets:
        with written_whole(each) as temporary:
            temporary.write_bytes(encoded(figure, each.suffix.lower()))
    return targets


def encoded(figure: Figure, ending: str) -> bytes:
    """What a file of a figure holds, whose name has one of the endings `FORMATS`."""
    stream = BytesIO()
    with rc_context(SETTINGS):
        figure.savefig(stream, format=ending[1:], dpi="figure", metadata=METADATA[ending])
    return stream.getvalue()
