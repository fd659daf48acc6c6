"""The group SO(d): its basis, exponential, distance, and the way back to it."""

import math
from functools import cache

import numpy as np

from maniport.util.validation import Array


@cache
def rotation_planes(d: int) -> list[tuple[int, int]]:
    """Rows and columns j, k of the basis Ω_a = e_j e_kᵀ − e_k e_jᵀ of the skew matrices, d (d − 1) / 2 of them."""
    return [(2, 1), (0, 2), (1, 0)] if d == 3 else [(j, k) for j in range(d) for k in range(j)]


@cache
def rotation_basis(d: int) -> Array:
    """Basis Ω_a of the skew matrices, shape (d (d − 1) / 2, d, d); for d = 3 that of the cross product."""
    pairs = rotation_planes(d)
    basis = np.zeros((len(pairs), d, d))
    for element, (row, column) in zip(basis, pairs, strict=True):
        element[row, column], element[column, row] = 1.0, -1.0
    basis.flags.writeable = False
    return basis


def random_rotation(d: int, random: np.random.Generator) -> Array:
    """Draw from SO(d) evenly: the Q of a Gaussian matrix's QR with positive diagonal of R (Mezzadri, 2007)."""
    q, r = np.linalg.qr(random.normal(size=(d, d)))
    q *= np.sign(r.diagonal())
    q[0] /= np.linalg.det(q)
    return np.asarray(q)


def rotation_from_vector(vector: Array) -> Array:
    """Return exp(Σ δ_a Ω_a), shape (d, d); for d = 3 the rotation by |δ| radians about δ."""
    if len(vector) == 3:
        return _about_axis(*map(float, vector))
    d = round((1 + math.sqrt(1 + 8 * len(vector))) / 2)
    skew = np.einsum("a,aij->ij", vector, rotation_basis(d))
    angles, planes = np.linalg.eigh(1j * skew)
    return np.asarray(((planes * np.exp(-1j * angles)) @ planes.conj().T).real)


def _about_axis(x: float, y: float, z: float) -> Array:
    """Rodrigues' formula I + s [v] + c [v]², with s = sin θ / θ and c = (1 − cos θ) / θ², θ = |v|."""
    angle = math.hypot(x, y, z)
    s, half = (math.sin(angle) / angle, math.sin(0.5 * angle) / angle) if angle > 0.0 else (1.0, 0.5)
    c = 2.0 * half * half
    return np.array(
        [
            [1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y],
            [c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x],
            [c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)],
        ]
    )


def rotation_angle(rotation: Array, other: Array) -> float:
    """Geodesic distance between two rotations [rad]: for d = 3 the angle of R₁ᵀ R₂."""
    # through the difference, which keeps small angles exact
    if len(rotation) <= 3:  # its only plane's chord appears twice among the singular values
        return 2.0 * math.asin(min(math.sqrt(0.5) * float(np.linalg.norm(rotation - other)) / 2.0, 1.0))
    chords = np.linalg.svd(rotation - other, compute_uv=False)[::2]
    return float(np.linalg.norm(2.0 * np.arcsin(np.clip(chords / 2.0, 0.0, 1.0))))


def orthonormal(matrix: Array) -> Array:
    """Nearest orthogonal matrix (polar factor)."""
    left, _, right = np.linalg.svd(matrix)
    return np.asarray(left @ right)
