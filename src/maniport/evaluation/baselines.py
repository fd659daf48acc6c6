"""Baselines of the comparison, which are methods of transfer themselves."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maniport.errors import InvalidInputError
from maniport.transfer import DomainAdapter, method_of

IDENTITY, MEAN_TRANSPORT, TRANSPORT, LOOKUP = "identity", "mean-transport", "parallel-transport", "nearest-neighbor"
BASELINES = (IDENTITY, MEAN_TRANSPORT, TRANSPORT)  # The default baselines, cheapest first


def baselines_for(
    adapter: DomainAdapter,
    name: str,
    rows: Sequence[str] = BASELINES,
    fitted: Mapping[str, DomainAdapter] | None = None,
) -> dict[str, DomainAdapter]:
    """Make baselines with the adapter's regularization and base_rotation, without the adapter's own method.

    Those in `fitted` are taken as they are, the others are not fitted yet.
    """
    parameters, ready = adapter.get_params(deep=False), dict(fitted or {})
    shared: dict[str, Any] = {key: parameters.get(key) for key in ("damping", "eigenvalue_floor", "base_rotation")}
    for row, other in ready.items():
        _require_alike(other, adapter, row)
    baselines = {row: ready.get(row) or method_of(row, **shared) for row in (*rows, *ready)}
    baselines = {row: baseline for row, baseline in baselines.items() if not isinstance(baseline, type(adapter))}
    if name in baselines:
        raise InvalidInputError(f"name must not be that of a baseline; found {name!r}")
    return baselines


def _require_alike(fitted: DomainAdapter, adapter: DomainAdapter, row: str) -> None:
    """Raise unless a fitted baseline has the adapter's regularization and base_rotation."""
    alike = fitted.student_regularization == adapter.student_regularization
    alike &= fitted.teacher_regularization == adapter.teacher_regularization
    own, other = (np.eye(1) if one.base_rotation_ is None else one.base_rotation_ for one in (fitted, adapter))
    if not alike or not np.array_equal(own, other):
        raise InvalidInputError(f"fitted[{row!r}] must have the adapter's regularization and base_rotation")
