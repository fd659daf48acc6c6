"""The cheap alternatives that every adapter has to beat.

Each is an adapter itself, so that everything that can be measured of one can be measured of the other.
"""

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

from maniport.errors import InvalidInputError
from maniport.evaluation.procrustes import Procrustes
from maniport.evaluation.verdict import LOOKUP, RAW_COPY, RECENTRING, TRANSPORT
from maniport.transfer import DomainAdapter, method_of

PROCRUSTES = "procrustes"
"""Row of `Procrustes`, which is no method of `maniport.transfer.METHODS`."""


@dataclass(frozen=True)
class Alternative:
    """One row of the comparison.

    Attributes
    ----------
    name : str
    adapter : DomainAdapter or None
        Not fitted. None where it cannot be had.
    note : str
        Why it cannot, or what to know about it.
    """

    name: str
    adapter: DomainAdapter | None
    note: str = ""


def alternatives(adapter: DomainAdapter, pairs: Any = None) -> tuple[Alternative, ...]:
    """List the cheap alternatives to an adapter, with its regularisation and mounting; unfitted.

    Parameters
    ----------
    adapter : DomainAdapter
        Any, fitted or not.
    pairs : tuple of array_like, shapes (k, d, d) and (k, d, d), optional
        Known pairs of the teacher's and the student's ellipsoids, for Procrustes.
    """
    known = adapter.get_params(deep=False)
    shared = {name: known.get(name) for name in ("damping", "floor", "mounting")}
    return (
        *(Alternative(name, method_of(name, **shared)) for name in (RAW_COPY, RECENTRING, TRANSPORT)),
        Alternative(LOOKUP, method_of(LOOKUP, **shared), "makes samples of the student only: its gap is none"),
        _procrustes(shared, pairs),
    )


def others_than(adapter: DomainAdapter, name: str | None, pairs: Any) -> list[Alternative]:
    """Return the alternatives, without the method that the adapter itself is."""
    found = []
    for other in alternatives(adapter, pairs):
        if isinstance(other.adapter, type(adapter)):
            continue
        if other.name == name:
            raise InvalidInputError(f"name must not be that of an alternative; found {name!r}")
        found.append(other)
    return found


def _procrustes(shared: dict[str, Any], pairs: Any) -> Alternative:
    if find_spec("pyriemann") is None:
        return Alternative(PROCRUSTES, None, "pyriemann is not installed")
    note = "TLCenter and TLScale only: TLRotate needs pairs" if pairs is None else "TLCenter, TLScale, TLRotate"
    return Alternative(PROCRUSTES, Procrustes(**shared, pairs=pairs), note)
