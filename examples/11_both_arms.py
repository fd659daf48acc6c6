"""Both arms at once: a person's left arm becomes one robot's, the right one another's; the hands keep their relation.

You learn how two arms are loaded as one body, what both arms of a person are fitted to, and what comes out: both paths
with one place, one motion with one time for all joints, and how near the arms come to one another.

    python 11_both_arms.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import maniport as mp


def main(folder):
    """A second and a half of free motion, on two Pandas that stand 0.6 m apart."""
    folder.mkdir(parents=True, exist_ok=True)
    recording = mp.read_recording("both-arms").crop(5.1, 6.6)
    arms = mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])
    print(f"{arms.name}: {arms.dof} joints, from {arms.joint_names[0]} to {arms.joint_names[-1]}")
    result = mp.transfer_recording(recording, robot=arms, method="parallel-transport", planning_effort="quick")
    hands = mp.fit_arms(recording).hands
    apart = np.linalg.norm(hands[1] - hands[0], axis=-1)
    tips = np.linalg.norm(np.diff(arms.forward(result.motion.trajectory.joint_positions)[:, :, :3, 3], axis=1)[:, 0], axis=-1)
    scale = result.arms[0].placement.scale
    print(
        f"the hands are {apart.min():.2f} to {apart.max():.2f} m apart, the tips {tips.min():.2f} to {tips.max():.2f} m"
    )
    print(f"(their paths are {scale:.2f} times the hands')")
    for arm in result.arms:
        motion = arm.motion
        print(
            f"{arm.name:>5}: ellipsoids at {np.median(motion.distance):.2f} (median) from the targets, the tip "
            f"{1e3 * np.percentile(motion.position_error, 95):.1f} mm beside its path (95 %)"
        )
    clearance = result.motion.clearance
    print(f"{np.ptp(result.motion.trajectory.control_time):.1f} s; nearest to a collision: {' and '.join(clearance.pair)}, "
          f"{1e3 * clearance.distance:.0f} mm apart")  # fmt: skip
    result.save(folder / "both", overwrite=True)
    print(f"joints of both in {folder / 'both' / 'joints.csv'}")
    return result


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
