"""Distances, means and geodesics of ellipsoids.

Symmetric positive-definite matrices with the affine-invariant metric form a manifold. Entrywise operations have three
faults: the mean of two slender ellipsoids is thick, extrapolation leaves the set of ellipsoids, and distances depend on
the unit of length. The affine-invariant operations have none of them.

    python 02_the_space_of_ellipsoids.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.report import figures


def slender(degrees):
    """Return an ellipsoid with semi-axes 0.9, 0.3 and 0.3, rotated in the xy plane."""
    angle = np.radians(degrees)
    rotation = np.array(
        [[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    return rotation @ np.diag([0.9, 0.3, 0.3]) ** 2 @ rotation.T


def main(folder):
    """Compare entrywise and affine-invariant operations."""
    folder.mkdir(parents=True, exist_ok=True)
    a, b = slender(0.0), slender(70.0)
    print(f"volumes: a {mp.spd.volume(a):.4f}, b {mp.spd.volume(b):.4f}")

    # Mean: the arithmetic mean has a larger volume, the Fréchet mean keeps the volume.
    arithmetic, frechet = (a + b) / 2.0, mp.spd.mean([a, b])
    print(
        f"volume of the mean: arithmetic {mp.spd.volume(arithmetic):.4f}, Fréchet {mp.spd.volume(frechet):.4f}"
    )

    # Distance: invariant under changes of unit and frame, even of a frame that is not orthogonal.
    change = np.array(
        [[1.0, 0.2, 0.0], [0.0, 100.0, 0.0], [0.0, 0.0, 1.0]]
    )  # y in centimeters, x sheared
    a2, b2 = change @ a @ change.T, change @ b @ change.T
    print(
        f"affine-invariant distance: {mp.spd.distance(a, b):.4f}, in other coordinates {mp.spd.distance(a2, b2):.4f}"
    )
    print(
        f"Frobenius distance: {np.linalg.norm(a - b):.4f}, in other coordinates {np.linalg.norm(a2 - b2):.1f}"
    )

    # Extrapolation: entrywise, the result is soon not positive definite.
    linear, geodesic = a + 2.0 * (b - a), mp.spd.geodesic(a, b, 2.0)
    print(
        f"extrapolation to twice the distance: smallest eigenvalue {np.linalg.eigvalsh(linear)[0]:.3f} entrywise, "
        f"{np.linalg.eigvalsh(geodesic)[0]:.4f} on the geodesic, at distance {mp.spd.distance(a, geodesic):.4f}"
    )

    # Tangent vectors: the logarithm is the initial velocity of the geodesic from a to b; exp is its inverse.
    velocity = mp.spd.log(a, b)
    print(f"error of exp(log): {mp.spd.distance(mp.spd.exp(a, velocity), b):.1e}")

    # Parallel transport moves a tangent vector to another point and keeps its length.
    other = np.diag([0.2, 0.5, 1.1]) ** 2
    end = mp.spd.exp(other, mp.spd.transport(velocity, a, other))
    print(
        f"the same change at another ellipsoid: distance {mp.spd.distance(other, end):.4f}; "
        f"added entrywise: smallest eigenvalue {np.linalg.eigvalsh(other + (b - a))[0]:.3f}"
    )

    fraction = np.linspace(0.0, 1.0, 9)
    curves = {
        "entrywise": a + fraction[:, None, None] * (b - a),
        "geodesic": mp.spd.geodesic(a, b, fraction),
    }
    figures.save(
        figures.ellipsoids(fraction, curves, axis="fraction of the distance"),
        folder / "geodesics.png",
    )
    print(f"figure in {folder / 'geodesics.png'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
