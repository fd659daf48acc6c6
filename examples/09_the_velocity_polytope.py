"""Ellipsoid and velocity polytope.

Velocity limits of single joints give a polytope of end-effector velocities. With the limits as joint weights, the
ellipsoid is the image of the largest ellipsoid in the box of joint velocities. It is smooth, with distances, means and
derivatives in closed form. Scaled by √n for n joints, it contains the polytope. Toward the corners of the polytope, the
velocity is larger than the ellipsoid indicates.

The package `pycapacity` (MIT) computes the same polytope with `robot.velocity_polytope(J, limits, -limits)`. It depends
on cvxopt (GPL-3.0), so this example uses SciPy's convex hull.

    python 09_the_velocity_polytope.py [FOLDER]
"""

import sys
import tempfile
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

import maniport as mp
from maniport.report.page.content import ACHIEVED, REFERENCE
from maniport.spd.ellipsoid import axes, volume

CONFIGURATION = [0.0, -0.4, 0.5, -1.8, -0.6, 1.7, 0.0]  # [rad]


def polytope(jacobian, limits):
    """Return vertices (k, 3) [m/s], normals (m, 3) and distances (m,) of the faces, and the volume."""
    box = np.array(list(product(*zip(-limits, limits, strict=True))))
    hull = ConvexHull(box @ jacobian.T)
    return hull.points[hull.vertices], hull.equations[:, :3], -hull.equations[:, 3], hull.volume


def plot(vertices, ellipsoid):
    """Plot side and top view; the outline of a projection is the hull of the projected vertices."""
    figure, angle = (
        Figure(figsize=(7.0, 3.2), layout="constrained"),
        np.linspace(0.0, 2.0 * np.pi, 200),
    )
    for panel, (i, j) in zip(figure.subplots(1, 2), ((0, 2), (0, 1)), strict=True):
        flat = vertices[:, [i, j]]
        outline = flat[ConvexHull(flat).vertices]
        panel.fill(*outline.T, color=REFERENCE.pale, alpha=0.4, label="polytope")
        lengths, directions = axes(ellipsoid[np.ix_([i, j], [i, j])])
        rim = directions @ (lengths[:, None] * [np.cos(angle), np.sin(angle)])
        panel.plot(*rim, color=ACHIEVED.color, label="ellipsoid")
        panel.plot(*(7**0.5 * rim), "--", color=ACHIEVED.color, label="ellipsoid × √7")
        panel.set(xlabel=f"{'xyz'[i]} [m/s]", ylabel=f"{'xyz'[j]} [m/s]", aspect="equal")
    figure.legend(
        *panel.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False
    )
    return figure


def main(folder):
    """Compare ellipsoid and polytope of the Panda in one configuration."""
    folder.mkdir(parents=True, exist_ok=True)
    robot = mp.load_arm("panda")
    jacobian, limits = robot.jacobian(CONFIGURATION)[:3], robot.velocity_limits
    vertices, normals, distances, size = polytope(jacobian, limits)
    ellipsoid = robot.manipulability(
        CONFIGURATION, joint_weights="joint-limits"
    )  # J W² Jᵀ, W the limits
    print(
        f"polytope: {len(vertices)} vertices, {size:.1f} (m/s)³; ellipsoid: {volume(ellipsoid):.1f} (m/s)³"
    )

    # Support of the ellipsoid over the distance of each face: between 1/√n and 1.
    ratio = np.sqrt(np.einsum("ni,ij,nj->n", normals, ellipsoid, normals)) / distances
    print(f"ratio to the faces: {ratio.min():.2f} to {ratio.max():.2f}; 1/√7 = {7**-0.5:.2f}")

    # The fastest direction of each: the farthest vertex and the longest semi-axis.
    fastest = vertices[np.linalg.norm(vertices, axis=1).argmax()]
    lengths, directions = axes(ellipsoid)
    angle = np.degrees(np.arccos(abs(directions[:, -1] @ fastest) / np.linalg.norm(fastest)))
    print(
        f"fastest {np.linalg.norm(fastest):.2f} m/s, longest semi-axis {lengths[-1]:.2f} m/s, angle {angle:.0f}°"
    )
    plot(vertices, ellipsoid).savefig(folder / "polytope.png", dpi=200)
    print(f"figure in {folder / 'polytope.png'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
