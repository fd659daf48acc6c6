"""Weighted tracking of several demonstrations.

The example aligns demonstrations of different speed, learns mean and covariance with `ProfileGMM`, and converts the
covariance to weights for `track`. The hand path is 10 cm above the demonstrated one, so the targets are infeasible.
With weights, the errors are in times and directions of large variance.

    python 07_several_demonstrations.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.learning import tracking_weights

HOME = np.array([0.3, -0.6, 0.2, -2.1, 0.3, 1.7, 0.5])  # [rad]
AMPLITUDE = np.array([0.5, 0.4, -0.3, 0.4, 0.5, -0.4, 0.0])  # [rad]


def demonstrations(count, seed=0):
    """Yield times (n,) and joint angles (n, 7) of a Panda; speeds differ, and the variance is largest in the middle."""
    rng = np.random.default_rng(seed)
    for duration in rng.uniform(3.0, 5.0, count):
        time = np.linspace(0.0, duration, int(15 * duration))
        phase = np.sin(np.pi * (time[:, None] / duration) ** rng.uniform(0.8, 1.25))
        noise = 0.01 * rng.standard_normal(7) + 0.3 * rng.standard_normal(7) * phase**2
        yield time, HOME + AMPLITUDE * phase + noise


def deviation(profile, covariance, ellipsoids):
    """Return distances from the mean profile in standard deviations of the demonstrations, shape (n,)."""
    whitening = mp.spd.powm(profile, -0.5)
    error = mp.spd.to_vector(mp.spd.logm(whitening @ ellipsoids @ whitening))
    return np.sqrt(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error))


def main(folder):
    """Learn a profile from six demonstrations and track it without and with weights."""
    folder.mkdir(parents=True, exist_ok=True)
    arm = mp.load_arm("panda")
    times, joints = zip(*demonstrations(6), strict=True)
    alignment = mp.align([arm.manipulability(q) for q in joints], times)  # dynamic time warping
    lengths = ", ".join(str(len(time)) for time in times)
    print(f"demonstrations of {lengths} ellipsoids, aligned to {len(alignment.time)}")

    model = mp.ProfileGMM().fit(
        *alignment.stacked()
    )  # held-out ones select the number of Gaussians
    profile, covariance = model.predict(alignment.time, return_covariance=True)
    deviations = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    similar = deviations < np.median(deviations)
    print(
        f"{model.n_components_} Gaussians; standard deviation {deviations.min():.2f} to {deviations.max():.2f}"
    )

    demonstrated = alignment.warp([arm.forward(q)[:, :3, 3] for q in joints]).mean(axis=0)
    path = demonstrated + np.array([0.0, 0.0, 0.1])
    start = mp.nearest_feasible(arm, profile[:1], positions=path[:1]).joint_positions[0]
    for name, weights in (("without", None), ("with", tracking_weights(covariance))):
        targets = mp.motion.TargetTrajectory.checked(
            arm,
            alignment.time,
            profile,
            positions=path,
            direction_weights=weights,
        )
        options = mp.motion.TrackOptions(position_cost=10.0)
        motion = mp.track(arm, targets, options, start=start).arms[0]
        error = 1e3 * motion.position_error
        rms = np.sqrt(np.mean(deviation(profile, covariance, motion.achieved) ** 2))
        print(
            f"{name:>7} weights: {rms:.2f} standard deviations from the mean profile; position error "
            f"{error[similar].mean():.0f} mm where the variance is small, {error[~similar].mean():.0f} mm elsewhere"
        )
    aligned = {"time": alignment.time, "demonstrated": alignment.ellipsoids}
    np.savez(folder / "profiles.npz", **aligned, mean=profile, covariance=covariance)
    motion.save_joints_csv(folder / "joints.csv")
    print(f"profiles and last motion in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="maniport-")))
