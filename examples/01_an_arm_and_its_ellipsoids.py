"""Manipulability ellipsoids of an arm.

Joint velocities of unit norm give end-effector velocities inside the ellipsoid vᵀ M⁻¹ v ≤ 1 with M = J Jᵀ. The force
ellipsoid is its inverse: large forces act in slow directions. As the arm stretches, one semi-axis goes to zero.

    python 01_an_arm_and_its_ellipsoids.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.report import figures

BENT = np.array([0.0, -0.3, 0.0, -2.4, 0.0, 2.1, 0.8])  # [rad]
STRETCHED = np.array([0.0, 0.6, 0.0, -0.07, 0.0, 0.6, 0.8])  # the elbow is at its limit


def largest_quadratic_form(arm, q, count=10_000):
    """Return the largest vᵀ M⁻¹ v of random joint velocities of unit norm."""
    velocities = np.random.default_rng(0).standard_normal((count, arm.dof))
    velocities /= np.linalg.norm(velocities, axis=1, keepdims=True)
    v = velocities @ arm.jacobian(q)[:3].T
    return np.einsum("ni,ij,nj->n", v, np.linalg.inv(arm.manipulability(q)), v).max()


def main(folder):
    """Print the ellipsoids of two configurations and plot the interpolation between them."""
    folder.mkdir(parents=True, exist_ok=True)
    arm = mp.load_arm("panda")  # or "myoarm", "rhuman", a URDF or an MJCF file
    print(arm)
    for name, q in (("bent", BENT), ("stretched", STRETCHED)):
        lengths, directions = mp.spd.axes(arm.manipulability(q))
        shortest = ", ".join(f"{part:.2f}" for part in directions[:, 0] * np.sign(directions[2, 0]))
        print(
            f"{name:>9}: semi-axes {lengths[2]:.3f}, {lengths[1]:.3f}, {lengths[0]:.3f} m/s per rad/s; shortest along "
            f"({shortest}); max of vᵀ M⁻¹ v for 10 000 random velocities {largest_quadratic_form(arm, q):.3f} (≤ 1)"
        )

    # Semi-axes of the force ellipsoid are the reciprocals of those of the velocity ellipsoid.
    force = mp.spd.lengths(arm.manipulability(BENT, kind="force"))
    velocity = mp.spd.lengths(arm.manipulability(BENT))
    print(
        f"force times velocity along each axis of the bent arm: {np.round(force[::-1] * velocity, 6)}"
    )

    # Joints have different velocity limits. With these as weights, semi-axes are end-effector velocities in m/s.
    weighted = mp.spd.lengths(arm.manipulability(BENT, joint_weights="joint-limits"))
    print(
        f"weighted by the velocity limits: {weighted[2]:.2f}, {weighted[1]:.2f}, {weighted[0]:.2f} m/s"
    )

    # All functions take any number of configurations: here 50 between the two, in joint space.
    time = np.linspace(0.0, 1.0, 50)
    joints = BENT + time[:, None] * (STRETCHED - BENT)
    profile = arm.manipulability(joints)
    roles = {"panda": "achieved"}  # green: the color of the robot in all figures
    figures.save(
        figures.arms({"panda": arm.skeleton(joints)}, {"panda": profile}, roles=roles),
        folder / "arm.png",
    )
    figures.save(figures.curves(time, {"achieved": profile}), folder / "curves.png")
    print(f"figures in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
