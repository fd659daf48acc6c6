"""Learn one profile from several demonstrations, and follow it closely where they agree and loosely where not.

You learn to align demonstrations of unequal pace, to learn their mean and covariance with `ProfileGMM`, and to turn the
covariance into weights of the tracker. They matter where not everything can be had: here the hand has a path of its
own to keep, so that the ellipsoids cannot be met in full, and the weights say which directions may give way.

    python 07_several_demonstrations.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.profiles import ProfileGMM, align, tracking_weights

HOME = np.array([0.3, -0.6, 0.2, -2.1, 0.3, 1.7, 0.5])  # [rad]
SWING = np.array([0.5, 0.4, -0.3, 0.4, 0.5, -0.4, 0.0])


def demonstrations(count, seed=0):
    """Joint paths of a Panda that is led by the hand, each at its own pace: alike at the ends, free in the middle."""
    rng = np.random.default_rng(seed)
    for seconds in rng.uniform(2.0, 4.0, count):
        time = np.linspace(0.0, seconds, int(20 * seconds))
        phase = (time / seconds) ** rng.uniform(0.8, 1.25)
        freedom = 0.25 * rng.standard_normal(7) * np.sin(np.pi * phase[:, None]) ** 2
        noise = 0.005 * rng.standard_normal(7) * np.sin(2 * np.pi * phase[:, None])
        yield time, HOME + SWING * np.sin(np.pi * phase[:, None]) + freedom + noise


def main(folder):
    """Six demonstrations, one profile, two motions."""
    folder.mkdir(parents=True, exist_ok=True)
    arm = mp.load_arm("panda")
    times, joints = zip(*demonstrations(6), strict=True)
    profiles = [arm.manipulability(q) for q in joints]
    alignment = align(profiles, times)
    print(f"{len(profiles)} demonstrations of {min(map(len, profiles))} to {max(map(len, profiles))} ellipsoids")

    model = ProfileGMM(random_state=0).fit(*alignment.stacked())
    time = alignment.time
    profile, covariance = model.predict(time, return_covariance=True)
    spread = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    middle = spread[len(time) // 2]
    print(f"{model.n_components_} Gaussians; spread {spread[0]:.2f} at the start, {middle:.2f} in the middle, {spread[-1]:.2f} at the end")
