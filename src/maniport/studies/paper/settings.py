"""The two ways in which every row of the paper's tables is fitted: as the paper did, and as maniport does."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from numpy.typing import ArrayLike

from maniport.studies.paper.tables import PaperRow
from maniport.transfer import DomainAdapter, EllipsoidCorrespondence, ParallelTransport, RiemannianICP, Search

PAPER, OURS = "ours, paper's settings", "ours, defaults"

FLOOR = 1e-4
"""Smallest eigenvalue (footnote 1 of the paper)."""

DAMPING = 0.01
"""What maniport's pipeline gives to singular ellipsoids instead."""

PAPER_RIGID: Mapping[str, Any] = MappingProxyType(
    {"damping": None, "mounting": None, "scale": True, "dispersion": "mean", "recenter": "training"}
)
"""Everything that the paper's text says about steps 1, 2 and 4; no mounting is known."""

PAPER_SEARCH = Search(n_starts=8, margin=0.0, compete=False, max_iter=100, tol=1e-8)
"""And about ICP: several starts of which the cheapest wins, at most 100 iterations. Start and weights differ by row.

The search itself is ours: exact gradient and curvature, and rival starts that are aligned with the frames of the clouds
instead of random ones.
"""


def paper_adapter(row: PaperRow, floor: float | None = FLOOR) -> DomainAdapter:
    """Return the adapter that a row of the paper was made with."""
    if row.exponent is None:
        return ParallelTransport(**PAPER_RIGID, floor=floor)
    return RiemannianICP(
        **PAPER_RIGID,
        floor=floor,
        correspondence=EllipsoidCorrespondence(exponent=row.exponent),
        search=replace(PAPER_SEARCH, start=row.start, most_singular=row.most_singular),
        n_resamples=0,
    )


def our_adapter(row: PaperRow, mounting: ArrayLike | None = None, damping: float | None = DAMPING) -> DomainAdapter:
    """Return the same method with the library's defaults and, where it is known, the mounting of the student."""
    if row.exponent is None:
        return ParallelTransport(damping=damping, mounting=mounting)
    return RiemannianICP(damping=damping, mounting=mounting, search=Search(most_singular=row.most_singular))


def in_words(adapter: DomainAdapter) -> str:
    """Name the method and the parameters that are not its defaults; the seed is told elsewhere."""
    given = {key: value for key, value in adapter.get_params(deep=False).items() if key != "random_state"}
    default = type(adapter)().get_params(deep=False)
    words = []
    for key, value in given.items():
        if key == "mounting":
            words += [] if value is None else ["mounting=mounting"]
        elif value != default[key]:
            words.append(f"{key}={value:g}" if isinstance(value, float) else f"{key}={value!r}")
    return f"{type(adapter).__name__}({', '.join(words)})"
