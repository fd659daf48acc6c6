"""The parameters of `RiemannianICP`, checked."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from maniport.errors import InvalidInputError
from maniport.transfer.icp.correspondence import CORRESPONDENCES, DIRECTIONS
from maniport.transfer.icp.search import SearchLimits
from maniport.validation import as_choice, as_count, as_number

if TYPE_CHECKING:
    from maniport.transfer.riemannian_icp import RiemannianICP


@dataclass(frozen=True)
class IcpOptions:
    """Numbers among the parameters of `RiemannianICP`, checked."""

    limits: SearchLimits
    exponent: float
    tol: float
    trim: float
    prior_weight: float
    resamples: int


def checked_options(adapter: "RiemannianICP") -> IcpOptions:
    """Check all parameters; raises `InvalidInputError` naming the one that is wrong."""
    as_choice(adapter.start, "start", ("parallel-transport", "identity"))
    as_choice(adapter.correspondence, "correspondence", tuple(CORRESPONDENCES))
    as_choice(adapter.direction, "direction", DIRECTIONS)
    if adapter.compete not in (True, False):
        raise InvalidInputError(f"compete must be True or False; found {adapter.compete!r}")
    return IcpOptions(
        limits=SearchLimits(
            max_iter=as_count(adapter.max_iter, "max_iter"),
            rivals=as_count(adapter.n_starts, "n_starts", minimum=0),
            margin=as_number(adapter.margin, "margin", minimum=0.0, below=1.0),
        ),
        exponent=as_number(adapter.exponent, "exponent", minimum=0.0),
        tol=as_number(adapter.tol, "tol", above=0.0),
        trim=as_number(adapter.trim, "trim", minimum=0.0, below=1.0),
        prior_weight=as_number(adapter.prior_weight, "prior_weight", minimum=0.0),
        resamples=as_count(adapter.n_resamples, "n_resamples", minimum=0),
    )
