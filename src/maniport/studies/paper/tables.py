"""Tables I, II and III of Reithmeir et al. 2022 (arXiv 2208.07588), row by row, and how every row is fitted again.

There are two ways: as the paper did, and as maniport does by default.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from numpy.typing import ArrayLike

from maniport.transfer import DomainAdapter, EllipsoidCorrespondence, ParallelTransport, RiemannianICP, Search
from maniport.validation import as_choice

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

TRAJECTORIES, RANDOM = "trajectories", "random"
IDENTITY, TRANSPORT = "identity", "parallel-transport"


@dataclass(frozen=True)
class PaperRow:
    """One row of a table of the paper.

    Attributes
    ----------
    table : str
        Roman number of the table.
    row : int
        Counted from the top, beginning with 1.
    data : str
        What the maps are fitted to: trajectories or random samples.
    samples : int
        How many of each domain.
    method : str
        As printed.
    rmse : mapping of str to float
        By evaluation set; divided by the dispersion of the mapped set (eq. 17).
    start : str
        Where ICP starts, in the words of `maniport.RiemannianICP`.
    exponent : float, optional
        k of the weights w^k; None for parallel transport without ICP.
    most_singular : int, optional
        How many of the samples are matched, when not all.
    iterations : int, optional
        Until convergence, where printed.
    """

    table: str
    row: int
    data: str
    samples: int
    method: str
    rmse: Mapping[str, float]
    start: str = TRANSPORT
    exponent: float | None = None
    most_singular: int | None = None
    iterations: int | None = None

    @property
    def label(self) -> str:
        """Number of samples, as the paper writes it."""
        return f"{self.most_singular} most singular of {self.samples}" if self.most_singular else str(self.samples)


TOY, M_EVAL, H_EVAL = (
    ("10 new points",),
    ("M-Eval-1", "M-Eval-2", "M-Eval-3"),
    tuple(f"H-Eval-{i}" for i in range(1, 5)),
)

# § IV-B introduces the toy data before the start by parallel transport, and with weights w as in eq. 16.
_TABLE_I = (
    PaperRow("I", 1, RANDOM, 100, "ICP", {TOY[0]: 0.095}, IDENTITY, 1.0, 12, 28),
    PaperRow("I", 2, RANDOM, 100, "ICP", {TOY[0]: 0.042}, IDENTITY, 1.0, None, 22),
)


def _two_dof(data: str, first: int, rows: tuple[tuple[int, str, float, float, float], ...]) -> tuple[PaperRow, ...]:
    return tuple(
        PaperRow("II", first + i, data, samples, method, dict(zip(M_EVAL, rmse, strict=True)), *_settings(method))
        for i, (samples, method, *rmse) in enumerate(rows)
    )


def _human_robot(
    data: str, first: int, rows: tuple[tuple[int, str, float, float, float, float], ...]
) -> tuple[PaperRow, ...]:
    # w³ is used throughout. The caption says that PT is applied in all cases, the rows that it is not; they are taken
    # at their word.
    return tuple(
        PaperRow(
            "III", first + i, data, samples, method, dict(zip(H_EVAL, rmse, strict=True)), *_settings(f"{method} + w³")
        )
        for i, (samples, method, *rmse) in enumerate(rows)
    )


def _settings(method: str) -> tuple[str, float | None]:
    """Start and exponent of a method as the paper writes it."""
    if "ICP" not in method:
        return TRANSPORT, None
    exponent = {"w": 1.0, "w²": 2.0, "w³": 3.0}.get(method.split(" + ")[-1], 0.0)
    return TRANSPORT if method.startswith("PT") else IDENTITY, exponent


_TABLE_II = _two_dof(
    TRAJECTORIES,
    1,
    (
        (400, "PT only", 0.874, 0.783, 0.782),
        (200, "ICP", 1.058, 0.827, 0.829),
        (100, "ICP + w", 0.913, 0.725, 0.726),
        (100, "ICP + w²", 0.933, 0.733, 0.733),
        (100, "ICP + w³", 0.710, 0.606, 0.605),
        (100, "PT + ICP + w³", 0.362, 0.410, 0.419),
        (50, "ICP only + w³", 0.714, 0.618, 0.606),
        (50, "PT + ICP + w³", 0.703, 0.594, 0.912),
        (25, "ICP only + w³", 0.548, 0.547, 0.453),
        (25, "PT + ICP + w³", 0.440, 0.497, 0.408),
    ),
) + _two_dof(
    RANDOM,
    11,
    (
        (500, "PT only", 0.875, 0.774, 0.790),
        (100, "ICP only + w³", 0.864, 0.715, 0.708),
        (100, "PT + ICP + w³", 0.864, 0.736, 0.726),
        (50, "ICP only + w³", 0.648, 0.550, 0.547),
        (50, "PT + ICP + w³", 0.649, 0.540, 0.538),
        (25, "ICP only + w³", 0.677, 0.545, 0.554),
        (25, "PT + ICP + w³", 0.586, 0.492, 0.496),
    ),
)

_TABLE_III = _human_robot(
    TRAJECTORIES,
    1,
    (
        (400, "PT + ICP", 0.539, 0.834, 0.340, 0.297),
        (100, "ICP", 0.548, 0.854, 0.346, 0.300),
        (100, "PT + ICP", 0.549, 0.848, 0.348, 0.300),
        (25, "ICP", 0.578, 0.884, 0.376, 0.297),
        (25, "PT + ICP", 0.576, 0.888, 0.375, 0.290),
    ),
) + _human_robot(
    RANDOM,
    6,
    (
        (100, "PT + ICP", 0.602, 0.827, 0.340, 0.377),
        (100, "ICP", 0.437, 0.699, 0.317, 0.363),
        (25, "PT + ICP", 0.501, 0.698, 0.344, 0.370),
        (25, "ICP", 0.619, 0.818, 0.339, 0.382),
    ),
)

_TABLES = {"I": _TABLE_I, "II": _TABLE_II, "III": _TABLE_III}


def paper_table(number: str) -> tuple[PaperRow, ...]:
    """Rows of Table I, II or III, from the top."""
    return _TABLES[as_choice(number, "table", tuple(_TABLES))]


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
