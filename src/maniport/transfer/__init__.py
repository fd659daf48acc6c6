"""Maps from a teacher's domain of SPD matrices to a student's.

Arrays in, arrays out: the methods know nothing of arms, so that any SPD data (stiffness, inertia, covariance) may be
transferred. Each method is one class that keeps the contract of `maniport.transfer.adapter.DomainAdapter`.
"""

import os
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.estimator import clone
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.adapter_file import read_adapter
from maniport.transfer.baselines import IdentityMap, NearestNeighbor
from maniport.transfer.icp import RiemannianICP
from maniport.transfer.icp.correspondence import (
    Correspondence,
    EllipsoidCorrespondence,
    GeodesicCorrespondence,
    Matches,
)
from maniport.transfer.length_field import LengthField
from maniport.transfer.rigid_adapter import MeanTransport, ParallelTransport, ScaledTransport
from maniport.util import defaults
from maniport.util.validation import as_choice


def _methods() -> dict[str, type[DomainAdapter]]:
    """Import the classes of the methods that `maniport.util.defaults` lists."""
    methods = {}
    for name, place in defaults.METHODS.items():
        module, kind = place.split(":")
        methods[name] = getattr(import_module(f"{__name__}.{module}"), kind)
    return methods


METHODS = _methods()
"""The methods by the names that the command line uses, cheapest first."""


def load_adapter(path: str | os.PathLike[str]) -> DomainAdapter:
    """Read a fitted adapter that was written by `DomainAdapter.save`.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    DomainAdapter
        Fitted.

    Raises
    ------
    FileFormatError
        When the file cannot be read or holds something else.
    """
    adapter: DomainAdapter = read_adapter(path)
    return adapter


def method_of(method: str | DomainAdapter, **shared: Any) -> DomainAdapter:
    """Return an unfitted adapter: by its name, or one that keeps the contract.

    Parameters
    ----------
    method : str or DomainAdapter
        A name in `METHODS`, or an adapter, fitted or not, which is cloned with its own parameters.
    **shared
        Parameters, such as damping and base_rotation, for methods by name; those that a method lacks are ignored.

    Returns
    -------
    DomainAdapter

    Raises
    ------
    UnknownNameError
        When no method has that name.
    InvalidInputError
        When `method` is neither, or an adapter with another base_rotation.
    """
    if isinstance(method, str):
        kind = METHODS[as_choice(method, "method", tuple(METHODS))]
        names = kind().get_params()
        return kind(**{name: value for name, value in shared.items() if name in names})
    if not isinstance(method, DomainAdapter):
        raise InvalidInputError(
            f"method must be one of {', '.join(map(repr, METHODS))} or a DomainAdapter; found {method!r}"
        )
    base_rotation = shared.get("base_rotation")
    if base_rotation is not None and not _same_base_rotation(base_rotation, method.base_rotation):
        raise InvalidInputError(
            f"give the base_rotation to the adapter itself: {type(method).__name__}(base_rotation=...)"
        )
    return clone(method)


def _same_base_rotation(rotation: ArrayLike, other: ArrayLike | None) -> bool:
    """Return whether two rotations of vectors are the same; None is the identity."""
    first = np.asarray(rotation)[:3, :3]
    second = np.eye(3)
    if other is not None:
        second = np.asarray(other)[:3, :3]
    return first.shape == second.shape and np.allclose(first, second, atol=1e-9)


def name_of(adapter: DomainAdapter) -> str:
    """Return the name of an adapter's method in `METHODS`, or its class where it has none."""
    for name, kind in METHODS.items():
        if type(adapter) is kind:
            return name
    return type(adapter).__name__


__all__ = [
    "METHODS",
    "Correspondence",
    "DomainAdapter",
    "EllipsoidCorrespondence",
    "GeodesicCorrespondence",
    "IdentityMap",
    "LengthField",
    "Matches",
    "MeanTransport",
    "NearestNeighbor",
    "ParallelTransport",
    "RiemannianICP",
    "ScaledTransport",
    "load_adapter",
    "method_of",
]
