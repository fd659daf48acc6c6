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
STRETCHED = np.array([0.0, 0.6, 0.0, -0.07, 0.0, 0.6, 0.8])  # the elbow at its limit


def fastest_inside(arm, q, count=10_000):
    """Largest vᵀ M⁻¹ v over hand velocities that random joint velocities of unit length give."""
    velocities = np.random.default_rng(0).standard_normal((count, arm.dof))
    velocities /= np.linalg.norm(velocities, axis=1, keepdims=True)
    hand = velocities @ arm.jacobian(q)[:3].T
    return np.einsum("ni,ij,nj->n", hand, np.linalg.inv(arm.manipulability(q)), hand).max()


def main(folder):
    """Two postures in numbers, and the way from one to the other as figures."""
    folder.mkdir(parents=True, exist_ok=True)
    arm = mp.load_arm("panda")  # or "myoarm", "rhuman", a URDF or an MJCF file
    print(arm)
    for name, q in (("bent", BENT), ("stretched", STRETCHED)):
        lengths, directions = mp.spd.axes(arm.manipulability(q))
        slow = ", ".join(f"{part:.2f}" for part in directions[:, 0] * np.sign(directions[2, 0]))
        print(
            f"{name:>9}: semi-axes {lengths[2]:.3f}, {lengths[1]:.3f}, {lengths[0]:.3f} m/s per rad/s; "
            f"slowest along ({slow}); fastest of 10 000 velocities at {fastest_inside(arm, q):.3f} of the edge (≤ 1)"
        )

    # Forces are the other way round: unit joint torques press hardest where the hand is slowest.
    force = mp.spd.lengths(arm.manipulability(BENT, kind="force"))
    speed = mp.spd.lengths(arm.manipulability(BENT))
    print(f"force times speed along each axis of the bent arm: {np.round(force[::-1] * speed, 6)}")

    # Joints are not equally fast: weighted by their limits, the ellipsoid is that of the real hand's speed.
    real = mp.spd.lengths(arm.manipulability(BENT, joint_weights="velocity-limits"))
    print(f"with the joints' own largest speeds: {real[2]:.2f}, {real[1]:.2f}, {real[0]:.2f} m/s")

    # Any number of postures at once: the straight way between the two, in joint space.
    time = np.linspace(0.0, 1.0, 50)
    joints = BENT + time[:, None] * (STRETCHED - BENT)
    profile = arm.manipulability(joints)
    roles = {"panda": "achieved"}  # green, as what a robot makes is on every page
    figures.save(figures.arms({"panda": arm.skeleton(joints)}, {"panda": profile}, roles=roles), folder / "arm.png")
    figures.save(figures.curves(time, {"panda": profile}, roles=roles), folder / "curves.png")
    print(f"figures in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
