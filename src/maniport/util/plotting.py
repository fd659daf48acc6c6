"""Objects that draw themselves."""

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_plotters: list[Callable[[object], "Figure"]] = []


def plot_with(plotter: Callable[[object], "Figure"]) -> None:
    """Set the function that draws an object; the package sets it when it is imported."""
    _plotters[:] = [plotter]


class Plottable:
    """Base of objects that can be drawn."""

    def plot(self) -> "Figure":
        """Draw it with matplotlib, as wide as a column of a paper; a notebook displays the figure.

        Returns
        -------
        matplotlib.figure.Figure
            Without a window; ``figure.savefig("plot.png")`` writes it.

        Raises
        ------
        MissingPackageError
            Without the extra ``figures``.
        """
        (plotter,) = _plotters
        return plotter(self)
