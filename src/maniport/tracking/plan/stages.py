"""The fastest way along a path, by toppra."""

import logging
import warnings

import numpy as np
from numpy.typing import NDArray

from maniport.validation import Array

with warnings.catch_warnings():  # Python 3.12 and later complain of its docstrings when they first compile it
    warnings.simplefilter("ignore", SyntaxWarning)
    from toppra.algorithm import TOPPRA
    from toppra.constraint import LinearConstraint

logging.getLogger("toppra").setLevel(logging.CRITICAL)  # what goes wrong is said by an error


class Stages(LinearConstraint):  # type: ignore[misc]  # toppra is untyped
    """For toppra: |a u + b x| ≤ 1 at the start, middle and end of each piece of the path, and x ≤ `most`.

    x is the squared speed at the start of the piece and u its constant path acceleration; `a` and `b` are given as
    (at the grid, shape (k, dof); at the middles, shape (k - 1, dof)). With `hardest`, |u| is at most that.
    """

    def __init__(self, a: list[Array], b: list[Array], steps: Array, most: Array, hardest: float | None = None):
        super().__init__()
        self.identical, self.dof = True, a[0].shape[1]
        ahead = steps[:, None]
        self._a = _columns(a[0], a[1] + ahead * b[1], a[0][1:] + 2.0 * ahead * b[0][1:])
        self._b = _columns(b[0], b[1], b[0][1:])
        self._bounds = np.stack([np.zeros(len(most)), most], axis=1)
        self._hardest = None if hardest is None else np.tile([-hardest, hardest], (len(most), 1))

    def compute_constraint_params(self, *_: object) -> tuple[Array | None, ...]:
        """Coefficients a, b, c of v = a u + b x + c, then F v ≤ g, and the bounds of u and x."""
        rows = self._a.shape[1]
        sides = np.concatenate([np.eye(rows), -np.eye(rows)])
        return self._a, self._b, np.zeros_like(self._a), sides, np.ones(2 * rows), self._hardest, self._bounds


def _columns(start: Array, middle: Array, end: Array) -> Array:
    """Side by side; the last point of the grid starts no piece."""
    return np.hstack([start, np.vstack([middle, start[-1:]]), np.vstack([end, start[-1:]])])


class _Interval:
    """For toppra: a path of which only the interval is asked."""

    def __init__(self, dof: int, end: float):
        self.dof, self.path_interval = dof, np.array([0.0, end])


def fastest(stages: Stages, grid: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Speeds at the grid, shape (k,), and where no way was found."""
    search = TOPPRA([stages], _Interval(stages.dof, grid[-1]), grid, solver_wrapper="seidel")
    _, speed, _, reachable = search.compute_parameterization(0.0, 0.0, return_data=True)
    if speed is None:
        return np.zeros(len(grid)), np.isnan(reachable).any(axis=1)
    lost = ~np.isfinite(speed)
    lost[1:] |= speed[1:] + speed[:-1] <= 0.0
    return np.asarray(speed), lost
