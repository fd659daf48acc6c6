"""The rotation step on PyManOpt: F(R) = Σ w_i d²(S_i, R T_i Rᵀ) over SO(d), vectorised over the pairs."""

from typing import Any

import autograd.numpy as anp
import numpy as np
import pymanopt
from numpy.typing import NDArray
from pymanopt.manifolds import SpecialOrthogonalGroup
from pymanopt.optimizers import TrustRegions

Array = NDArray[np.float64]


class PymanoptRotation:
    """Trust regions with gradient and Hessian by automatic differentiation of the cost.

    Steepest descent with the gradient in closed form is as fast per run but stalls at gradient norms near 1e-7.

    Parameters
    ----------
    student, teacher : ndarray, shape (n, d, d)
        Pairs S_i, T_i.
    weights : ndarray, shape (n,)
    """

    def __init__(self, student: Array, teacher: Array, weights: Array):
        manifold = SpecialOrthogonalGroup(student.shape[-1])
        whitening = np.linalg.inv(np.linalg.cholesky(student))
        unwhitening = np.swapaxes(whitening, -1, -2)

        @pymanopt.function.autograd(manifold)
        def cost(rotation: Array) -> Any:
            turned = anp.matmul(anp.matmul(rotation, teacher), anp.transpose(rotation))
            values, _ = anp.linalg.eigh(anp.matmul(anp.matmul(whitening, turned), unwhitening))
            return anp.sum(weights * anp.sum(anp.log(values) ** 2, axis=-1))

        self._problem = pymanopt.Problem(manifold, cost)

    def cost(self, rotation: Array) -> float:
        """F(R)."""
        return float(self._problem.cost(rotation))

    def minimize(self, start: Array, tol: float = 1e-9) -> Array:
        """Descend from `start` until the gradient norm, for rotations in radians, is at most `tol`."""
        # PyManOpt holds the gradient as a skew matrix of half its entries, whose norm is 1/√2 of the vector's
        optimizer = TrustRegions(
            min_gradient_norm=tol / np.sqrt(2.0), max_iterations=200, verbosity=0
        )
        return np.asarray(optimizer.run(self._problem, initial_point=start).point)
