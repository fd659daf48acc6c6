"""Both arms on two robots.

The left arm of a person maps to one robot, the right arm to another. Both paths get one placement, all joints one time
parameterization, and the clearance between the arms is checked.

    python 11_both_arms.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import maniport as mp


def main(folder):
    """Transfer 1.5 s of free motion to two Pandas 0.6 m apart."""
    folder.mkdir(parents=True, exist_ok=True)
    recording = mp.read_recording("both-arms").crop(5.1, 6.6)
    arms = mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])
    print(f"{arms.name}: {arms.dof} joints, from {arms.joint_names[0]} to {arms.joint_names[-1]}")
    result = mp.transfer_recording(recording, robot=arms, method="scaled-transport")

    # Distances between the hands and between the end effectors differ by the scale of the placement.
    hands = mp.fit_arms(recording).hands
    ends = arms.forward(result.motion.trajectory.joint_positions)[:, :, :3, 3]
    person, robot = (
        np.linalg.norm(hands[1] - hands[0], axis=-1),
        np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1),
    )
    print(
        f"distance of the hands {person.min():.2f} to {person.max():.2f} m, of the end effectors ",
        end="",
    )
    print(f"{robot.min():.2f} to {robot.max():.2f} m (scale {result.arms[0].placement.scale:.2f})")

    for arm in result.arms:
        distance = np.median(arm.motion.distance)
        error = 1e3 * np.percentile(arm.motion.position_error, 95)
        print(
            f"{arm.name:>5}: ellipsoid distance {distance:.2f} (median), position error {error:.1f} mm (95 %)"
        )
    clearance, duration = result.motion.clearance, np.ptp(result.motion.trajectory.control_time)
    print(
        f"duration {duration:.1f} s; clearance {1e3 * clearance.distance:.0f} mm ({' and '.join(clearance.pair)})"
    )
    result.save(folder / "both", overwrite=True)
    print(f"joints in {folder / 'both' / 'joints.csv'}")
    return result


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
