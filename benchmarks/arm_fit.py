"""Joint angles of a recorded arm: frames a second and memory as recordings grow, beside SciPy frame by frame."""

import json
import sys
import time
from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from maniport.arms import myoarm
from maniport.mocap import Recording, fit_arm, synthetic_recording
from maniport.mocap.directions import AXES, SEGMENTS, Directions

from .inputs import Array
from .measure import Row, duration, fresh_process, megabytes, peak_memory

SIZES = (1_000, 10_000, 100_000)
WANTED = 2_000.0
"""Frames a second."""
RATE = 120.0  # Hz
NOISE = 5e-4
"""Of markers in each direction [m]."""
PEER_FRAMES = 300


def rows(quick: bool) -> Iterator[Row]:
    """A process for each size; then SciPy on the first frames of the same motion."""
    per_frame = 0.0
    for n in SIZES[:-1] if quick else SIZES:
        found = fresh_process("-m", __name__, str(n))[1]
        per_frame, added = found["seconds"] / n, found["megabytes"] - found["baseline"]
        yield Row(
            f"arm fitted to {n:,} frames of markers at {RATE:g} Hz",
            f"{duration(found['seconds'])}, {megabytes(added)} added",
            "",
            f"{n / found['seconds']:,.0f} frames/s",
            f"≥ {WANTED:,.0f} frames/s",
            n / found["seconds"] >= WANTED,
            f"joints {found['degrees']:.2g}° beside the truth (median)",
        )
    seconds, degrees = _scipy()
    yield Row(
        "one frame of it",
        duration(per_frame),
        f"SciPy's least_squares, from the frame before, same derivatives: {duration(seconds)}",
        f"{seconds / per_frame:.3g}×",
        "–",
        None,
        f"SciPy's joints {degrees:.2g}° beside the truth (median)",
    )


def motion(n: int) -> tuple[Recording, Array]:
    """A recording of n frames in which every joint wanders over most of its range, and the joint angles."""
    arm, generator, instants = myoarm(0.31, 0.26, 0.06), np.random.default_rng(0), np.arange(n) / RATE
    knots = np.arange(0.0, instants[-1] + 2.0, 0.4)
    ways = CubicSpline(knots, generator.uniform(-0.5, 0.5, (len(knots), arm.dof)))(instants)
    q = (arm.upper + arm.lower) / 2 + np.clip(ways, -0.9, 0.9) * (arm.upper - arm.lower) / 2
    shown = synthetic_recording(arm, q, instants)
    noisy = shown.positions + generator.normal(0.0, NOISE, shown.positions.shape)
    return Recording(shown.names, noisy, instants, "z", "wandering"), q


def _scipy() -> tuple[float, float]:
    """Time of a frame [s] and the median error [degrees]: bounded least squares, each from the frame before."""
    recording, q = motion(PEER_FRAMES)
    fit = fit_arm(recording)
    names = (*SEGMENTS, *AXES)
    directions = Directions(fit.arm, names, _targets(recording))
    found, before = np.empty_like(q), fit.joint_angles[0]
    begin = time.perf_counter()
    for i in range(len(q)):
        one = directions.take(slice(i, i + 1))
        before = found[i] = least_squares(
            lambda x, one=one: one.residual(x[None])[0][0],
            before,
            lambda x, one=one: one.residual(x[None])[1][0],
            (fit.arm.lower, fit.arm.upper),
        ).x
    return (time.perf_counter() - begin) / len(q), float(np.degrees(np.median(np.abs(found - q))))


def _targets(recording: Recording) -> Array:
    """Directions of the segments and axes; the trunk stands still."""
    pairs = [*SEGMENTS.values(), ("elbow_medial", "elbow_lateral"), ("wrist_ulnar", "wrist_radial")]
    vectors = np.stack([recording.point(b) - recording.point(a) for a, b in pairs], axis=1)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def main(n: int) -> None:
    """Print what the fit of n frames takes, as JSON."""
    fit_arm(motion(200)[0])  # what is loaded on first use
    recording, q = motion(n)
    baseline, begin = peak_memory(), time.perf_counter()
    fit = fit_arm(recording)
    seconds = time.perf_counter() - begin
    degrees = float(np.degrees(np.median(np.abs(fit.joint_angles - q[fit.frames]))))
    print(json.dumps({"seconds": seconds, "megabytes": peak_memory(), "baseline": baseline, "degrees": degrees}))


if __name__ == "__main__":
    main(int(sys.argv[1]))
