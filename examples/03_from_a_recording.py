"""Profile of ellipsoids from a recording.

The example reads a recording (BVH or C3D), fits an arm with the person's segment lengths, and reports unobservable
joints. Ellipsoids that depend on an unobservable joint are unreliable.

    python 03_from_a_recording.py [FOLDER]
"""

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.mocap import shipped_recording
from maniport.report import figures
from maniport.util.files import save_ellipsoids


def uncertainty(fit, profile):
    """How far the ellipsoids move, in units of d, when the joints that are not determined take other angles."""
    if fit.observable.all():
        return np.zeros(1)
    other, rng = fit.joint_angles.copy(), np.random.default_rng(0)
    guessed = ~fit.observable
    other[:, guessed] = rng.uniform(fit.arm.lower[guessed], fit.arm.upper[guessed], (len(fit), guessed.sum()))
    lift = 0.01 * np.trace(profile.mean(axis=0)) / 3.0 * np.eye(3)  # so that flat ellipsoids can be compared
    return mp.spd.distance(profile + lift, fit.arm.manipulability(other) + lift)


def main(folder):
    """Two recordings: bones of a motion-capture suit, and markers on the skin."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, start, stop in (("ladder", 22.0, 26.0), ("freeform", 2.0, 6.0)):
        # 1. Units, the axis that points up and gaps are recognised, and what was decided is told.
        recording = mp.read_recording(shipped_recording(name)).crop(start, stop)
        print(recording)

        # 2. The arm of a person of this size, and its angles; its base frame is the trunk.
        #    Where person and model differ too much, a warning says so, and what to do about it.
        with warnings.catch_warnings(record=True) as quality_warnings:
            warnings.simplefilter("always")
            fit = mp.fit_arm(recording, "myoarm")
        for doubt in quality_warnings:
            print(f"  doubtful: {doubt.message}")
        lengths = ", ".join(f"{segment} {length:.3f} m" for segment, length in fit.segment_lengths.items())
        print(f"  {lengths}; largest change from frame to frame {fit.largest_step[0]:.1f}°")
        for segment, residual in fit.residual_summary().items():
            print(
                f"  {segment}: {residual['median']:.2f}° beside the recording (median), {residual['p95']:.2f}° (95 %), "
                f"{residual['max']:.2f}° (largest, at {residual['max_at_s']:.1f} s)"
            )
        for reason in dict.fromkeys(fit.unobservable.values()):
            joints = ", ".join(joint for joint, why in fit.unobservable.items() if why == reason)
            print(f"  guesses: {joints} ({reason})")

        # 3. The profile: the ellipsoid of the hand at each time.
        profile = fit.arm.manipulability(fit.joint_angles)
        moved = uncertainty(fit, profile)
        print(
            f"  with other guesses the ellipsoids move by d = {np.median(moved):.3f} (median), {moved.max():.3f} (most)"
        )
        steps = mp.spd.lengths(profile)
        print(f"  longest semi-axis {steps[:, 2].min():.2f} to {steps[:, 2].max():.2f} m/s per rad/s")

        save_ellipsoids(folder / f"{name}.npz", profile, fit.time)
        skeletons = {"person": fit.arm.skeleton(fit.joint_angles)}
        figures.save(
            figures.arms(skeletons, {"person": profile}, roles={"person": "person"}), folder / f"{name}_arm.png"
        )
        figures.save(figures.curves(fit.time, {"person": profile}), folder / f"{name}_curves.png")
    print(f"profiles and figures in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
