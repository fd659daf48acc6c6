"""Maps from a teacher's domain of SPD matrices to a student's.

Arrays in, arrays out: the methods know nothing of arms, so that any SPD data (stiffness, inertia, covariance) may be
transferred. Each method is one class that keeps the contract of `maniport.transfer.adapter.DomainAdapter`.
"""

from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.adapter_file import load_adapter
from maniport.transfer.nearest_neighbor import NearestNeighbor
from maniport.transfer.parallel_transport import ParallelTransport
from maniport.transfer.riemannian_icp import RiemannianICP

METHODS: dict[str, type[DomainAdapter]] = {
    "icp": RiemannianICP,
    "parallel-transport": ParallelTransport,
    "nearest-neighbor": NearestNeighbor,
}
"""The methods by the names that the command line uses."""

__all__ = ["METHODS", "DomainAdapter", "NearestNeighbor", "ParallelTransport", "RiemannianICP", "load_adapter"]
