"""maniport: transfer manipulability from a human arm to a robot arm.

The public names are those of the stub ``__init__.pyi``, loaded on first use, so that ``import maniport`` stays light.
"""

from typing import TYPE_CHECKING

from maniport.util.lazy_names import names_of_stub
from maniport.util.notebook import render_with
from maniport.util.plotting import plot_with

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__, __getattr__ = names_of_stub(__name__, __file__)


def __dir__() -> list[str]:
    return __all__


def _markdown(value: object) -> str:
    """Return the Markdown that a notebook displays; the report is loaded on first use."""
    from maniport.report import as_markdown, report_of

    return as_markdown(report_of(value), details=True)


render_with(_markdown)


def _plot(value: object) -> "Figure":
    """Return the figure of an object; matplotlib is loaded on first use."""
    from maniport.report.plots import plot

    return plot(value)


plot_with(_plot)
