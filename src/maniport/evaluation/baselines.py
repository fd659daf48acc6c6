"""Baselines of the comparison, which are methods of transfer themselves."""

from collections.abc import Sequence
from typing import Any

from maniport.errors import InvalidInputError
from maniport.transfer import DomainAdapter, method_of, name_of

IDENTITY, MEAN_TRANSPORT, TRANSPORT, LOOKUP = "identity", "mean-transport", "parallel-transport", "nearest-neighbor"
BASELINES = (IDENTITY, MEAN_TRANSPORT, TRANSPORT)  # The default baselines, cheapest first


def baselines_for(
    adapter: DomainAdapter, name: str, rows: Sequence[str | DomainAdapter] = BASELINES
) -> dict[str, DomainAdapter]:
    """Make unfitted baselines with the adapter's regularization and base_rotation, without the adapter's own method."""
    parameters = adapter.get_params(deep=False)
    shared: dict[str, Any] = {key: parameters.get(key) for key in ("damping", "base_rotation")}
    baselines = {}
    for row in rows:
        baseline = method_of(row, **shared)
        own = baseline.get_params(deep=False)
        if not isinstance(row, str) and own.get("damping") != shared["damping"]:
            raise InvalidInputError(f"rows must have the adapter's damping; found {row!r}")
        if not isinstance(baseline, type(adapter)):
            baselines[row if isinstance(row, str) else name_of(baseline)] = baseline
    if name in baselines:
        raise InvalidInputError(f"name must not be that of a baseline; found {name!r}")
    return baselines
