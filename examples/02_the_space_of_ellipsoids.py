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
    """An ellipsoid of semi-axes 0.9, 0.3 and 0.3, its long axis turned in the plane of x and y."""
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    return turn @ np.diag([0.9, 0.3, 0.3]) ** 2 @ turn.T


def main(folder):
    """Compare the two geometries in five questions."""
    folder.mkdir(parents=True, exist_ok=True)
    a, b = slender(0.0), slender(70.0)
    print(f"volumes: a {mp.spd.volume(a):.4f}, b {mp.spd.volume(b):.4f}")

    # 1. What lies in the middle? The arithmetic mean swells; the Fréchet mean keeps the volume.
    arithmetic, frechet = (a + b) / 2.0, mp.spd.mean([a, b])
    print(f"their mean: arithmetic {mp.spd.volume(arithmetic):.4f}, Fréchet {mp.spd.volume(frechet):.4f}")

    # 2. How far apart are they? Another unit, or another frame that is not even orthogonal, must not matter.
    change = np.array([[1.0, 0.2, 0.0], [0.0, 100.0, 0.0], [0.0, 0.0, 1.0]])  # y in centimetres, x sheared
    a_there, b_there = change @ a @ change.T, change @ b @ change.T
    print(
        f"distance: {mp.spd.distance(a, b):.4f}, in other coordinates {mp.spd.distance(a_there, b_there):.4f}; "
        f"of the entries: {np.linalg.norm(a - b):.4f} and {np.linalg.norm(a_there - b_there):.1f}"
    )

    # 3. What comes after b on the way from a? Entry by entry, soon nothing that is an ellipsoid.
    beyond = a + 2.0 * (b - a)
    further = mp.spd.geodesic(a, b, 2.0)
    print(f"twice the way: smallest eigenvalue {np.linalg.eigvalsh(beyond)[0]:.3f} entry by entry, ", end="")
    print(f"{np.linalg.eigvalsh(further)[0]:.4f} on the geodesic, at distance {mp.spd.distance(a, further):.4f}")

    # 4. Which way, and how fast? A logarithm is a velocity at a; the exponential map follows it.
    velocity = mp.spd.log(a, b)
    print(f"exp of log: off by {mp.spd.distance(mp.spd.exp(a, velocity), b):.1e}")

    # 5. What is the same change elsewhere? Parallel transport carries it, and keeps its length.
    elsewhere = np.diag([0.2, 0.5, 1.1]) ** 2
    carried = mp.spd.transport(velocity, a, elsewhere)
    end = mp.spd.exp(elsewhere, carried)
    print(f"the same change from another ellipsoid: distance {mp.spd.distance(elsewhere, end):.4f}; ", end="")
    print(f"added entry by entry: smallest eigenvalue {np.linalg.eigvalsh(elsewhere + (b - a))[0]:.3f}")

    time = np.linspace(0.0, 1.0, 9)
    straight = a + time[:, None, None] * (b - a)
    ways = {"entry by entry": straight, "geodesic": mp.spd.geodesic(a, b, time)}
    figures.save(figures.ellipsoids(time, ways, axis="part of the way"), folder / "ways.png")
    print(f"figure in {folder / 'ways.png'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
