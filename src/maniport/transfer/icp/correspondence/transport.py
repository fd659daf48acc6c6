"""Partners by optimal transport: every ellipsoid gives away or receives the same mass."""

import numpy as np

from maniport.errors import InvalidInputError
from maniport.transfer.icp.correspondence.assignment import Assignment, with_dump
from maniport.transfer.icp.correspondence.contract import Indices
from maniport.validation import Array

MAX_PIVOTS = 10_000_000
"""Limit of the simplex, far beyond what `LIMIT` ellipsoids a side need."""

NEGLIGIBLE = 1e-9
"""Masses below this fraction of an ellipsoid's own are rounding."""


class TransportCorrespondence(Assignment):
    """Every teacher ellipsoid spreads 1/n over the student's, each of which receives 1/m, at the least total cost.

    The cost is the squared affine-invariant distance: the 2-Wasserstein distance on the manifold. The plan of POT's
    exact network simplex has at most n + m − 1 matches (Bonneel et al. 2011); their masses are the weights. Clouds of
    different density are matched as a whole, and clouds of equal size one to one.
    """

    name = "transport"

    def _assign(self, cost: Array) -> tuple[Indices, Indices, Array]:
        from ot import emd  # takes a second to import

        n, m = cost.shape
        gives, receives = np.full(n, 1.0 / n), np.full(m, 1.0 / m)
        if self.trim > 0.0:  # partial transport by dummy points (Chapel et al. 2020)
            cost, gives, receives = with_dump(cost, 1), np.append(gives, self.trim), np.append(receives, self.trim)
        plan, log = emd(gives, receives, cost, numItermax=MAX_PIVOTS, log=True)
        if log["warning"]:
            raise InvalidInputError(
                f"the transport of {n} onto {m} ellipsoids could not be solved ({log['warning']}); "
                "give smaller domains or another correspondence"
            )
        plan = plan[:n, :m]
        rows, columns = np.nonzero(plan > NEGLIGIBLE / max(n, m))
        return rows, columns, np.asarray(plan[rows, columns])
