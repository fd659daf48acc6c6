"""The cheap alternatives that every adapter has to beat.

Each is an adapter itself, so that everything that can be measured of one can be measured of the other. With a known
mounting all of them first express the teacher's ellipsoids in the student's base frame: another frame is no change.
"""

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.evaluation.procrustes import Procrustes, mounting_or_identity, no_iterations
from maniport.spd.kernels import congruence
from maniport.spd.mean import dispersion, mean
from maniport.transfer.adapter import RELEASED, DomainAdapter
from maniport.transfer.nearest_neighbor import NearestNeighbor
from maniport.transfer.parallel_transport import ParallelTransport
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.validation import Array

RAW_COPY, RECENTRING, TRANSPORT = "raw copy", "recentring only", "parallel transport"
LOOKUP, PROCRUSTES = "nearest neighbour", "Procrustes (pyRiemann)"


class RawCopy(DomainAdapter):
    """Do nothing: the student shall make the teacher's ellipsoids, S = R_b T R_bᵀ.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`. Damping is only exchanged for the student's, which `transform` takes off again.
    """

    def __init__(self, damping: float | None = None, floor: float | None = None, mounting: ArrayLike | None = None):
        self.damping = damping
        self.floor = floor
        self.mounting = mounting

    def _fit(self, teacher: Array, student: Array) -> None:
        self.rotation_ = mounting_or_identity(self.mounting, teacher.shape[-1])
        self.teacher_mean_, self.student_mean_ = mean(teacher), mean(student)
        self.teacher_dispersion_ = dispersion(teacher, self.teacher_mean_)
        self.student_dispersion_ = dispersion(student, self.student_mean_)
        self.dispersion_ratio_, self.released_damping_ = 1.0, RELEASED * self.student_damping_
        no_iterations(self, "nothing to fit")

    def _map(self, points: Array) -> tuple[Array, float]:
        exchange = self.student_damping_ - self.teacher_damping_
        return congruence(self.rotation_, points) + exchange * np.eye(points.shape[-1]), self.released_damping_

    def _map_back(self, points: Array) -> Array:
        exchange = self.teacher_damping_ - self.student_damping_
        return congruence(self.rotation_.T, points) + exchange * np.eye(points.shape[-1])


class Recentring(RigidAdapter):
    """Match the means and nothing else: f(T) = B T̄^-½ T T̄^-½ Bᵀ with B = S̄^½ R_b; neither turned nor dilated.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`. R_b is taken as it is; parallel transport turns by the polar factor of S̄^-½ R_b T̄^½.
    """

    scale, dispersion, recenter = False, "mean", "training"

    def __init__(self, damping: float | None = None, floor: float | None = None, mounting: ArrayLike | None = None):
        self.damping = damping
        self.floor = floor
        self.mounting = mounting

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        self.rotation_ = mounting_or_identity(self.mounting, teacher.shape[-1])
        no_iterations(self, "closed form")


class MountedNearestNeighbor(NearestNeighbor):
    """`NearestNeighbor` on ellipsoids that are first expressed in the student's base frame.

    Parameters
    ----------
    damping, floor, n_samples
        As in `NearestNeighbor`.
    mounting
        As in `ParallelTransport`.
    """

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        n_samples: int = 5000,
        mounting: ArrayLike | None = None,
    ):
        super().__init__(damping, floor, n_samples)
        self.mounting = mounting

    def _fit(self, teacher: Array, student: Array) -> None:
        turn = mounting_or_identity(self.mounting, teacher.shape[-1])
        super()._fit(congruence(turn, teacher), student)
        self.rotation_, self.teacher_mean_ = turn, congruence(turn.T, self.teacher_mean_)

    def _map(self, points: Array) -> tuple[Array, float]:
        return super()._map(congruence(self.rotation_, points))


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
        Alternative(RAW_COPY, RawCopy(**shared)),
        Alternative(RECENTRING, Recentring(**shared)),
        Alternative(TRANSPORT, ParallelTransport(**shared)),
        Alternative(LOOKUP, MountedNearestNeighbor(**shared), "makes samples of the student only: its gap is none"),
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
