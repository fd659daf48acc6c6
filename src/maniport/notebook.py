"""What a notebook shows: an object as its name and a small table of facts, and the steps of long work.

The pieces use no colours of their own, so that they read well on light and on dark pages, and load nothing.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

LABEL = "text-align:left;font-weight:normal;opacity:.7;padding:.1em 1.2em .1em 0;vertical-align:top;white-space:nowrap"
VALUE = "text-align:left;padding:.1em 1.2em .1em 0;vertical-align:top;white-space:pre-wrap"
STEP = "padding-left:1.3em;text-indent:-1.3em"
"""What does not fit into one line goes on beside the mark."""
TABLE = "border-collapse:collapse;margin:.3em 0"


class Grid(NamedTuple):
    """A table with a heading for each column."""

    head: Sequence[object]
    rows: Sequence[Sequence[object]]


class ShownInNotebooks:
    """Base of objects that Jupyter shows as a table of facts; `_facts` tells them, `_title` and `_grid` may."""

    @abstractmethod
    def _facts(self) -> Mapping[str, object]:
        """Facts by what they are about; those that are None or empty are left out."""

    def _title(self) -> str:
        return type(self).__name__

    def _grid(self) -> Grid | None:
        """Return a table to show below the facts."""
        return None

    def _repr_html_(self) -> str:
        return as_html(self._title(), self._facts(), self._grid())

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, str]:
        # IPython prefers this method, and scikit-learn's estimators have one that knows nothing of our fits
        return {"text/plain": repr(self), "text/html": self._repr_html_()}


def as_html(title: str, facts: Mapping[str, object], grid: Grid | None = None) -> str:
    """Write a piece of HTML that stands by itself.

    Parameters
    ----------
    title : str
    facts : mapping of str to object
        Shown as text, whatever it holds; None and empty texts are left out.
    grid : Grid, optional
        A table to show below.
    """
    texts = {name: "" if value is None else str(value) for name, value in facts.items()}
    lines = [_row([_cell("th", LABEL, name), _cell("td", VALUE, text)]) for name, text in texts.items() if text]
    parts = [f"<b>{escape(title)}</b>", f'<table style="{TABLE}"><tbody>{"".join(lines)}</tbody></table>']
    if grid is not None:
        head = _row([_cell("th", LABEL, name) for name in grid.head])
        rows = [_row([_cell("td", VALUE, value) for value in row]) for row in grid.rows]
        parts.append(f'<table style="{TABLE}"><thead>{head}</thead><tbody>{"".join(rows)}</tbody></table>')
    return f'<div style="margin:.3em 0">{"".join(parts)}</div>'


def as_steps(done: Sequence[str], running: Mapping[str, float]) -> str:
    """Write the steps of long work: a line for each that has ended, a bar for each that goes on.

    Parameters
    ----------
    done : sequence of str
    running : mapping of str to float
        Fraction by name; the bar of one that has not told any moves to and fro.
    """
    lines = [escape(line) for line in done]
    for step, fraction in running.items():
        value = f' value="{fraction:.3f}"' if fraction > 0.0 else ""
        lines.append(f'<progress max="1"{value} style="width:12em"></progress> {escape(step)}')
    shown = "".join(f'<div style="{STEP}">{line}</div>' for line in lines)
    return f'<div style="margin:.3em 0">{shown}</div>'


def _row(cells: Sequence[str]) -> str:
    return f"<tr>{''.join(cells)}</tr>"


def _cell(tag: str, style: str, content: object) -> str:
    return f'<{tag} style="{style}">{escape(str(content))}</{tag}>'
