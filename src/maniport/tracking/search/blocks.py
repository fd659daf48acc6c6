"""The search for many targets, in blocks that processes may share."""

import numpy as np
from joblib import Parallel, delayed

from maniport.steps import Part, counted
from maniport.tracking.search.descent import Target, descend
from maniport.validation import Array


def descend_in_blocks(
    target: Target,
    starts: Array,
    tol: float,
    max_iter: int,
    block: int,
    n_jobs: int | None = None,
    tell: Part | None = None,
) -> Array:
    """Search for each target as `descend` does, `block` of them together.

    Parameters
    ----------
    target, starts, tol, max_iter
        As in `descend`.
    block : int
        Fixed by the caller, so that results do not depend on the number of processes.
    n_jobs : int, optional
        Number of processes, as in joblib.
    tell : callable, optional
        Called with the fraction of the blocks that are done. Not every backend of joblib hands results over one by
        one: without `tell` it is not asked to.

    Returns
    -------
    ndarray, shape (n, dof)
    """
    blocks = [slice(i, i + block) for i in range(0, len(starts), block)]
    tasks = (delayed(descend)(target[rows], starts[rows], tol, max_iter) for rows in blocks)
    if tell is None:
        found = list(Parallel(n_jobs=n_jobs)(tasks))
    else:
        found = list(counted(Parallel(n_jobs=n_jobs, return_as="generator")(tasks), len(blocks), tell))
    return np.concatenate(found)
