"""The cheap alternatives that every adapter has to beat.

Each is an adapter itself, so that everything that can be measured of one can be measured of the other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from maniport.errors import InvalidInputError
from maniport.evaluation.procrustes import Procrustes
from maniport.evaluation.verdict import LOOKUP, RAW_COPY, RECENTRING, TRANSPORT
from maniport.transfer import DomainAdapter, method_of
from maniport.validation import as_choice

PROCRUSTES = "procrustes"
"""Row of `Procrustes`, which is no method of `maniport.transfer.METHODS`."""

ROWS = (RAW_COPY, RECENTRING, TRANSPORT, LOOKUP, PROCRUSTES)
"""All alternatives, the cheapest first."""


@dataclass(frozen=True)
class Alternative:
    """One row of the comparison.

    Attributes
    ----------
    name : str
    adapter : DomainAdapter or None
        None where it cannot be had.
    note : str
        Why it cannot, or what to know about it.
    fitted : bool
        Whether it is fitted to the domains already.
    """

    name: str
    adapter: DomainAdapter | None
    note: str = ""
    fitted: bool = False


def others_than(
    adapter: DomainAdapter,
    name: str,
    rows: Sequence[str] = ROWS,
    pairs: Any = None,
    fitted: Mapping[str, DomainAdapter] | None = None,
) -> list[Alternative]:
    """List alternatives with the adapter's regularisation and mounting, without the method that it is itself.

    Parameters
    ----------
    adapter : DomainAdapter
        Any, fitted or not.
    name : str
        Of its row; no alternative may have it.
    rows : sequence of str
        Which ones, of `ROWS`.
    pairs : tuple of array_like, shapes (k, d, d) and (k, d, d), optional
        Known pairs of the teacher's and the student's ellipsoids, for Procrustes.
    fitted : mapping of str to DomainAdapter, optional
        Those that need not be fitted any more.
    """
    known, ready = adapter.get_params(deep=False), fitted or {}
    shared = {key: known.get(key) for key in ("damping", "floor", "mounting")}
    for row in (*rows, *ready):
        as_choice(row, "row", ROWS)
    found = []
    for row in rows:
        if row in ready:
            _require_alike(ready[row], adapter, row)
            other = Alternative(row, ready[row], _note(row, pairs), fitted=True)
        else:
            other = _unfitted(row, shared, pairs)
        if isinstance(other.adapter, type(adapter)):
            continue
        if row == name:
            raise InvalidInputError(f"name must not be that of an alternative; found {name!r}")
        found.append(other)
    return found


def _unfitted(row: str, shared: dict[str, Any], pairs: Any) -> Alternative:
    if row != PROCRUSTES:
        return Alternative(row, method_of(row, **shared), _note(row, pairs))
    if find_spec("pyriemann") is None:
        return Alternative(row, None, "pyriemann is not installed (pip install maniport[compare])")
    return Alternative(row, Procrustes(**shared, pairs=pairs), _note(row, pairs))


def _note(row: str, pairs: Any) -> str:
    if row == PROCRUSTES:
        return "TLCenter and TLScale only: TLRotate needs pairs" if pairs is None else "TLCenter, TLScale, TLRotate"
    return "makes samples of the student only: its gap is none" if row == LOOKUP else ""


def _require_alike(one: DomainAdapter, adapter: DomainAdapter, row: str) -> None:
    """Raise unless one of the fitted alternatives treats ellipsoids as the adapter does."""
    same = one.student_regularization == adapter.student_regularization
    same &= one.teacher_regularization == adapter.teacher_regularization
    turn, other = (np.eye(1) if each.mounting_ is None else each.mounting_ for each in (one, adapter))
    if not same or not np.array_equal(turn, other):
        raise InvalidInputError(f"fitted[{row!r}] must have the adapter's regularisation and mounting")
