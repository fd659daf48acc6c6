"""Profile of ellipsoids from a recording.

The example reads a recording (BVH or C3D), fits an arm with the person's segment lengths, and reports unobservable
joints. Ellipsoids that depend on an unobservable joint are unreliable.

    python 03_from_a_recording.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.mocap import shipped_recording
from maniport.report import figures
from maniport.util.files import save_ellipsoids


def sensitivity(fit, profile):
    """Return the distances that random angles of the unobservable joints cause, shape (n,)."""
    if fit.observable.all():
        return np.zeros(1)
    joints, rng = fit.joint_angles.copy(), np.random.default_rng(0)
    free = ~fit.observable
    joints[:, free] = rng.uniform(fit.arm.lower[free], fit.arm.upper[free], (len(fit), free.sum()))
    damping = (
        0.01 * np.trace(profile.mean(axis=0)) / 3.0 * np.eye(3)
    )  # keeps distances of flat ellipsoids finite
    return mp.spd.distance(profile + damping, fit.arm.manipulability(joints) + damping)


def main(folder):
    """Fit the arm to two recordings: bones of a motion-capture suit, and markers on the skin."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, start, stop in (("ladder", 22.0, 26.0), ("freeform", 2.0, 6.0)):
        # 1. Units and gaps are detected and printed.
        recording = mp.read_recording(shipped_recording(name)).crop(start, stop)
        print(recording)

        # 2. Fit segment lengths and joint angles; the base frame is the trunk. Poor fits have warnings.
        fit = mp.fit_arm(recording, "myoarm")
        for warning in fit.quality_warnings:
            print(f"  warning: {warning}")
        lengths = ", ".join(
            f"{segment} {length:.3f} m" for segment, length in fit.segment_lengths.items()
        )
        print(f"  {lengths}")
        for segment, residual in fit.residual_summary().items():
            print(
                f"  {segment}: residual {residual['median']:.2f}° (median), {residual['p95']:.2f}° (95th percentile), "
                f"{residual['max']:.2f}° (max at {residual['max_at_s']:.1f} s)"
            )
        for reason in dict.fromkeys(fit.unobservable.values()):
            joints = ", ".join(
                joint for joint in fit.unobservable if fit.unobservable[joint] == reason
            )
            print(f"  unobservable: {joints} ({reason})")

        # 3. The profile: the ellipsoid of the hand in each frame.
        profile = fit.arm.manipulability(fit.joint_angles)
        change, longest = sensitivity(fit, profile), mp.spd.lengths(profile)[:, 2]
        print(
            f"  change by unobservable joints: d = {np.median(change):.3f} (median), {change.max():.3f} (max)"
        )
        print(f"  longest semi-axis {longest.min():.2f} to {longest.max():.2f} m/s per rad/s")

        save_ellipsoids(folder / f"{name}.npz", profile, fit.time)
        skeletons, roles = {"person": fit.arm.skeleton(fit.joint_angles)}, {"person": "person"}
        figures.save(
            figures.arms(skeletons, {"person": profile}, roles=roles), folder / f"{name}_arm.png"
        )
        figures.save(figures.curves(fit.time, {"person": profile}), folder / f"{name}_curves.png")
    print(f"profiles and figures in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
