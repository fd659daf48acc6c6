"""Ellipsoids of an arm against the Robotics Toolbox, and fits of a human arm to recordings."""

import time
from collections.abc import Iterator

import numpy as np
import roboticstoolbox
from scipy.interpolate import CubicSpline

from maniport.arms import myoarm
from maniport.mocap import Recording, fit_arm, synthetic_recording

from .inputs import Array, load
from .measure import Row, compare, duration, faster

# of markers: rate [Hz] and standard deviation in each direction [m]
RATE = 120.0
NOISE = 5e-4


def rows(quick: bool) -> Iterator[Row]:
    """Yield the Panda's domain and fits of growing recordings."""
    yield _domain(2_000 if quick else 100_000, 0.5 if quick else 3.0)
    fit_arm(recording(200)[0])  # loads the compiled functions
    for n in (1_000,) if quick else (1_000, 10_000, 100_000):
        markers, q = recording(n)
        begin = time.perf_counter()
        fit = fit_arm(markers)
        seconds = time.perf_counter() - begin
        error = float(np.degrees(np.median(np.abs(fit.joint_angles - q[fit.frames]))))
        rate = n / seconds
        note = f"median joint error {error:.2g}°"
        yield Row(
            f"arm fit, {n:,} frames of markers",
            duration(seconds),
            ratio=f"{rate:,.0f} frames/s",
            bound="≥ 2,000 frames/s",
            met=rate >= 2_000,
            note=note,
        )


def _domain(n: int, seconds: float) -> Row:
    arm = load("panda")
    joints = arm.sample(n, random_state=0)
    chain = roboticstoolbox.models.Panda().ets(end="panda_link8")

    def loop() -> Array:
        domain = np.empty((n, 3, 3))
        for i, q in enumerate(joints):
            jacobian = chain.jacob0(q)[:3]
            domain[i] = jacobian @ jacobian.T
        return domain

    error = float(np.abs(arm.manipulability(joints) - loop()).max())
    times = compare(lambda: arm.manipulability(joints), loop, seconds)
    peer = "loop over roboticstoolbox jacob0"
    note = f"largest difference {error:.1g}"
    return faster(f"{n:,} ellipsoids of a Panda", times, peer, 5, note, error < 1e-12)


def recording(n: int) -> tuple[Recording, Array]:
    """Return noisy markers of an arm that moves through most of its range, n frames, and the joint angles."""
    arm = myoarm(0.31, 0.26, 0.06)
    generator = np.random.default_rng(0)
    instants = np.arange(n) / RATE
    knots = np.arange(0.0, instants[-1] + 2.0, 0.4)
    waves = CubicSpline(knots, generator.uniform(-0.5, 0.5, (len(knots), arm.dof)))(instants)
    q = (arm.upper + arm.lower) / 2 + np.clip(waves, -0.9, 0.9) * (arm.upper - arm.lower) / 2
    exact = synthetic_recording(arm, q, instants)
    noisy = exact.positions + generator.normal(0.0, NOISE, exact.positions.shape)
    return Recording(exact.names, noisy, instants, "synthetic"), q
