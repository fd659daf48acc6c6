"""Time and peak memory of a complete ICP fit as the domains grow."""

from collections.abc import Iterator

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .complete_fit import measure
from .measure import SCALE_PLOT, Row, duration, megabytes

SIZES = (100, 1_000, 10_000, 100_000)
TIMEOUT = 300.0  # s


def rows(quick: bool) -> Iterator[Row]:
    """A process for each size; draws the plot."""
    found: dict[int, dict[str, float]] = {}
    for n in SIZES[:-1] if quick else SIZES:
        work = f"complete ICP fit, N = {n:,} on each side"
        try:
            found[n] = one = measure(n, TIMEOUT)
        except TimeoutError:
            yield Row(work, f"> {duration(TIMEOUT)}", "", "stopped", "–", None, "the limit of this benchmark")
            continue
        memory = f"{megabytes(one['megabytes'])}, {megabytes(one['megabytes'] - one['baseline'])} of it by the fit"
        yield Row(work, f"{duration(one['seconds'])}, {memory}", "", duration(one["seconds"]), "–", None)
    seconds = {n: one["seconds"] for n, one in found.items()}
    added = {n: max(one["megabytes"] - one["baseline"], 1.0) for n, one in found.items()}
    last, before = max(found), sorted(found)[-2]
    exponent = growth(added[before], added[last], last / before)
    yield Row(
        f"growth of memory from N = {before:,} to {last:,}",
        f"N^{exponent:.2f}",
        "",
        f"N^{exponent:.2f}",
        "< N^1.2, not N × M",
        exponent < 1.2,
        f"time grows with N^{growth(seconds[before], seconds[last], last / before):.2f}",
    )
    if not quick:
        _plot(found)


def growth(before: float, after: float, factor: float) -> float:
    """Exponent with which a quantity grows."""
    return float(np.log(after / before) / np.log(factor))


def _plot(found: dict[int, dict[str, float]]) -> None:
    sizes = sorted(found)
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    seconds = [found[n]["seconds"] for n in sizes]
    left.loglog(sizes, seconds, "o-", color="#1f5a99")
    for n, following, time, later in zip(sizes, sizes[1:], seconds, seconds[1:], strict=False):
        exponent = growth(time, later, following / n)
        at = np.sqrt(n * following), np.sqrt(time * later)
        left.annotate(f"$N^{{{exponent:.2f}}}$", at, (8, -12), textcoords="offset points")
    left.set_ylabel("time of the fit [s]")
    memory = [found[n]["megabytes"] for n in sizes]
    right.semilogx(sizes, memory, "o-", color="#1f5a99", label="peak of the process")
    right.semilogx(sizes, [found[n]["baseline"] for n in sizes], "s--", color="#999999", label="before the fit")
    right.set_ylim(0.0, 1.1 * max(memory))
    right.set_ylabel("memory [MB]")
    right.legend(frameon=False)
    for axes in (left, right):
        axes.set_xlabel("ellipsoids on each side, N")
        axes.grid(True, which="major", alpha=0.3)
    figure.savefig(SCALE_PLOT, dpi=130)
