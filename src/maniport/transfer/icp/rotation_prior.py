"""A penalty that holds a rotation near a known one along directions that nothing else determines."""

from dataclasses import dataclass

import numpy as np

from maniport.transfer.rotation_group import rotation_basis
from maniport.validation import Array


@dataclass(frozen=True)
class RotationPrior:
    """P(R) = ½ w ‖R − R₀‖², which is w (d − tr(R R₀ᵀ)): w θ² for a small turn by θ, and 2 w (1 − cos θ) for any.

    Attributes
    ----------
    rotation : ndarray, shape (d, d)
        R₀.
    weight : float
        w, in squared distance per squared radian.
    """

    rotation: Array
    weight: float

    def cost(self, rotation: Array) -> float:
        """P(R); the squared difference keeps digits that d − tr would lose near R₀."""
        return float(0.5 * self.weight * np.sum((rotation - self.rotation) ** 2))

    def derivatives(self, rotation: Array) -> tuple[float, Array, Array]:
        """Cost, gradient (m,) and Hessian (m, m) for R ← exp(Σ δ_a Ω_a) R at δ = 0.

        Since exp(Ω) = I + Ω + ½ Ω² + …, they are −w tr(Ω_a Q) and −½ w tr((Ω_a Ω_b + Ω_b Ω_a) Q) with Q = R R₀ᵀ.
        """
        basis, turned = rotation_basis(len(rotation)), rotation @ self.rotation.T
        gradient = -self.weight * np.einsum("aij,ji->a", basis, turned)
        products = np.einsum("aij,bjk,ki->ab", basis, basis, turned)
        return self.cost(rotation), gradient, -0.5 * self.weight * (products + products.T)
