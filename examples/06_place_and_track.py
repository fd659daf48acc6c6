"""Trajectory from a recording.

The example calls the steps of `maniport.transfer_recording` separately: fit, transfer, placement, planning, export. The
placement scales and moves the hand path, because feasible ellipsoids depend on the position and robots differ in size.
The motion starts and ends at rest. `pointwise_ratio` compares it with the best pointwise solution found.

    python 06_place_and_track.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.mocap import shipped_recording
from maniport.motion import PlacementOptions, PlanOptions, TargetTrajectory, place_path, plan_motion

TOLERANCE = (
    0.005  # of the end-effector position [m]; the planner uses it to reduce the ellipsoid distance
)


def main(folder):
    """Transfer three seconds of climbing a ladder to the Panda."""
    folder.mkdir(parents=True, exist_ok=True)
    # 1. Fit the person's arm; joint angles give ellipsoids and hand path.
    recording = mp.read_recording(shipped_recording("ladder")).crop(22.0, 25.0)
    recording = mp.Recording(
        recording.names, recording.positions[::2], recording.time[::2]
    )  # 15 Hz
    person = mp.fit_arm(recording)
    profile = person.arm.manipulability(person.joint_angles)
    hand = person.arm.forward(person.joint_angles)[:, :3, 3]
    print(f"person: {len(person)} ellipsoids in {person.time[-1] - person.time[0]:.1f} s")

    # 2. Sample both domains and fit the map between them. Both bases have the same orientation.
    robot = mp.load_arm("panda")
    adapter = mp.ScaledTransport(damping=0.01, base_rotation=np.eye(3))
    adapter.fit(mp.sample_domain(person.arm, 4096, 0), mp.sample_domain(robot, 16384, 1))
    target, damping = adapter.transform(profile), adapter.student_regularization

    # 3. Place the path where the robot reaches the target ellipsoids best; it rotates with the ellipsoids.
    targets = TargetTrajectory.checked(robot, person.time, target, positions=hand, damping=damping)
    placed = place_path(
        robot, targets, PlacementOptions(scale=(0.5, 1.0)), map_rotation=adapter.map_rotation_
    )[0]
    print(placed)

    # 4. Plan the trajectory: position within the tolerance, smallest ellipsoid distance, within the Panda's limits.
    options = PlanOptions(position_tolerance=TOLERANCE)
    (motion,) = plan_motion(
        robot, placed.moved(targets), options, starts=[placed.joint_positions]
    ).arms
    print(
        f"duration {motion.control_time[-1]:.1f} s; ratio to the pointwise optimum {motion.pointwise_ratio:.2f}"
    )
    for name, values in (
        ("distance", motion.distance),
        ("position error [mm]", 1e3 * motion.position_error),
    ):
        largest = f"{values.max():.2f} (max at {motion.time[values.argmax()]:.1f} s)"
        print(
            f"{name}: {np.median(values):.2f} (median), {np.percentile(values, 95):.2f} (95 %), {largest}"
        )

    # 5. Export joint positions for the robot's controller, and all arrays for NumPy.
    motion.save_joints_csv(folder / "joints.csv")
    motion.save_joints(folder / "joints.npz")
    print(f"joints in {folder / 'joints.csv'}, {len(motion.control_time)} rows")
    return motion


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
