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
from maniport.motion import place_path, plan_motion

TOLERANCE = 0.005  # how far beside its path the tip may be [m]; what is allowed is used


def main(folder):
    """Three seconds of climbing a ladder, on the Panda."""
    folder.mkdir(parents=True, exist_ok=True)
    # 1. The recording becomes joint angles of the person's arm, and these the ellipsoids and the path of the hand.
    recording = mp.read_recording(shipped_recording("ladder")).crop(22.0, 25.0).resample(15.0)
    person = mp.fit_arm(recording)
    profile = person.arm.manipulability(person.joint_angles)
    hand = person.arm.forward(person.joint_angles)[:, :3, 3]
    print(f"person: {len(person)} ellipsoids in {person.time[-1] - person.time[0]:.1f} s")

    # 2. What each arm can do, and the map between the two; the robot faces where the person faces.
    robot = mp.load_arm("panda")
    adapter = mp.ParallelTransport(damping=0.01, base_rotation=np.eye(3))
    adapter.fit(mp.sample_domain(person.arm, 4096, 0), mp.sample_domain(robot, 16384, 1))
    target, damping = adapter.transform(profile), adapter.student_regularization

    # 3. The path is placed where the robot makes these ellipsoids best; whatever turned them turns the path as well.
    placed = place_path(hand, target, robot, turn=adapter.map_rotation_, scale=(0.5, 1.0), damping=damping)
    print(placed)

    # 4. The motion: the tip on its path, the ellipsoids as near as that lets them, within the Panda's limits.
    (motion,) = plan_motion(
        robot, placed.profile, time=person.time, paths=placed.path, damping=damping, position_tolerance=TOLERANCE
    ).arms
    print(f"{motion.control_time[-1]:.1f} s, {motion.pointwise_ratio:.2f} times the pointwise optimum")
    for name, off in (("d", motion.distance), ("hand beside its path, mm:", 1e3 * motion.position_error)):
        most = f"{off.max():.2f} (largest, at {motion.time[off.argmax()]:.1f} s)"
        print(f"{name} {np.median(off):.2f} (median), {np.percentile(off, 95):.2f} (95 %), {most}")
    print(f"jerk {motion.rms_jerk:.0f} rad/s³ (root mean square); {mp.report.report_of(motion).metric('status').text}")

    # 5. The joints, for the robot's controller or a spreadsheet, and all arrays for NumPy.
    motion.save_joints_csv(folder / "joints.csv")
    motion.save_joints(folder / "joints.npz")
    print(f"joints in {folder / 'joints.csv'}, {len(motion.control_time)} rows")
    return motion


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
