"""Partners that nobody else has."""

import numpy as np

from maniport.transfer.icp.correspondence.assignment import Assignment, with_dump
from maniport.transfer.icp.correspondence.contract import Indices, left_out
from maniport.validation import Array


class OneToOneCorrespondence(Assignment):
    """Every ellipsoid of the smaller cloud has a partner of its own, the sum of squared distances being least.

    Solved exactly by SciPy's `linear_sum_assignment` (Crouse 2016), O(n³); rectangular problems leave ellipsoids of
    the larger cloud alone. All matches weigh the same.
    """

    name = "one-to-one"

    def _assign(self, cost: Array) -> tuple[Indices, Indices, Array]:
        from scipy.optimize import linear_sum_assignment  # takes its time to import

        n, m = cost.shape
        rows, columns = linear_sum_assignment(with_dump(cost, left_out(min(n, m), self.trim)))
        real = (rows < n) & (columns < m)
        return np.asarray(rows[real], np.intp), np.asarray(columns[real], np.intp), np.ones(int(real.sum()))
